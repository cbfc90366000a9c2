from google.protobuf import descriptor_pb2 as _descriptor_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
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
    KIND_SOURCE: _ClassVar[FieldKind]
    KIND_FRAME_RATE: _ClassVar[FieldKind]

class Names(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    NAMES_FILE: _ClassVar[Names]
    NAMES_DEVICE: _ClassVar[Names]
    NAMES_ADDRESS: _ClassVar[Names]
    NAMES_FILES: _ClassVar[Names]

class Weights(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    WEIGHTS_OPTIONAL: _ClassVar[Weights]
    WEIGHTS_NEEDED: _ClassVar[Weights]
    WEIGHTS_NONE: _ClassVar[Weights]
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
KIND_SOURCE: FieldKind
KIND_FRAME_RATE: FieldKind
NAMES_FILE: Names
NAMES_DEVICE: Names
NAMES_ADDRESS: Names
NAMES_FILES: Names
WEIGHTS_OPTIONAL: Weights
WEIGHTS_NEEDED: Weights
WEIGHTS_NONE: Weights
RULE_FIELD_NUMBER: _ClassVar[int]
rule: _descriptor.FieldDescriptor
BLOCK_FIELD_NUMBER: _ClassVar[int]
block: _descriptor.FieldDescriptor
VALUE_FIELD_NUMBER: _ClassVar[int]
value: _descriptor.FieldDescriptor

class FieldRule(_message.Message):
    __slots__ = ("unit", "min", "max", "above", "default", "required", "kind", "allowed", "example", "min_items", "max_items", "required_unless", "may_repeat", "forms", "overridden_by", "needs_published", "only_with", "needs_torque")
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
    FORMS_FIELD_NUMBER: _ClassVar[int]
    OVERRIDDEN_BY_FIELD_NUMBER: _ClassVar[int]
    NEEDS_PUBLISHED_FIELD_NUMBER: _ClassVar[int]
    ONLY_WITH_FIELD_NUMBER: _ClassVar[int]
    NEEDS_TORQUE_FIELD_NUMBER: _ClassVar[int]
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
    forms: _containers.RepeatedCompositeFieldContainer[ValueForm]
    overridden_by: Override
    needs_published: str
    only_with: Condition
    needs_torque: bool
    def __init__(self, unit: _Optional[str] = ..., min: _Optional[float] = ..., max: _Optional[float] = ..., above: _Optional[float] = ..., default: _Optional[str] = ..., required: _Optional[bool] = ..., kind: _Optional[_Union[FieldKind, str]] = ..., allowed: _Optional[_Iterable[str]] = ..., example: _Optional[str] = ..., min_items: _Optional[int] = ..., max_items: _Optional[int] = ..., required_unless: _Optional[_Iterable[str]] = ..., may_repeat: _Optional[bool] = ..., forms: _Optional[_Iterable[_Union[ValueForm, _Mapping]]] = ..., overridden_by: _Optional[_Union[Override, _Mapping]] = ..., needs_published: _Optional[str] = ..., only_with: _Optional[_Union[Condition, _Mapping]] = ..., needs_torque: _Optional[bool] = ...) -> None: ...

class Condition(_message.Message):
    __slots__ = ("field", "value", "required")
    FIELD_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    REQUIRED_FIELD_NUMBER: _ClassVar[int]
    field: str
    value: str
    required: bool
    def __init__(self, field: _Optional[str] = ..., value: _Optional[str] = ..., required: _Optional[bool] = ...) -> None: ...

class Override(_message.Message):
    __slots__ = ("field", "because")
    FIELD_FIELD_NUMBER: _ClassVar[int]
    BECAUSE_FIELD_NUMBER: _ClassVar[int]
    field: str
    because: str
    def __init__(self, field: _Optional[str] = ..., because: _Optional[str] = ...) -> None: ...

class ValueForm(_message.Message):
    __slots__ = ("pattern", "names", "identity")
    PATTERN_FIELD_NUMBER: _ClassVar[int]
    NAMES_FIELD_NUMBER: _ClassVar[int]
    IDENTITY_FIELD_NUMBER: _ClassVar[int]
    pattern: str
    names: Names
    identity: str
    def __init__(self, pattern: _Optional[str] = ..., names: _Optional[_Union[Names, str]] = ..., identity: _Optional[str] = ...) -> None: ...

class BlockRule(_message.Message):
    __slots__ = ("plugin", "fits", "link", "virtual", "simulated", "publishes", "takes", "bus", "commands", "emulator", "adds_homing_offset")
    PLUGIN_FIELD_NUMBER: _ClassVar[int]
    FITS_FIELD_NUMBER: _ClassVar[int]
    LINK_FIELD_NUMBER: _ClassVar[int]
    VIRTUAL_FIELD_NUMBER: _ClassVar[int]
    SIMULATED_FIELD_NUMBER: _ClassVar[int]
    PUBLISHES_FIELD_NUMBER: _ClassVar[int]
    TAKES_FIELD_NUMBER: _ClassVar[int]
    BUS_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    EMULATOR_FIELD_NUMBER: _ClassVar[int]
    ADDS_HOMING_OFFSET_FIELD_NUMBER: _ClassVar[int]
    plugin: str
    fits: _containers.RepeatedScalarFieldContainer[str]
    link: str
    virtual: bool
    simulated: bool
    publishes: _containers.RepeatedScalarFieldContainer[str]
    takes: _containers.RepeatedScalarFieldContainer[str]
    bus: BusRule
    commands: _containers.RepeatedCompositeFieldContainer[CommandRule]
    emulator: str
    adds_homing_offset: bool
    def __init__(self, plugin: _Optional[str] = ..., fits: _Optional[_Iterable[str]] = ..., link: _Optional[str] = ..., virtual: _Optional[bool] = ..., simulated: _Optional[bool] = ..., publishes: _Optional[_Iterable[str]] = ..., takes: _Optional[_Iterable[str]] = ..., bus: _Optional[_Union[BusRule, _Mapping]] = ..., commands: _Optional[_Iterable[_Union[CommandRule, _Mapping]]] = ..., emulator: _Optional[str] = ..., adds_homing_offset: _Optional[bool] = ...) -> None: ...

class BusRule(_message.Message):
    __slots__ = ("request", "reply", "feedback", "command")
    REQUEST_FIELD_NUMBER: _ClassVar[int]
    REPLY_FIELD_NUMBER: _ClassVar[int]
    FEEDBACK_FIELD_NUMBER: _ClassVar[int]
    COMMAND_FIELD_NUMBER: _ClassVar[int]
    request: int
    reply: int
    feedback: int
    command: int
    def __init__(self, request: _Optional[int] = ..., reply: _Optional[int] = ..., feedback: _Optional[int] = ..., command: _Optional[int] = ...) -> None: ...

class CommandRule(_message.Message):
    __slots__ = ("name", "plugin")
    NAME_FIELD_NUMBER: _ClassVar[int]
    PLUGIN_FIELD_NUMBER: _ClassVar[int]
    name: str
    plugin: str
    def __init__(self, name: _Optional[str] = ..., plugin: _Optional[str] = ...) -> None: ...

class ValueRule(_message.Message):
    __slots__ = ("plugin", "weights", "needs_images")
    PLUGIN_FIELD_NUMBER: _ClassVar[int]
    WEIGHTS_FIELD_NUMBER: _ClassVar[int]
    NEEDS_IMAGES_FIELD_NUMBER: _ClassVar[int]
    plugin: str
    weights: Weights
    needs_images: bool
    def __init__(self, plugin: _Optional[str] = ..., weights: _Optional[_Union[Weights, str]] = ..., needs_images: _Optional[bool] = ...) -> None: ...
