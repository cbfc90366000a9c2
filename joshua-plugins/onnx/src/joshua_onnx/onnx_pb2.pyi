from joshua.schema import config_pb2 as _config_pb2
from joshua.schema import options_pb2 as _options_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class OnnxPolicy(_message.Message):
    __slots__ = ("revision", "units", "actions_per_chunk", "allow_unnormalized")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    UNITS_FIELD_NUMBER: _ClassVar[int]
    ACTIONS_PER_CHUNK_FIELD_NUMBER: _ClassVar[int]
    ALLOW_UNNORMALIZED_FIELD_NUMBER: _ClassVar[int]
    revision: str
    units: _config_pb2.JointPositionUnit
    actions_per_chunk: int
    allow_unnormalized: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, revision: _Optional[str] = ..., units: _Optional[_Union[_config_pb2.JointPositionUnit, str]] = ..., actions_per_chunk: _Optional[int] = ..., allow_unnormalized: _Optional[_Iterable[str]] = ...) -> None: ...
