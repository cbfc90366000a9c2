"""The message of the settings block, registered in the default descriptor pool."""

from __future__ import annotations

from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool

_Field = descriptor_pb2.FieldDescriptorProto
_FIELDS = (
    ("work", _Field.TYPE_STRING),
    ("latency_s", _Field.TYPE_DOUBLE),
    ("chunk_steps", _Field.TYPE_INT32),
    ("fault", _Field.TYPE_STRING),
    ("camera", _Field.TYPE_STRING),
    ("reads_task", _Field.TYPE_BOOL),
    ("joints", _Field.TYPE_STRING),
)


def _registered() -> Any:
    file = descriptor_pb2.FileDescriptorProto(name="toy/policy.proto", package="toy", syntax="proto3")
    message = file.message_type.add(name="PolicyConfig")
    for number, (name, kind) in enumerate(_FIELDS, 1):
        message.field.add(name=name, number=number, type=kind, label=_Field.LABEL_OPTIONAL)
    pool = descriptor_pool.Default()
    pool.AddSerializedFile(file.SerializeToString())
    return pool.FindFileByName(file.name)


DESCRIPTOR = _registered()
