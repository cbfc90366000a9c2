from joshua.schema import comm_pb2 as _comm_pb2
from joshua.schema import options_pb2 as _options_pb2
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class RangeConfig(_message.Message):
    __slots__ = ("comm", "max_m")
    COMM_FIELD_NUMBER: _ClassVar[int]
    MAX_M_FIELD_NUMBER: _ClassVar[int]
    comm: _comm_pb2.Comm
    max_m: float
    def __init__(self, comm: _Optional[_Union[_comm_pb2.Comm, _Mapping]] = ..., max_m: _Optional[float] = ...) -> None: ...

class ClampConfig(_message.Message):
    __slots__ = ("comm", "opening_rad")
    COMM_FIELD_NUMBER: _ClassVar[int]
    OPENING_RAD_FIELD_NUMBER: _ClassVar[int]
    comm: _comm_pb2.Comm
    opening_rad: float
    def __init__(self, comm: _Optional[_Union[_comm_pb2.Comm, _Mapping]] = ..., opening_rad: _Optional[float] = ...) -> None: ...
