from google.protobuf import descriptor_pb2 as _descriptor_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class FieldKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    KIND_UNSPECIFIED: _ClassVar[FieldKind]
    KIND_TOPIC: _ClassVar[FieldKind]
    KIND_NODE_NAME: _ClassVar[FieldKind]
    KIND_NAMESPACE: _ClassVar[FieldKind]
    KIND_SERIAL_PORT: _ClassVar[FieldKind]
    KIND_CAMERA_INDEX: _ClassVar[FieldKind]
    KIND_BLE_DEVICE: _ClassVar[FieldKind]
    KIND_UUID: _ClassVar[FieldKind]
    KIND_INPUT_FILE: _ClassVar[FieldKind]
    KIND_OUTPUT_PATH: _ClassVar[FieldKind]
    KIND_MODEL: _ClassVar[FieldKind]
    KIND_DATASET: _ClassVar[FieldKind]
    KIND_MOTOR_ID: _ClassVar[FieldKind]
    KIND_JOINT: _ClassVar[FieldKind]
    KIND_FRAME: _ClassVar[FieldKind]
    KIND_HOST: _ClassVar[FieldKind]
    KIND_INTERPRETER: _ClassVar[FieldKind]
    KIND_ENDPOINT: _ClassVar[FieldKind]
    KIND_RATE: _ClassVar[FieldKind]
    KIND_INCLUDE: _ClassVar[FieldKind]
    KIND_CAMERA_SOURCE: _ClassVar[FieldKind]
KIND_UNSPECIFIED: FieldKind
KIND_TOPIC: FieldKind
KIND_NODE_NAME: FieldKind
KIND_NAMESPACE: FieldKind
KIND_SERIAL_PORT: FieldKind
KIND_CAMERA_INDEX: FieldKind
KIND_BLE_DEVICE: FieldKind
KIND_UUID: FieldKind
KIND_INPUT_FILE: FieldKind
KIND_OUTPUT_PATH: FieldKind
KIND_MODEL: FieldKind
KIND_DATASET: FieldKind
KIND_MOTOR_ID: FieldKind
KIND_JOINT: FieldKind
KIND_FRAME: FieldKind
KIND_HOST: FieldKind
KIND_INTERPRETER: FieldKind
KIND_ENDPOINT: FieldKind
KIND_RATE: FieldKind
KIND_INCLUDE: FieldKind
KIND_CAMERA_SOURCE: FieldKind
RULE_FIELD_NUMBER: _ClassVar[int]
rule: _descriptor.FieldDescriptor

class FieldRule(_message.Message):
    __slots__ = ("unit", "min", "max", "above", "default", "required", "kind", "allowed", "example", "min_items", "max_items", "required_unless", "may_repeat")
    UNIT_FIELD_NUMBER: _ClassVar[int]
    MIN_FIELD_NUMBER: _ClassVar[int]
    MAX_FIELD_NUMBER: _ClassVar[int]
    ABOVE_FIELD_NUMBER: _ClassVar[int]
    DEFAULT_FIELD_NUMBER: _ClassVar[int]
    REQUIRED_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    ALLOWED_FIELD_NUMBER: _ClassVar[int]
    EXAMPLE_FIELD_NUMBER: _ClassVar[int]
    MIN_ITEMS_FIELD_NUMBER: _ClassVar[int]
    MAX_ITEMS_FIELD_NUMBER: _ClassVar[int]
    REQUIRED_UNLESS_FIELD_NUMBER: _ClassVar[int]
    MAY_REPEAT_FIELD_NUMBER: _ClassVar[int]
    unit: str
    min: float
    max: float
    above: float
    default: str
    required: bool
    kind: FieldKind
    allowed: _containers.RepeatedScalarFieldContainer[str]
    example: str
    min_items: int
    max_items: int
    required_unless: _containers.RepeatedScalarFieldContainer[str]
    may_repeat: bool
    def __init__(self, unit: _Optional[str] = ..., min: _Optional[float] = ..., max: _Optional[float] = ..., above: _Optional[float] = ..., default: _Optional[str] = ..., required: _Optional[bool] = ..., kind: _Optional[_Union[FieldKind, str]] = ..., allowed: _Optional[_Iterable[str]] = ..., example: _Optional[str] = ..., min_items: _Optional[int] = ..., max_items: _Optional[int] = ..., required_unless: _Optional[_Iterable[str]] = ..., may_repeat: _Optional[bool] = ...) -> None: ...
