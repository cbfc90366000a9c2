from google.protobuf import any_pb2 as _any_pb2
from joshua.schema import options_pb2 as _options_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SimulationMode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    SIMULATION_MODE_UNSPECIFIED: _ClassVar[SimulationMode]
    INTERACTIVE: _ClassVar[SimulationMode]
    PASSIVE: _ClassVar[SimulationMode]
    MIRROR: _ClassVar[SimulationMode]
    OFFSCREEN: _ClassVar[SimulationMode]

class TrajectoryUnit(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    TRAJECTORY_UNIT_AUTO: _ClassVar[TrajectoryUnit]
    TRAJECTORY_UNIT_RADIANS: _ClassVar[TrajectoryUnit]
    TRAJECTORY_UNIT_DEGREES: _ClassVar[TrajectoryUnit]
    TRAJECTORY_UNIT_LEROBOT: _ClassVar[TrajectoryUnit]
    TRAJECTORY_UNIT_LEROBOT_DEGREES: _ClassVar[TrajectoryUnit]

class DivergencePolicy(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    DIVERGENCE_RESET: _ClassVar[DivergencePolicy]
    DIVERGENCE_STOP_RUN: _ClassVar[DivergencePolicy]
SIMULATION_MODE_UNSPECIFIED: SimulationMode
INTERACTIVE: SimulationMode
PASSIVE: SimulationMode
MIRROR: SimulationMode
OFFSCREEN: SimulationMode
TRAJECTORY_UNIT_AUTO: TrajectoryUnit
TRAJECTORY_UNIT_RADIANS: TrajectoryUnit
TRAJECTORY_UNIT_DEGREES: TrajectoryUnit
TRAJECTORY_UNIT_LEROBOT: TrajectoryUnit
TRAJECTORY_UNIT_LEROBOT_DEGREES: TrajectoryUnit
DIVERGENCE_RESET: DivergencePolicy
DIVERGENCE_STOP_RUN: DivergencePolicy

class SimulationConfig(_message.Message):
    __slots__ = ("mode", "model_path", "mirror_topic_mappings", "plugin_config", "trajectory_path", "replay_speed", "real_time_factor", "keyframe", "seed", "on_divergence", "joint_state_rate_hz", "use_sim_time", "renders", "attached", "generate", "variation", "trajectory_unit", "shadows")
    MODE_FIELD_NUMBER: _ClassVar[int]
    MODEL_PATH_FIELD_NUMBER: _ClassVar[int]
    MIRROR_TOPIC_MAPPINGS_FIELD_NUMBER: _ClassVar[int]
    PLUGIN_CONFIG_FIELD_NUMBER: _ClassVar[int]
    TRAJECTORY_PATH_FIELD_NUMBER: _ClassVar[int]
    REPLAY_SPEED_FIELD_NUMBER: _ClassVar[int]
    REAL_TIME_FACTOR_FIELD_NUMBER: _ClassVar[int]
    KEYFRAME_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    ON_DIVERGENCE_FIELD_NUMBER: _ClassVar[int]
    JOINT_STATE_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    USE_SIM_TIME_FIELD_NUMBER: _ClassVar[int]
    RENDERS_FIELD_NUMBER: _ClassVar[int]
    ATTACHED_FIELD_NUMBER: _ClassVar[int]
    GENERATE_FIELD_NUMBER: _ClassVar[int]
    VARIATION_FIELD_NUMBER: _ClassVar[int]
    TRAJECTORY_UNIT_FIELD_NUMBER: _ClassVar[int]
    SHADOWS_FIELD_NUMBER: _ClassVar[int]
    mode: SimulationMode
    model_path: str
    mirror_topic_mappings: _containers.RepeatedCompositeFieldContainer[MirrorTopicMapping]
    plugin_config: _any_pb2.Any
    trajectory_path: str
    replay_speed: float
    real_time_factor: float
    keyframe: str
    seed: int
    on_divergence: DivergencePolicy
    joint_state_rate_hz: float
    use_sim_time: bool
    renders: _containers.RepeatedCompositeFieldContainer[RenderOutput]
    attached: _containers.RepeatedCompositeFieldContainer[AttachedModel]
    generate: GeneratedEpisodes
    variation: SceneVariation
    trajectory_unit: TrajectoryUnit
    shadows: bool
    def __init__(self, mode: _Optional[_Union[SimulationMode, str]] = ..., model_path: _Optional[str] = ..., mirror_topic_mappings: _Optional[_Iterable[_Union[MirrorTopicMapping, _Mapping]]] = ..., plugin_config: _Optional[_Union[_any_pb2.Any, _Mapping]] = ..., trajectory_path: _Optional[str] = ..., replay_speed: _Optional[float] = ..., real_time_factor: _Optional[float] = ..., keyframe: _Optional[str] = ..., seed: _Optional[int] = ..., on_divergence: _Optional[_Union[DivergencePolicy, str]] = ..., joint_state_rate_hz: _Optional[float] = ..., use_sim_time: bool = ..., renders: _Optional[_Iterable[_Union[RenderOutput, _Mapping]]] = ..., attached: _Optional[_Iterable[_Union[AttachedModel, _Mapping]]] = ..., generate: _Optional[_Union[GeneratedEpisodes, _Mapping]] = ..., variation: _Optional[_Union[SceneVariation, _Mapping]] = ..., trajectory_unit: _Optional[_Union[TrajectoryUnit, str]] = ..., shadows: bool = ...) -> None: ...

class GeneratedEpisodes(_message.Message):
    __slots__ = ("count", "duration_s", "fps", "cameras", "width", "height")
    COUNT_FIELD_NUMBER: _ClassVar[int]
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    FPS_FIELD_NUMBER: _ClassVar[int]
    CAMERAS_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    count: int
    duration_s: float
    fps: int
    cameras: _containers.RepeatedScalarFieldContainer[str]
    width: int
    height: int
    def __init__(self, count: _Optional[int] = ..., duration_s: _Optional[float] = ..., fps: _Optional[int] = ..., cameras: _Optional[_Iterable[str]] = ..., width: _Optional[int] = ..., height: _Optional[int] = ...) -> None: ...

class SceneVariation(_message.Message):
    __slots__ = ("joint_rad", "object_m", "light", "camera_m", "camera_rad")
    JOINT_RAD_FIELD_NUMBER: _ClassVar[int]
    OBJECT_M_FIELD_NUMBER: _ClassVar[int]
    LIGHT_FIELD_NUMBER: _ClassVar[int]
    CAMERA_M_FIELD_NUMBER: _ClassVar[int]
    CAMERA_RAD_FIELD_NUMBER: _ClassVar[int]
    joint_rad: float
    object_m: float
    light: float
    camera_m: float
    camera_rad: float
    def __init__(self, joint_rad: _Optional[float] = ..., object_m: _Optional[float] = ..., light: _Optional[float] = ..., camera_m: _Optional[float] = ..., camera_rad: _Optional[float] = ...) -> None: ...

class RenderOutput(_message.Message):
    __slots__ = ("camera", "width", "height", "fps", "output")
    CAMERA_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    FPS_FIELD_NUMBER: _ClassVar[int]
    OUTPUT_FIELD_NUMBER: _ClassVar[int]
    camera: str
    width: int
    height: int
    fps: int
    output: str
    def __init__(self, camera: _Optional[str] = ..., width: _Optional[int] = ..., height: _Optional[int] = ..., fps: _Optional[int] = ..., output: _Optional[str] = ...) -> None: ...

class AttachedModel(_message.Message):
    __slots__ = ("model_path", "prefix", "position_m", "yaw_rad")
    MODEL_PATH_FIELD_NUMBER: _ClassVar[int]
    PREFIX_FIELD_NUMBER: _ClassVar[int]
    POSITION_M_FIELD_NUMBER: _ClassVar[int]
    YAW_RAD_FIELD_NUMBER: _ClassVar[int]
    model_path: str
    prefix: str
    position_m: _containers.RepeatedScalarFieldContainer[float]
    yaw_rad: float
    def __init__(self, model_path: _Optional[str] = ..., prefix: _Optional[str] = ..., position_m: _Optional[_Iterable[float]] = ..., yaw_rad: _Optional[float] = ...) -> None: ...

class MirrorTopicMapping(_message.Message):
    __slots__ = ("ros_topic", "mujoco_actuator", "offset", "scale", "joint")
    ROS_TOPIC_FIELD_NUMBER: _ClassVar[int]
    MUJOCO_ACTUATOR_FIELD_NUMBER: _ClassVar[int]
    OFFSET_FIELD_NUMBER: _ClassVar[int]
    SCALE_FIELD_NUMBER: _ClassVar[int]
    JOINT_FIELD_NUMBER: _ClassVar[int]
    ros_topic: str
    mujoco_actuator: str
    offset: float
    scale: float
    joint: str
    def __init__(self, ros_topic: _Optional[str] = ..., mujoco_actuator: _Optional[str] = ..., offset: _Optional[float] = ..., scale: _Optional[float] = ..., joint: _Optional[str] = ...) -> None: ...
