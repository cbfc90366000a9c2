from joshua.schema import config_pb2 as _config_pb2
from joshua.schema import options_pb2 as _options_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class PpoPolicy(_message.Message):
    __slots__ = ("goal_m",)
    GOAL_M_FIELD_NUMBER: _ClassVar[int]
    goal_m: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, goal_m: _Optional[_Iterable[float]] = ...) -> None: ...
