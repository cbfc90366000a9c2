from joshua.schema import options_pb2 as _options_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Calibration(_message.Message):
    __slots__ = ("arms",)
    ARMS_FIELD_NUMBER: _ClassVar[int]
    arms: _containers.RepeatedCompositeFieldContainer[ArmCalibration]
    def __init__(self, arms: _Optional[_Iterable[_Union[ArmCalibration, _Mapping]]] = ...) -> None: ...

class ArmCalibration(_message.Message):
    __slots__ = ("node_name", "device_identity", "calibrated_at", "motors")
    NODE_NAME_FIELD_NUMBER: _ClassVar[int]
    DEVICE_IDENTITY_FIELD_NUMBER: _ClassVar[int]
    CALIBRATED_AT_FIELD_NUMBER: _ClassVar[int]
    MOTORS_FIELD_NUMBER: _ClassVar[int]
    node_name: str
    device_identity: str
    calibrated_at: str
    motors: _containers.RepeatedCompositeFieldContainer[MotorCalibration]
    def __init__(self, node_name: _Optional[str] = ..., device_identity: _Optional[str] = ..., calibrated_at: _Optional[str] = ..., motors: _Optional[_Iterable[_Union[MotorCalibration, _Mapping]]] = ...) -> None: ...

class MotorCalibration(_message.Message):
    __slots__ = ("id", "joint_name", "homing_offset", "range_min", "range_max", "inverted")
    ID_FIELD_NUMBER: _ClassVar[int]
    JOINT_NAME_FIELD_NUMBER: _ClassVar[int]
    HOMING_OFFSET_FIELD_NUMBER: _ClassVar[int]
    RANGE_MIN_FIELD_NUMBER: _ClassVar[int]
    RANGE_MAX_FIELD_NUMBER: _ClassVar[int]
    INVERTED_FIELD_NUMBER: _ClassVar[int]
    id: int
    joint_name: str
    homing_offset: int
    range_min: int
    range_max: int
    inverted: bool
    def __init__(self, id: _Optional[int] = ..., joint_name: _Optional[str] = ..., homing_offset: _Optional[int] = ..., range_min: _Optional[int] = ..., range_max: _Optional[int] = ..., inverted: bool = ...) -> None: ...
