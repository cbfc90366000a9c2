from google.protobuf import any_pb2 as _any_pb2
from joshua.schema import options_pb2 as _options_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SimulationMode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    SIMULATION_MODE_UNSPECIFIED: _ClassVar[SimulationMode]
    INTERACTIVE: _ClassVar[SimulationMode]
    PASSIVE: _ClassVar[SimulationMode]
    MIRROR: _ClassVar[SimulationMode]
    OFFSCREEN: _ClassVar[SimulationMode]
SIMULATION_MODE_UNSPECIFIED: SimulationMode
INTERACTIVE: SimulationMode
PASSIVE: SimulationMode
MIRROR: SimulationMode
OFFSCREEN: SimulationMode

class SimulationConfig(_message.Message):
    __slots__ = ("mode", "model_path", "mirror_topic_mappings", "plugin_config")
    MODE_FIELD_NUMBER: _ClassVar[int]
    MODEL_PATH_FIELD_NUMBER: _ClassVar[int]
    MIRROR_TOPIC_MAPPINGS_FIELD_NUMBER: _ClassVar[int]
    PLUGIN_CONFIG_FIELD_NUMBER: _ClassVar[int]
    mode: SimulationMode
    model_path: str
    mirror_topic_mappings: _containers.RepeatedCompositeFieldContainer[MirrorTopicMapping]
    plugin_config: _any_pb2.Any
    def __init__(self, mode: _Optional[_Union[SimulationMode, str]] = ..., model_path: _Optional[str] = ..., mirror_topic_mappings: _Optional[_Iterable[_Union[MirrorTopicMapping, _Mapping]]] = ..., plugin_config: _Optional[_Union[_any_pb2.Any, _Mapping]] = ...) -> None: ...

class MirrorTopicMapping(_message.Message):
    __slots__ = ("ros_topic", "mujoco_actuator")
    ROS_TOPIC_FIELD_NUMBER: _ClassVar[int]
    MUJOCO_ACTUATOR_FIELD_NUMBER: _ClassVar[int]
    ros_topic: str
    mujoco_actuator: str
    def __init__(self, ros_topic: _Optional[str] = ..., mujoco_actuator: _Optional[str] = ...) -> None: ...
