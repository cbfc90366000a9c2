from joshua.schema import options_pb2 as _options_pb2
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class GripperConfig(_message.Message):
    __slots__ = ("stroke_m", "finger_length_m", "speed_rad_s")
    STROKE_M_FIELD_NUMBER: _ClassVar[int]
    FINGER_LENGTH_M_FIELD_NUMBER: _ClassVar[int]
    SPEED_RAD_S_FIELD_NUMBER: _ClassVar[int]
    stroke_m: float
    finger_length_m: float
    speed_rad_s: float
    def __init__(self, stroke_m: _Optional[float] = ..., finger_length_m: _Optional[float] = ..., speed_rad_s: _Optional[float] = ...) -> None: ...
