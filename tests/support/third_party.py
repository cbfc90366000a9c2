"""A third party's message with a field of each kind, registered in the default descriptor pool."""

from __future__ import annotations

from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

PACKAGE = "acme.reader_test"
TYPE_NAME = f"{PACKAGE}.Sample"
URL = f"type.example.org/{TYPE_NAME}"

_Field = descriptor_pb2.FieldDescriptorProto
_SCALARS = (
    ("f_double", _Field.TYPE_DOUBLE),
    ("f_float", _Field.TYPE_FLOAT),
    ("f_int64", _Field.TYPE_INT64),
    ("f_uint64", _Field.TYPE_UINT64),
    ("f_int32", _Field.TYPE_INT32),
    ("f_fixed64", _Field.TYPE_FIXED64),
    ("f_fixed32", _Field.TYPE_FIXED32),
    ("f_bool", _Field.TYPE_BOOL),
    ("f_string", _Field.TYPE_STRING),
    ("f_bytes", _Field.TYPE_BYTES),
    ("f_uint32", _Field.TYPE_UINT32),
    ("f_sfixed32", _Field.TYPE_SFIXED32),
    ("f_sfixed64", _Field.TYPE_SFIXED64),
    ("f_sint32", _Field.TYPE_SINT32),
    ("f_sint64", _Field.TYPE_SINT64),
)


def _file() -> descriptor_pb2.FileDescriptorProto:
    file = descriptor_pb2.FileDescriptorProto(
        name="acme_reader_test/sample.proto", package=PACKAGE, syntax="proto3"
    )
    color = file.enum_type.add(name="Color")
    for number, name in enumerate(("COLOR_UNSPECIFIED", "RED", "GREEN")):
        color.value.add(name=name, number=number)
    sample = file.message_type.add(name="Sample")
    for number, (name, kind) in enumerate(_SCALARS, 1):
        sample.field.add(name=name, number=number, type=kind, label=_Field.LABEL_OPTIONAL)
        sample.field.add(name=f"many_{name}", number=number + 100, type=kind, label=_Field.LABEL_REPEATED)
    enum_type = f".{PACKAGE}.Color"
    sample_type = f".{PACKAGE}.Sample"
    sample.field.add(name="color", number=50, type=_Field.TYPE_ENUM, type_name=enum_type)
    sample.field.add(
        name="colors", number=51, type=_Field.TYPE_ENUM, type_name=enum_type, label=_Field.LABEL_REPEATED
    )
    sample.field.add(name="inner", number=52, type=_Field.TYPE_MESSAGE, type_name=sample_type)
    sample.field.add(
        name="inners", number=53, type=_Field.TYPE_MESSAGE, type_name=sample_type, label=_Field.LABEL_REPEATED
    )
    sample.oneof_decl.add(name="choice")
    sample.field.add(name="left", number=54, type=_Field.TYPE_INT32, oneof_index=0)
    sample.field.add(name="right", number=55, type=_Field.TYPE_STRING, oneof_index=0)
    sample.oneof_decl.add(name="_maybe")
    sample.field.add(name="maybe", number=56, type=_Field.TYPE_INT32, oneof_index=1, proto3_optional=True)
    _add_map(sample, "counts", 57, value_kind=_Field.TYPE_INT32)
    _add_map(sample, "parts", 58, value_kind=_Field.TYPE_MESSAGE, value_type=sample_type)
    sample.field.add(name="anything", number=59, type=_Field.TYPE_MESSAGE, type_name=".google.protobuf.Any")
    file.dependency.append("google/protobuf/any.proto")
    return file


def _add_map(message: Any, name: str, number: int, value_kind: Any, value_type: str = "") -> None:
    entry = message.nested_type.add(name=f"{name.capitalize()}Entry")
    entry.options.map_entry = True
    entry.field.add(name="key", number=1, type=_Field.TYPE_STRING, label=_Field.LABEL_OPTIONAL)
    entry.field.add(
        name="value", number=2, type=value_kind, type_name=value_type or None, label=_Field.LABEL_OPTIONAL
    )
    message.field.add(
        name=name,
        number=number,
        type=_Field.TYPE_MESSAGE,
        type_name=f".{PACKAGE}.Sample.{entry.name}",
        label=_Field.LABEL_REPEATED,
    )


def sample_class() -> Any:
    """Returns the message class; the descriptor is registered at the first call."""
    from google.protobuf import any_pb2

    assert any_pb2.DESCRIPTOR.name == "google/protobuf/any.proto"  # the file that ours imports
    pool = descriptor_pool.Default()
    try:
        descriptor = pool.FindMessageTypeByName(TYPE_NAME)
    except KeyError:
        pool.AddSerializedFile(_file().SerializeToString())
        descriptor = pool.FindMessageTypeByName(TYPE_NAME)
    return message_factory.GetMessageClass(descriptor)
