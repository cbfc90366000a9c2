from google.protobuf import any_pb2 as _any_pb2
from joshua.schema import calibration_pb2 as _calibration_pb2
from joshua.schema import comm_pb2 as _comm_pb2
from joshua.schema import data_type_pb2 as _data_type_pb2
from joshua.schema import options_pb2 as _options_pb2
from joshua.schema import simulation_pb2 as _simulation_pb2
from joshua.schema import transport_pb2 as _transport_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class OperationMode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MODE_UNSPECIFIED: _ClassVar[OperationMode]
    MODE_TELEOPERATE: _ClassVar[OperationMode]
    MODE_INFERENCE: _ClassVar[OperationMode]
    MODE_TRAINING: _ClassVar[OperationMode]
    MODE_CALIBRATION: _ClassVar[OperationMode]
    MODE_TEST: _ClassVar[OperationMode]
    MODE_DATA_STORE: _ClassVar[OperationMode]
    MODE_SIMULATION: _ClassVar[OperationMode]
    MODE_PLUGIN: _ClassVar[OperationMode]

class ActionType(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ACTION_UNSPECIFIED: _ClassVar[ActionType]
    ACTION_LEADER: _ClassVar[ActionType]
    ACTION_FOLLOWER: _ClassVar[ActionType]
    ACTION_SINGLE: _ClassVar[ActionType]
    ACTION_MOCK: _ClassVar[ActionType]
    ACTION_SPIKE: _ClassVar[ActionType]
    ACTION_PLUGIN: _ClassVar[ActionType]

class SafeState(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    SAFE_STATE_UNSPECIFIED: _ClassVar[SafeState]
    HOLD: _ClassVar[SafeState]
    RELEASE: _ClassVar[SafeState]
    PARK_THEN_RELEASE: _ClassVar[SafeState]

class MockMotion(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MOCK_MOTION_NONE: _ClassVar[MockMotion]
    MOCK_MOTION_SINE: _ClassVar[MockMotion]
    MOCK_MOTION_FILE: _ClassVar[MockMotion]

class PerceptionType(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    PERCEPTION_UNSPECIFIED: _ClassVar[PerceptionType]
    PERCEPTION_CAMERA: _ClassVar[PerceptionType]
    PERCEPTION_ENCODER: _ClassVar[PerceptionType]
    PERCEPTION_LIDAR: _ClassVar[PerceptionType]
    PERCEPTION_PLUGIN: _ClassVar[PerceptionType]
    PERCEPTION_GAMEPAD: _ClassVar[PerceptionType]
    PERCEPTION_KEYBOARD: _ClassVar[PerceptionType]

class ModelType(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MODEL_UNSPECIFIED: _ClassVar[ModelType]
    RANDOM_NOISE: _ClassVar[ModelType]
    SMOLVLA: _ClassVar[ModelType]
    MODEL_PLUGIN: _ClassVar[ModelType]

class ExecutionStrategy(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    EXECUTION_DEFAULT: _ClassVar[ExecutionStrategy]
    REPLACE_ON_ARRIVAL: _ClassVar[ExecutionStrategy]
    TEMPORAL_ENSEMBLE: _ClassVar[ExecutionStrategy]
    REAL_TIME_CHUNKING: _ClassVar[ExecutionStrategy]
    SYNCHRONOUS: _ClassVar[ExecutionStrategy]

class GuidanceSchedule(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    GUIDANCE_DEFAULT: _ClassVar[GuidanceSchedule]
    GUIDANCE_EXP: _ClassVar[GuidanceSchedule]
    GUIDANCE_LINEAR: _ClassVar[GuidanceSchedule]
    GUIDANCE_ONES: _ClassVar[GuidanceSchedule]
    GUIDANCE_ZEROS: _ClassVar[GuidanceSchedule]

class DataFormat(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    FORMAT_UNSPECIFIED: _ClassVar[DataFormat]
    FORMAT_HUGGINGFACE: _ClassVar[DataFormat]
    FORMAT_CSV: _ClassVar[DataFormat]
    FORMAT_JSONL: _ClassVar[DataFormat]
    FORMAT_PARQUET: _ClassVar[DataFormat]
    FORMAT_PLUGIN: _ClassVar[DataFormat]
    FORMAT_MCAP: _ClassVar[DataFormat]

class StorageBackend(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    STORAGE_UNSPECIFIED: _ClassVar[StorageBackend]
    STORAGE_LOCAL: _ClassVar[StorageBackend]
    STORAGE_CLOUD: _ClassVar[StorageBackend]
    STORAGE_PLUGIN: _ClassVar[StorageBackend]

class DataStoreOperation(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    DATA_STORE_OPERATION_UNSPECIFIED: _ClassVar[DataStoreOperation]
    DATA_STORE_RECORD: _ClassVar[DataStoreOperation]
    DATA_STORE_UPLOAD: _ClassVar[DataStoreOperation]
    DATA_STORE_REPLAY: _ClassVar[DataStoreOperation]

class UploadTime(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    UPLOAD_UNSPECIFIED: _ClassVar[UploadTime]
    AFTER_EACH_EPISODE: _ClassVar[UploadTime]
    AT_END: _ClassVar[UploadTime]
    MANUAL: _ClassVar[UploadTime]

class MissingPolicy(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MISSING_UNSPECIFIED: _ClassVar[MissingPolicy]
    MISSING_DROP: _ClassVar[MissingPolicy]
    MISSING_HOLD: _ClassVar[MissingPolicy]
    MISSING_FAIL: _ClassVar[MissingPolicy]

class VideoCodec(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    VIDEO_UNSPECIFIED: _ClassVar[VideoCodec]
    VIDEO_H264: _ClassVar[VideoCodec]
    VIDEO_HEVC: _ClassVar[VideoCodec]
    VIDEO_AV1: _ClassVar[VideoCodec]

class JointPositionUnit(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    UNIT_AUTO: _ClassVar[JointPositionUnit]
    UNIT_LEROBOT: _ClassVar[JointPositionUnit]
    UNIT_DEGREES: _ClassVar[JointPositionUnit]
    UNIT_RADIANS: _ClassVar[JointPositionUnit]

class PictureStorage(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    PICTURES_UNSPECIFIED: _ClassVar[PictureStorage]
    PICTURES_VIDEO: _ClassVar[PictureStorage]
    PICTURES_PNG: _ClassVar[PictureStorage]
    PICTURES_JPEG: _ClassVar[PictureStorage]

class TrainingEnvironment(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ENV_UNSPECIFIED: _ClassVar[TrainingEnvironment]
    ENV_SIMULATION: _ClassVar[TrainingEnvironment]
    ENV_REAL: _ClassVar[TrainingEnvironment]

class TrainingMethod(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    METHOD_UNSPECIFIED: _ClassVar[TrainingMethod]
    METHOD_RL: _ClassVar[TrainingMethod]
    METHOD_IMITATION: _ClassVar[TrainingMethod]
    METHOD_EVAL: _ClassVar[TrainingMethod]
    METHOD_PLUGIN: _ClassVar[TrainingMethod]

class SimulatorBackend(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    BACKEND_UNSPECIFIED: _ClassVar[SimulatorBackend]
    BACKEND_MJX: _ClassVar[SimulatorBackend]
    BACKEND_ISAAC: _ClassVar[SimulatorBackend]
    BACKEND_PLUGIN: _ClassVar[SimulatorBackend]
    BACKEND_MUJOCO: _ClassVar[SimulatorBackend]

class NodeType(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    NODE_TYPE_UNSPECIFIED: _ClassVar[NodeType]
    CPP: _ClassVar[NodeType]
    PYTHON: _ClassVar[NodeType]

class RestartPolicy(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    RESTART_DEFAULT: _ClassVar[RestartPolicy]
    RESTART_NEVER: _ClassVar[RestartPolicy]
    RESTART_ON_FAILURE: _ClassVar[RestartPolicy]
    RESTART_STOP_RUN: _ClassVar[RestartPolicy]

class Reliability(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    RELIABLE: _ClassVar[Reliability]
    BEST_EFFORT: _ClassVar[Reliability]

class Durability(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    VOLATILE: _ClassVar[Durability]
    TRANSIENT_LOCAL: _ClassVar[Durability]

class History(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    KEEP_LAST: _ClassVar[History]
    KEEP_ALL: _ClassVar[History]

class Liveliness(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    AUTOMATIC: _ClassVar[Liveliness]
    MANUAL_BY_TOPIC: _ClassVar[Liveliness]
MODE_UNSPECIFIED: OperationMode
MODE_TELEOPERATE: OperationMode
MODE_INFERENCE: OperationMode
MODE_TRAINING: OperationMode
MODE_CALIBRATION: OperationMode
MODE_TEST: OperationMode
MODE_DATA_STORE: OperationMode
MODE_SIMULATION: OperationMode
MODE_PLUGIN: OperationMode
ACTION_UNSPECIFIED: ActionType
ACTION_LEADER: ActionType
ACTION_FOLLOWER: ActionType
ACTION_SINGLE: ActionType
ACTION_MOCK: ActionType
ACTION_SPIKE: ActionType
ACTION_PLUGIN: ActionType
SAFE_STATE_UNSPECIFIED: SafeState
HOLD: SafeState
RELEASE: SafeState
PARK_THEN_RELEASE: SafeState
MOCK_MOTION_NONE: MockMotion
MOCK_MOTION_SINE: MockMotion
MOCK_MOTION_FILE: MockMotion
PERCEPTION_UNSPECIFIED: PerceptionType
PERCEPTION_CAMERA: PerceptionType
PERCEPTION_ENCODER: PerceptionType
PERCEPTION_LIDAR: PerceptionType
PERCEPTION_PLUGIN: PerceptionType
PERCEPTION_GAMEPAD: PerceptionType
PERCEPTION_KEYBOARD: PerceptionType
MODEL_UNSPECIFIED: ModelType
RANDOM_NOISE: ModelType
SMOLVLA: ModelType
MODEL_PLUGIN: ModelType
EXECUTION_DEFAULT: ExecutionStrategy
REPLACE_ON_ARRIVAL: ExecutionStrategy
TEMPORAL_ENSEMBLE: ExecutionStrategy
REAL_TIME_CHUNKING: ExecutionStrategy
SYNCHRONOUS: ExecutionStrategy
GUIDANCE_DEFAULT: GuidanceSchedule
GUIDANCE_EXP: GuidanceSchedule
GUIDANCE_LINEAR: GuidanceSchedule
GUIDANCE_ONES: GuidanceSchedule
GUIDANCE_ZEROS: GuidanceSchedule
FORMAT_UNSPECIFIED: DataFormat
FORMAT_HUGGINGFACE: DataFormat
FORMAT_CSV: DataFormat
FORMAT_JSONL: DataFormat
FORMAT_PARQUET: DataFormat
FORMAT_PLUGIN: DataFormat
FORMAT_MCAP: DataFormat
STORAGE_UNSPECIFIED: StorageBackend
STORAGE_LOCAL: StorageBackend
STORAGE_CLOUD: StorageBackend
STORAGE_PLUGIN: StorageBackend
DATA_STORE_OPERATION_UNSPECIFIED: DataStoreOperation
DATA_STORE_RECORD: DataStoreOperation
DATA_STORE_UPLOAD: DataStoreOperation
DATA_STORE_REPLAY: DataStoreOperation
UPLOAD_UNSPECIFIED: UploadTime
AFTER_EACH_EPISODE: UploadTime
AT_END: UploadTime
MANUAL: UploadTime
MISSING_UNSPECIFIED: MissingPolicy
MISSING_DROP: MissingPolicy
MISSING_HOLD: MissingPolicy
MISSING_FAIL: MissingPolicy
VIDEO_UNSPECIFIED: VideoCodec
VIDEO_H264: VideoCodec
VIDEO_HEVC: VideoCodec
VIDEO_AV1: VideoCodec
UNIT_AUTO: JointPositionUnit
UNIT_LEROBOT: JointPositionUnit
UNIT_DEGREES: JointPositionUnit
UNIT_RADIANS: JointPositionUnit
PICTURES_UNSPECIFIED: PictureStorage
PICTURES_VIDEO: PictureStorage
PICTURES_PNG: PictureStorage
PICTURES_JPEG: PictureStorage
ENV_UNSPECIFIED: TrainingEnvironment
ENV_SIMULATION: TrainingEnvironment
ENV_REAL: TrainingEnvironment
METHOD_UNSPECIFIED: TrainingMethod
METHOD_RL: TrainingMethod
METHOD_IMITATION: TrainingMethod
METHOD_EVAL: TrainingMethod
METHOD_PLUGIN: TrainingMethod
BACKEND_UNSPECIFIED: SimulatorBackend
BACKEND_MJX: SimulatorBackend
BACKEND_ISAAC: SimulatorBackend
BACKEND_PLUGIN: SimulatorBackend
BACKEND_MUJOCO: SimulatorBackend
NODE_TYPE_UNSPECIFIED: NodeType
CPP: NodeType
PYTHON: NodeType
RESTART_DEFAULT: RestartPolicy
RESTART_NEVER: RestartPolicy
RESTART_ON_FAILURE: RestartPolicy
RESTART_STOP_RUN: RestartPolicy
RELIABLE: Reliability
BEST_EFFORT: Reliability
VOLATILE: Durability
TRANSIENT_LOCAL: Durability
KEEP_LAST: History
KEEP_ALL: History
AUTOMATIC: Liveliness
MANUAL_BY_TOPIC: Liveliness

class Config(_message.Message):
    __slots__ = ("general", "robot", "ai", "calibration", "simulation", "include", "test", "transport", "calibration_run")
    GENERAL_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    AI_FIELD_NUMBER: _ClassVar[int]
    CALIBRATION_FIELD_NUMBER: _ClassVar[int]
    SIMULATION_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_FIELD_NUMBER: _ClassVar[int]
    TEST_FIELD_NUMBER: _ClassVar[int]
    TRANSPORT_FIELD_NUMBER: _ClassVar[int]
    CALIBRATION_RUN_FIELD_NUMBER: _ClassVar[int]
    general: General
    robot: Robot
    ai: Ai
    calibration: _calibration_pb2.Calibration
    simulation: _simulation_pb2.SimulationConfig
    include: _containers.RepeatedScalarFieldContainer[str]
    test: TestConfig
    transport: _transport_pb2.TransportConfig
    calibration_run: CalibrationRun
    def __init__(self, general: _Optional[_Union[General, _Mapping]] = ..., robot: _Optional[_Union[Robot, _Mapping]] = ..., ai: _Optional[_Union[Ai, _Mapping]] = ..., calibration: _Optional[_Union[_calibration_pb2.Calibration, _Mapping]] = ..., simulation: _Optional[_Union[_simulation_pb2.SimulationConfig, _Mapping]] = ..., include: _Optional[_Iterable[str]] = ..., test: _Optional[_Union[TestConfig, _Mapping]] = ..., transport: _Optional[_Union[_transport_pb2.TransportConfig, _Mapping]] = ..., calibration_run: _Optional[_Union[CalibrationRun, _Mapping]] = ...) -> None: ...

class General(_message.Message):
    __slots__ = ("mode", "robot_type", "name", "id", "plugin_config", "plugin_mode")
    MODE_FIELD_NUMBER: _ClassVar[int]
    ROBOT_TYPE_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    PLUGIN_CONFIG_FIELD_NUMBER: _ClassVar[int]
    PLUGIN_MODE_FIELD_NUMBER: _ClassVar[int]
    mode: OperationMode
    robot_type: str
    name: str
    id: str
    plugin_config: _any_pb2.Any
    plugin_mode: str
    def __init__(self, mode: _Optional[_Union[OperationMode, str]] = ..., robot_type: _Optional[str] = ..., name: _Optional[str] = ..., id: _Optional[str] = ..., plugin_config: _Optional[_Union[_any_pb2.Any, _Mapping]] = ..., plugin_mode: _Optional[str] = ...) -> None: ...

class Robot(_message.Message):
    __slots__ = ("actions", "perceptions")
    ACTIONS_FIELD_NUMBER: _ClassVar[int]
    PERCEPTIONS_FIELD_NUMBER: _ClassVar[int]
    actions: _containers.RepeatedCompositeFieldContainer[SingleAction]
    perceptions: _containers.RepeatedCompositeFieldContainer[SinglePerception]
    def __init__(self, actions: _Optional[_Iterable[_Union[SingleAction, _Mapping]]] = ..., perceptions: _Optional[_Iterable[_Union[SinglePerception, _Mapping]]] = ...) -> None: ...

class SingleAction(_message.Message):
    __slots__ = ("node", "action_type", "sts3215_config", "mock_motor_config", "spike_motor_config", "plugin_config", "dynamixel_config", "sim_config", "safe_state", "park_pose_rad", "on_stale", "park_timeout_s", "on_stale_after_s", "hang_after_s")
    NODE_FIELD_NUMBER: _ClassVar[int]
    ACTION_TYPE_FIELD_NUMBER: _ClassVar[int]
    STS3215_CONFIG_FIELD_NUMBER: _ClassVar[int]
    MOCK_MOTOR_CONFIG_FIELD_NUMBER: _ClassVar[int]
    SPIKE_MOTOR_CONFIG_FIELD_NUMBER: _ClassVar[int]
    PLUGIN_CONFIG_FIELD_NUMBER: _ClassVar[int]
    DYNAMIXEL_CONFIG_FIELD_NUMBER: _ClassVar[int]
    SIM_CONFIG_FIELD_NUMBER: _ClassVar[int]
    SAFE_STATE_FIELD_NUMBER: _ClassVar[int]
    PARK_POSE_RAD_FIELD_NUMBER: _ClassVar[int]
    ON_STALE_FIELD_NUMBER: _ClassVar[int]
    PARK_TIMEOUT_S_FIELD_NUMBER: _ClassVar[int]
    ON_STALE_AFTER_S_FIELD_NUMBER: _ClassVar[int]
    HANG_AFTER_S_FIELD_NUMBER: _ClassVar[int]
    node: Node
    action_type: ActionType
    sts3215_config: STS3215Config
    mock_motor_config: MockMotorConfig
    spike_motor_config: SpikeMotorConfig
    plugin_config: _any_pb2.Any
    dynamixel_config: DynamixelConfig
    sim_config: SimActuatorConfig
    safe_state: SafeState
    park_pose_rad: _containers.RepeatedScalarFieldContainer[float]
    on_stale: SafeState
    park_timeout_s: float
    on_stale_after_s: float
    hang_after_s: float
    def __init__(self, node: _Optional[_Union[Node, _Mapping]] = ..., action_type: _Optional[_Union[ActionType, str]] = ..., sts3215_config: _Optional[_Union[STS3215Config, _Mapping]] = ..., mock_motor_config: _Optional[_Union[MockMotorConfig, _Mapping]] = ..., spike_motor_config: _Optional[_Union[SpikeMotorConfig, _Mapping]] = ..., plugin_config: _Optional[_Union[_any_pb2.Any, _Mapping]] = ..., dynamixel_config: _Optional[_Union[DynamixelConfig, _Mapping]] = ..., sim_config: _Optional[_Union[SimActuatorConfig, _Mapping]] = ..., safe_state: _Optional[_Union[SafeState, str]] = ..., park_pose_rad: _Optional[_Iterable[float]] = ..., on_stale: _Optional[_Union[SafeState, str]] = ..., park_timeout_s: _Optional[float] = ..., on_stale_after_s: _Optional[float] = ..., hang_after_s: _Optional[float] = ...) -> None: ...

class STS3215Config(_message.Message):
    __slots__ = ("comm", "motor_ids", "position_min", "position_max", "velocity", "acceleration", "joint")
    COMM_FIELD_NUMBER: _ClassVar[int]
    MOTOR_IDS_FIELD_NUMBER: _ClassVar[int]
    POSITION_MIN_FIELD_NUMBER: _ClassVar[int]
    POSITION_MAX_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_FIELD_NUMBER: _ClassVar[int]
    ACCELERATION_FIELD_NUMBER: _ClassVar[int]
    JOINT_FIELD_NUMBER: _ClassVar[int]
    comm: _comm_pb2.Comm
    motor_ids: _containers.RepeatedScalarFieldContainer[int]
    position_min: int
    position_max: int
    velocity: int
    acceleration: int
    joint: _containers.RepeatedCompositeFieldContainer[STS3215Joint]
    def __init__(self, comm: _Optional[_Union[_comm_pb2.Comm, _Mapping]] = ..., motor_ids: _Optional[_Iterable[int]] = ..., position_min: _Optional[int] = ..., position_max: _Optional[int] = ..., velocity: _Optional[int] = ..., acceleration: _Optional[int] = ..., joint: _Optional[_Iterable[_Union[STS3215Joint, _Mapping]]] = ...) -> None: ...

class STS3215Joint(_message.Message):
    __slots__ = ("motor_id", "gripper", "torque_limit_percent", "protection_current_ma", "overload_torque_percent", "overload_time_s", "position_p", "position_i", "position_d", "acceleration", "grip_load_percent", "grip_torque_percent", "grip_squeeze_rad")
    MOTOR_ID_FIELD_NUMBER: _ClassVar[int]
    GRIPPER_FIELD_NUMBER: _ClassVar[int]
    TORQUE_LIMIT_PERCENT_FIELD_NUMBER: _ClassVar[int]
    PROTECTION_CURRENT_MA_FIELD_NUMBER: _ClassVar[int]
    OVERLOAD_TORQUE_PERCENT_FIELD_NUMBER: _ClassVar[int]
    OVERLOAD_TIME_S_FIELD_NUMBER: _ClassVar[int]
    POSITION_P_FIELD_NUMBER: _ClassVar[int]
    POSITION_I_FIELD_NUMBER: _ClassVar[int]
    POSITION_D_FIELD_NUMBER: _ClassVar[int]
    ACCELERATION_FIELD_NUMBER: _ClassVar[int]
    GRIP_LOAD_PERCENT_FIELD_NUMBER: _ClassVar[int]
    GRIP_TORQUE_PERCENT_FIELD_NUMBER: _ClassVar[int]
    GRIP_SQUEEZE_RAD_FIELD_NUMBER: _ClassVar[int]
    motor_id: int
    gripper: bool
    torque_limit_percent: float
    protection_current_ma: float
    overload_torque_percent: float
    overload_time_s: float
    position_p: int
    position_i: int
    position_d: int
    acceleration: int
    grip_load_percent: float
    grip_torque_percent: float
    grip_squeeze_rad: float
    def __init__(self, motor_id: _Optional[int] = ..., gripper: _Optional[bool] = ..., torque_limit_percent: _Optional[float] = ..., protection_current_ma: _Optional[float] = ..., overload_torque_percent: _Optional[float] = ..., overload_time_s: _Optional[float] = ..., position_p: _Optional[int] = ..., position_i: _Optional[int] = ..., position_d: _Optional[int] = ..., acceleration: _Optional[int] = ..., grip_load_percent: _Optional[float] = ..., grip_torque_percent: _Optional[float] = ..., grip_squeeze_rad: _Optional[float] = ...) -> None: ...

class DynamixelConfig(_message.Message):
    __slots__ = ("comm", "motor_ids", "models", "position_min", "position_max", "velocity", "acceleration", "joint")
    COMM_FIELD_NUMBER: _ClassVar[int]
    MOTOR_IDS_FIELD_NUMBER: _ClassVar[int]
    MODELS_FIELD_NUMBER: _ClassVar[int]
    POSITION_MIN_FIELD_NUMBER: _ClassVar[int]
    POSITION_MAX_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_FIELD_NUMBER: _ClassVar[int]
    ACCELERATION_FIELD_NUMBER: _ClassVar[int]
    JOINT_FIELD_NUMBER: _ClassVar[int]
    comm: _comm_pb2.Comm
    motor_ids: _containers.RepeatedScalarFieldContainer[int]
    models: _containers.RepeatedScalarFieldContainer[str]
    position_min: int
    position_max: int
    velocity: int
    acceleration: int
    joint: _containers.RepeatedCompositeFieldContainer[DynamixelJoint]
    def __init__(self, comm: _Optional[_Union[_comm_pb2.Comm, _Mapping]] = ..., motor_ids: _Optional[_Iterable[int]] = ..., models: _Optional[_Iterable[str]] = ..., position_min: _Optional[int] = ..., position_max: _Optional[int] = ..., velocity: _Optional[int] = ..., acceleration: _Optional[int] = ..., joint: _Optional[_Iterable[_Union[DynamixelJoint, _Mapping]]] = ...) -> None: ...

class DynamixelJoint(_message.Message):
    __slots__ = ("motor_id", "gripper", "torque_limit_percent", "current_limit_ma", "position_p", "position_i", "position_d", "acceleration", "grip_load_percent", "grip_torque_percent", "grip_squeeze_rad")
    MOTOR_ID_FIELD_NUMBER: _ClassVar[int]
    GRIPPER_FIELD_NUMBER: _ClassVar[int]
    TORQUE_LIMIT_PERCENT_FIELD_NUMBER: _ClassVar[int]
    CURRENT_LIMIT_MA_FIELD_NUMBER: _ClassVar[int]
    POSITION_P_FIELD_NUMBER: _ClassVar[int]
    POSITION_I_FIELD_NUMBER: _ClassVar[int]
    POSITION_D_FIELD_NUMBER: _ClassVar[int]
    ACCELERATION_FIELD_NUMBER: _ClassVar[int]
    GRIP_LOAD_PERCENT_FIELD_NUMBER: _ClassVar[int]
    GRIP_TORQUE_PERCENT_FIELD_NUMBER: _ClassVar[int]
    GRIP_SQUEEZE_RAD_FIELD_NUMBER: _ClassVar[int]
    motor_id: int
    gripper: bool
    torque_limit_percent: float
    current_limit_ma: float
    position_p: int
    position_i: int
    position_d: int
    acceleration: int
    grip_load_percent: float
    grip_torque_percent: float
    grip_squeeze_rad: float
    def __init__(self, motor_id: _Optional[int] = ..., gripper: _Optional[bool] = ..., torque_limit_percent: _Optional[float] = ..., current_limit_ma: _Optional[float] = ..., position_p: _Optional[int] = ..., position_i: _Optional[int] = ..., position_d: _Optional[int] = ..., acceleration: _Optional[int] = ..., grip_load_percent: _Optional[float] = ..., grip_torque_percent: _Optional[float] = ..., grip_squeeze_rad: _Optional[float] = ...) -> None: ...

class MockMotorConfig(_message.Message):
    __slots__ = ("num_motors", "position_min", "position_max", "motion", "motion_amplitude_rad", "motion_frequency_hz", "motion_file", "time_constant_s")
    NUM_MOTORS_FIELD_NUMBER: _ClassVar[int]
    POSITION_MIN_FIELD_NUMBER: _ClassVar[int]
    POSITION_MAX_FIELD_NUMBER: _ClassVar[int]
    MOTION_FIELD_NUMBER: _ClassVar[int]
    MOTION_AMPLITUDE_RAD_FIELD_NUMBER: _ClassVar[int]
    MOTION_FREQUENCY_HZ_FIELD_NUMBER: _ClassVar[int]
    MOTION_FILE_FIELD_NUMBER: _ClassVar[int]
    TIME_CONSTANT_S_FIELD_NUMBER: _ClassVar[int]
    num_motors: int
    position_min: int
    position_max: int
    motion: MockMotion
    motion_amplitude_rad: float
    motion_frequency_hz: float
    motion_file: str
    time_constant_s: float
    def __init__(self, num_motors: _Optional[int] = ..., position_min: _Optional[int] = ..., position_max: _Optional[int] = ..., motion: _Optional[_Union[MockMotion, str]] = ..., motion_amplitude_rad: _Optional[float] = ..., motion_frequency_hz: _Optional[float] = ..., motion_file: _Optional[str] = ..., time_constant_s: _Optional[float] = ...) -> None: ...

class SimActuatorConfig(_message.Message):
    __slots__ = ("actuators", "motion", "motion_amplitude_rad", "motion_frequency_hz", "motion_file", "demonstrate", "noise_rad", "recoveries", "drives")
    ACTUATORS_FIELD_NUMBER: _ClassVar[int]
    MOTION_FIELD_NUMBER: _ClassVar[int]
    MOTION_AMPLITUDE_RAD_FIELD_NUMBER: _ClassVar[int]
    MOTION_FREQUENCY_HZ_FIELD_NUMBER: _ClassVar[int]
    MOTION_FILE_FIELD_NUMBER: _ClassVar[int]
    DEMONSTRATE_FIELD_NUMBER: _ClassVar[int]
    NOISE_RAD_FIELD_NUMBER: _ClassVar[int]
    RECOVERIES_FIELD_NUMBER: _ClassVar[int]
    DRIVES_FIELD_NUMBER: _ClassVar[int]
    actuators: _containers.RepeatedScalarFieldContainer[str]
    motion: MockMotion
    motion_amplitude_rad: float
    motion_frequency_hz: float
    motion_file: str
    demonstrate: str
    noise_rad: float
    recoveries: float
    drives: _containers.RepeatedCompositeFieldContainer[SimJointDrive]
    def __init__(self, actuators: _Optional[_Iterable[str]] = ..., motion: _Optional[_Union[MockMotion, str]] = ..., motion_amplitude_rad: _Optional[float] = ..., motion_frequency_hz: _Optional[float] = ..., motion_file: _Optional[str] = ..., demonstrate: _Optional[str] = ..., noise_rad: _Optional[float] = ..., recoveries: _Optional[float] = ..., drives: _Optional[_Iterable[_Union[SimJointDrive, _Mapping]]] = ...) -> None: ...

class SimJointDrive(_message.Message):
    __slots__ = ("joint", "position_gain", "velocity_gain")
    JOINT_FIELD_NUMBER: _ClassVar[int]
    POSITION_GAIN_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_GAIN_FIELD_NUMBER: _ClassVar[int]
    joint: str
    position_gain: float
    velocity_gain: float
    def __init__(self, joint: _Optional[str] = ..., position_gain: _Optional[float] = ..., velocity_gain: _Optional[float] = ...) -> None: ...

class SpikeMotorConfig(_message.Message):
    __slots__ = ("comm", "port_names")
    COMM_FIELD_NUMBER: _ClassVar[int]
    PORT_NAMES_FIELD_NUMBER: _ClassVar[int]
    comm: _comm_pb2.Comm
    port_names: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, comm: _Optional[_Union[_comm_pb2.Comm, _Mapping]] = ..., port_names: _Optional[_Iterable[str]] = ...) -> None: ...

class SinglePerception(_message.Message):
    __slots__ = ("node", "perception_type", "camera_config", "encoder_config", "lidar_config", "plugin_config", "mock_camera_config", "mock_encoder_config", "mock_lidar_config", "gamepad_config", "keyboard_config", "sim_camera_config")
    NODE_FIELD_NUMBER: _ClassVar[int]
    PERCEPTION_TYPE_FIELD_NUMBER: _ClassVar[int]
    CAMERA_CONFIG_FIELD_NUMBER: _ClassVar[int]
    ENCODER_CONFIG_FIELD_NUMBER: _ClassVar[int]
    LIDAR_CONFIG_FIELD_NUMBER: _ClassVar[int]
    PLUGIN_CONFIG_FIELD_NUMBER: _ClassVar[int]
    MOCK_CAMERA_CONFIG_FIELD_NUMBER: _ClassVar[int]
    MOCK_ENCODER_CONFIG_FIELD_NUMBER: _ClassVar[int]
    MOCK_LIDAR_CONFIG_FIELD_NUMBER: _ClassVar[int]
    GAMEPAD_CONFIG_FIELD_NUMBER: _ClassVar[int]
    KEYBOARD_CONFIG_FIELD_NUMBER: _ClassVar[int]
    SIM_CAMERA_CONFIG_FIELD_NUMBER: _ClassVar[int]
    node: Node
    perception_type: PerceptionType
    camera_config: CameraConfig
    encoder_config: EncoderConfig
    lidar_config: LidarConfig
    plugin_config: _any_pb2.Any
    mock_camera_config: MockCameraConfig
    mock_encoder_config: MockEncoderConfig
    mock_lidar_config: MockLidarConfig
    gamepad_config: GamepadConfig
    keyboard_config: KeyboardConfig
    sim_camera_config: SimCameraConfig
    def __init__(self, node: _Optional[_Union[Node, _Mapping]] = ..., perception_type: _Optional[_Union[PerceptionType, str]] = ..., camera_config: _Optional[_Union[CameraConfig, _Mapping]] = ..., encoder_config: _Optional[_Union[EncoderConfig, _Mapping]] = ..., lidar_config: _Optional[_Union[LidarConfig, _Mapping]] = ..., plugin_config: _Optional[_Union[_any_pb2.Any, _Mapping]] = ..., mock_camera_config: _Optional[_Union[MockCameraConfig, _Mapping]] = ..., mock_encoder_config: _Optional[_Union[MockEncoderConfig, _Mapping]] = ..., mock_lidar_config: _Optional[_Union[MockLidarConfig, _Mapping]] = ..., gamepad_config: _Optional[_Union[GamepadConfig, _Mapping]] = ..., keyboard_config: _Optional[_Union[KeyboardConfig, _Mapping]] = ..., sim_camera_config: _Optional[_Union[SimCameraConfig, _Mapping]] = ...) -> None: ...

class CameraConfig(_message.Message):
    __slots__ = ("device_id", "width", "height", "fps", "pixel_format", "brightness", "contrast", "saturation", "exposure", "display", "source", "intrinsics_file")
    DEVICE_ID_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    FPS_FIELD_NUMBER: _ClassVar[int]
    PIXEL_FORMAT_FIELD_NUMBER: _ClassVar[int]
    BRIGHTNESS_FIELD_NUMBER: _ClassVar[int]
    CONTRAST_FIELD_NUMBER: _ClassVar[int]
    SATURATION_FIELD_NUMBER: _ClassVar[int]
    EXPOSURE_FIELD_NUMBER: _ClassVar[int]
    DISPLAY_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    INTRINSICS_FILE_FIELD_NUMBER: _ClassVar[int]
    device_id: int
    width: int
    height: int
    fps: int
    pixel_format: str
    brightness: int
    contrast: int
    saturation: int
    exposure: int
    display: bool
    source: str
    intrinsics_file: str
    def __init__(self, device_id: _Optional[int] = ..., width: _Optional[int] = ..., height: _Optional[int] = ..., fps: _Optional[int] = ..., pixel_format: _Optional[str] = ..., brightness: _Optional[int] = ..., contrast: _Optional[int] = ..., saturation: _Optional[int] = ..., exposure: _Optional[int] = ..., display: _Optional[bool] = ..., source: _Optional[str] = ..., intrinsics_file: _Optional[str] = ...) -> None: ...

class SimCameraConfig(_message.Message):
    __slots__ = ("camera", "width", "height", "fps")
    CAMERA_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    FPS_FIELD_NUMBER: _ClassVar[int]
    camera: str
    width: int
    height: int
    fps: int
    def __init__(self, camera: _Optional[str] = ..., width: _Optional[int] = ..., height: _Optional[int] = ..., fps: _Optional[int] = ...) -> None: ...

class MockCameraConfig(_message.Message):
    __slots__ = ("width", "height", "fps")
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    FPS_FIELD_NUMBER: _ClassVar[int]
    width: int
    height: int
    fps: int
    def __init__(self, width: _Optional[int] = ..., height: _Optional[int] = ..., fps: _Optional[int] = ...) -> None: ...

class EncoderConfig(_message.Message):
    __slots__ = ("comm", "resolution", "inverted", "protocol", "joint_name", "address", "counter_range")
    COMM_FIELD_NUMBER: _ClassVar[int]
    RESOLUTION_FIELD_NUMBER: _ClassVar[int]
    INVERTED_FIELD_NUMBER: _ClassVar[int]
    PROTOCOL_FIELD_NUMBER: _ClassVar[int]
    JOINT_NAME_FIELD_NUMBER: _ClassVar[int]
    ADDRESS_FIELD_NUMBER: _ClassVar[int]
    COUNTER_RANGE_FIELD_NUMBER: _ClassVar[int]
    comm: _comm_pb2.Comm
    resolution: int
    inverted: bool
    protocol: str
    joint_name: _containers.RepeatedScalarFieldContainer[str]
    address: _containers.RepeatedScalarFieldContainer[int]
    counter_range: int
    def __init__(self, comm: _Optional[_Union[_comm_pb2.Comm, _Mapping]] = ..., resolution: _Optional[int] = ..., inverted: _Optional[bool] = ..., protocol: _Optional[str] = ..., joint_name: _Optional[_Iterable[str]] = ..., address: _Optional[_Iterable[int]] = ..., counter_range: _Optional[int] = ...) -> None: ...

class MockEncoderConfig(_message.Message):
    __slots__ = ("resolution", "speed_rad_s", "inverted")
    RESOLUTION_FIELD_NUMBER: _ClassVar[int]
    SPEED_RAD_S_FIELD_NUMBER: _ClassVar[int]
    INVERTED_FIELD_NUMBER: _ClassVar[int]
    resolution: int
    speed_rad_s: float
    inverted: bool
    def __init__(self, resolution: _Optional[int] = ..., speed_rad_s: _Optional[float] = ..., inverted: _Optional[bool] = ...) -> None: ...

class LidarConfig(_message.Message):
    __slots__ = ("comm", "angle_min", "angle_max", "range_min", "range_max", "display", "model", "scan_mode")
    COMM_FIELD_NUMBER: _ClassVar[int]
    ANGLE_MIN_FIELD_NUMBER: _ClassVar[int]
    ANGLE_MAX_FIELD_NUMBER: _ClassVar[int]
    RANGE_MIN_FIELD_NUMBER: _ClassVar[int]
    RANGE_MAX_FIELD_NUMBER: _ClassVar[int]
    DISPLAY_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    SCAN_MODE_FIELD_NUMBER: _ClassVar[int]
    comm: _comm_pb2.Comm
    angle_min: float
    angle_max: float
    range_min: float
    range_max: float
    display: bool
    model: str
    scan_mode: str
    def __init__(self, comm: _Optional[_Union[_comm_pb2.Comm, _Mapping]] = ..., angle_min: _Optional[float] = ..., angle_max: _Optional[float] = ..., range_min: _Optional[float] = ..., range_max: _Optional[float] = ..., display: _Optional[bool] = ..., model: _Optional[str] = ..., scan_mode: _Optional[str] = ...) -> None: ...

class MockLidarConfig(_message.Message):
    __slots__ = ("angle_min", "angle_max", "range_min", "range_max", "num_beams", "room_length_m", "room_width_m")
    ANGLE_MIN_FIELD_NUMBER: _ClassVar[int]
    ANGLE_MAX_FIELD_NUMBER: _ClassVar[int]
    RANGE_MIN_FIELD_NUMBER: _ClassVar[int]
    RANGE_MAX_FIELD_NUMBER: _ClassVar[int]
    NUM_BEAMS_FIELD_NUMBER: _ClassVar[int]
    ROOM_LENGTH_M_FIELD_NUMBER: _ClassVar[int]
    ROOM_WIDTH_M_FIELD_NUMBER: _ClassVar[int]
    angle_min: float
    angle_max: float
    range_min: float
    range_max: float
    num_beams: int
    room_length_m: float
    room_width_m: float
    def __init__(self, angle_min: _Optional[float] = ..., angle_max: _Optional[float] = ..., range_min: _Optional[float] = ..., range_max: _Optional[float] = ..., num_beams: _Optional[int] = ..., room_length_m: _Optional[float] = ..., room_width_m: _Optional[float] = ...) -> None: ...

class JointControl(_message.Message):
    __slots__ = ("positive", "negative", "joint", "speed_rad_s")
    POSITIVE_FIELD_NUMBER: _ClassVar[int]
    NEGATIVE_FIELD_NUMBER: _ClassVar[int]
    JOINT_FIELD_NUMBER: _ClassVar[int]
    SPEED_RAD_S_FIELD_NUMBER: _ClassVar[int]
    positive: str
    negative: str
    joint: str
    speed_rad_s: float
    def __init__(self, positive: _Optional[str] = ..., negative: _Optional[str] = ..., joint: _Optional[str] = ..., speed_rad_s: _Optional[float] = ...) -> None: ...

class GamepadConfig(_message.Message):
    __slots__ = ("device", "dead_zone", "dead_man_button", "controls", "expo", "enable_button", "release_button", "mapping")
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    DEAD_ZONE_FIELD_NUMBER: _ClassVar[int]
    DEAD_MAN_BUTTON_FIELD_NUMBER: _ClassVar[int]
    CONTROLS_FIELD_NUMBER: _ClassVar[int]
    EXPO_FIELD_NUMBER: _ClassVar[int]
    ENABLE_BUTTON_FIELD_NUMBER: _ClassVar[int]
    RELEASE_BUTTON_FIELD_NUMBER: _ClassVar[int]
    MAPPING_FIELD_NUMBER: _ClassVar[int]
    device: str
    dead_zone: float
    dead_man_button: str
    controls: _containers.RepeatedCompositeFieldContainer[JointControl]
    expo: float
    enable_button: str
    release_button: str
    mapping: _containers.RepeatedCompositeFieldContainer[GamepadMapping]
    def __init__(self, device: _Optional[str] = ..., dead_zone: _Optional[float] = ..., dead_man_button: _Optional[str] = ..., controls: _Optional[_Iterable[_Union[JointControl, _Mapping]]] = ..., expo: _Optional[float] = ..., enable_button: _Optional[str] = ..., release_button: _Optional[str] = ..., mapping: _Optional[_Iterable[_Union[GamepadMapping, _Mapping]]] = ...) -> None: ...

class GamepadMapping(_message.Message):
    __slots__ = ("name", "source", "inverted")
    NAME_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    INVERTED_FIELD_NUMBER: _ClassVar[int]
    name: str
    source: str
    inverted: bool
    def __init__(self, name: _Optional[str] = ..., source: _Optional[str] = ..., inverted: _Optional[bool] = ...) -> None: ...

class KeyboardConfig(_message.Message):
    __slots__ = ("key_hold_s", "controls", "enable_key", "release_key")
    KEY_HOLD_S_FIELD_NUMBER: _ClassVar[int]
    CONTROLS_FIELD_NUMBER: _ClassVar[int]
    ENABLE_KEY_FIELD_NUMBER: _ClassVar[int]
    RELEASE_KEY_FIELD_NUMBER: _ClassVar[int]
    key_hold_s: float
    controls: _containers.RepeatedCompositeFieldContainer[JointControl]
    enable_key: str
    release_key: str
    def __init__(self, key_hold_s: _Optional[float] = ..., controls: _Optional[_Iterable[_Union[JointControl, _Mapping]]] = ..., enable_key: _Optional[str] = ..., release_key: _Optional[str] = ...) -> None: ...

class Ai(_message.Message):
    __slots__ = ("models", "data_store", "training")
    MODELS_FIELD_NUMBER: _ClassVar[int]
    DATA_STORE_FIELD_NUMBER: _ClassVar[int]
    TRAINING_FIELD_NUMBER: _ClassVar[int]
    models: _containers.RepeatedCompositeFieldContainer[SingleModel]
    data_store: DataStore
    training: Training
    def __init__(self, models: _Optional[_Iterable[_Union[SingleModel, _Mapping]]] = ..., data_store: _Optional[_Union[DataStore, _Mapping]] = ..., training: _Optional[_Union[Training, _Mapping]] = ...) -> None: ...

class SingleModel(_message.Message):
    __slots__ = ("model_type", "pretrained_model_name_or_path", "node", "plugin_config", "random_noise_config", "smolvla_config", "execution", "compute", "rename", "task")
    MODEL_TYPE_FIELD_NUMBER: _ClassVar[int]
    PRETRAINED_MODEL_NAME_OR_PATH_FIELD_NUMBER: _ClassVar[int]
    NODE_FIELD_NUMBER: _ClassVar[int]
    PLUGIN_CONFIG_FIELD_NUMBER: _ClassVar[int]
    RANDOM_NOISE_CONFIG_FIELD_NUMBER: _ClassVar[int]
    SMOLVLA_CONFIG_FIELD_NUMBER: _ClassVar[int]
    EXECUTION_FIELD_NUMBER: _ClassVar[int]
    COMPUTE_FIELD_NUMBER: _ClassVar[int]
    RENAME_FIELD_NUMBER: _ClassVar[int]
    TASK_FIELD_NUMBER: _ClassVar[int]
    model_type: ModelType
    pretrained_model_name_or_path: str
    node: Node
    plugin_config: _any_pb2.Any
    random_noise_config: RandomNoiseConfig
    smolvla_config: SmolVlaConfig
    execution: ModelExecution
    compute: ModelCompute
    rename: _containers.RepeatedCompositeFieldContainer[FeatureName]
    task: str
    def __init__(self, model_type: _Optional[_Union[ModelType, str]] = ..., pretrained_model_name_or_path: _Optional[str] = ..., node: _Optional[_Union[Node, _Mapping]] = ..., plugin_config: _Optional[_Union[_any_pb2.Any, _Mapping]] = ..., random_noise_config: _Optional[_Union[RandomNoiseConfig, _Mapping]] = ..., smolvla_config: _Optional[_Union[SmolVlaConfig, _Mapping]] = ..., execution: _Optional[_Union[ModelExecution, _Mapping]] = ..., compute: _Optional[_Union[ModelCompute, _Mapping]] = ..., rename: _Optional[_Iterable[_Union[FeatureName, _Mapping]]] = ..., task: _Optional[str] = ...) -> None: ...

class FeatureName(_message.Message):
    __slots__ = ("robot", "model")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    robot: str
    model: str
    def __init__(self, robot: _Optional[str] = ..., model: _Optional[str] = ...) -> None: ...

class ModelExecution(_message.Message):
    __slots__ = ("strategy", "steps_per_chunk", "observation_max_age_s", "ramp_s", "max_velocity_rad_s", "chunk_timeout_s", "ensemble_coefficient", "execution_horizon", "inference_delay", "delay_margin", "max_guidance_weight", "guidance_schedule")
    STRATEGY_FIELD_NUMBER: _ClassVar[int]
    STEPS_PER_CHUNK_FIELD_NUMBER: _ClassVar[int]
    OBSERVATION_MAX_AGE_S_FIELD_NUMBER: _ClassVar[int]
    RAMP_S_FIELD_NUMBER: _ClassVar[int]
    MAX_VELOCITY_RAD_S_FIELD_NUMBER: _ClassVar[int]
    CHUNK_TIMEOUT_S_FIELD_NUMBER: _ClassVar[int]
    ENSEMBLE_COEFFICIENT_FIELD_NUMBER: _ClassVar[int]
    EXECUTION_HORIZON_FIELD_NUMBER: _ClassVar[int]
    INFERENCE_DELAY_FIELD_NUMBER: _ClassVar[int]
    DELAY_MARGIN_FIELD_NUMBER: _ClassVar[int]
    MAX_GUIDANCE_WEIGHT_FIELD_NUMBER: _ClassVar[int]
    GUIDANCE_SCHEDULE_FIELD_NUMBER: _ClassVar[int]
    strategy: ExecutionStrategy
    steps_per_chunk: int
    observation_max_age_s: float
    ramp_s: float
    max_velocity_rad_s: float
    chunk_timeout_s: float
    ensemble_coefficient: float
    execution_horizon: int
    inference_delay: int
    delay_margin: int
    max_guidance_weight: float
    guidance_schedule: GuidanceSchedule
    def __init__(self, strategy: _Optional[_Union[ExecutionStrategy, str]] = ..., steps_per_chunk: _Optional[int] = ..., observation_max_age_s: _Optional[float] = ..., ramp_s: _Optional[float] = ..., max_velocity_rad_s: _Optional[float] = ..., chunk_timeout_s: _Optional[float] = ..., ensemble_coefficient: _Optional[float] = ..., execution_horizon: _Optional[int] = ..., inference_delay: _Optional[int] = ..., delay_margin: _Optional[int] = ..., max_guidance_weight: _Optional[float] = ..., guidance_schedule: _Optional[_Union[GuidanceSchedule, str]] = ...) -> None: ...

class ModelCompute(_message.Message):
    __slots__ = ("device", "precision", "warm_up", "seed", "threads")
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    PRECISION_FIELD_NUMBER: _ClassVar[int]
    WARM_UP_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    THREADS_FIELD_NUMBER: _ClassVar[int]
    device: str
    precision: str
    warm_up: int
    seed: int
    threads: int
    def __init__(self, device: _Optional[str] = ..., precision: _Optional[str] = ..., warm_up: _Optional[int] = ..., seed: _Optional[int] = ..., threads: _Optional[int] = ...) -> None: ...

class RandomNoiseConfig(_message.Message):
    __slots__ = ("seed", "amplitude_rad")
    SEED_FIELD_NUMBER: _ClassVar[int]
    AMPLITUDE_RAD_FIELD_NUMBER: _ClassVar[int]
    seed: int
    amplitude_rad: float
    def __init__(self, seed: _Optional[int] = ..., amplitude_rad: _Optional[float] = ...) -> None: ...

class SmolVlaConfig(_message.Message):
    __slots__ = ("revision", "units", "absent_cameras", "denoising_steps", "picture_size", "compile", "allow_unnormalized")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    UNITS_FIELD_NUMBER: _ClassVar[int]
    ABSENT_CAMERAS_FIELD_NUMBER: _ClassVar[int]
    DENOISING_STEPS_FIELD_NUMBER: _ClassVar[int]
    PICTURE_SIZE_FIELD_NUMBER: _ClassVar[int]
    COMPILE_FIELD_NUMBER: _ClassVar[int]
    ALLOW_UNNORMALIZED_FIELD_NUMBER: _ClassVar[int]
    revision: str
    units: JointPositionUnit
    absent_cameras: _containers.RepeatedScalarFieldContainer[str]
    denoising_steps: int
    picture_size: int
    compile: bool
    allow_unnormalized: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, revision: _Optional[str] = ..., units: _Optional[_Union[JointPositionUnit, str]] = ..., absent_cameras: _Optional[_Iterable[str]] = ..., denoising_steps: _Optional[int] = ..., picture_size: _Optional[int] = ..., compile: _Optional[bool] = ..., allow_unnormalized: _Optional[_Iterable[str]] = ...) -> None: ...

class DataStore(_message.Message):
    __slots__ = ("format", "storage", "dataset_name", "local_path", "remote_url", "plugin_config", "operation", "task", "episodes", "fps", "tolerance_s", "missing", "video_codec", "units", "pictures", "resume", "episode_duration_s", "reset_duration_s", "warmup_s", "num_episodes", "more_tasks", "auto_start", "speed", "record_button", "keep_button", "discard_button", "spoken_cues", "upload")
    FORMAT_FIELD_NUMBER: _ClassVar[int]
    STORAGE_FIELD_NUMBER: _ClassVar[int]
    DATASET_NAME_FIELD_NUMBER: _ClassVar[int]
    LOCAL_PATH_FIELD_NUMBER: _ClassVar[int]
    REMOTE_URL_FIELD_NUMBER: _ClassVar[int]
    PLUGIN_CONFIG_FIELD_NUMBER: _ClassVar[int]
    OPERATION_FIELD_NUMBER: _ClassVar[int]
    TASK_FIELD_NUMBER: _ClassVar[int]
    EPISODES_FIELD_NUMBER: _ClassVar[int]
    FPS_FIELD_NUMBER: _ClassVar[int]
    TOLERANCE_S_FIELD_NUMBER: _ClassVar[int]
    MISSING_FIELD_NUMBER: _ClassVar[int]
    VIDEO_CODEC_FIELD_NUMBER: _ClassVar[int]
    UNITS_FIELD_NUMBER: _ClassVar[int]
    PICTURES_FIELD_NUMBER: _ClassVar[int]
    RESUME_FIELD_NUMBER: _ClassVar[int]
    EPISODE_DURATION_S_FIELD_NUMBER: _ClassVar[int]
    RESET_DURATION_S_FIELD_NUMBER: _ClassVar[int]
    WARMUP_S_FIELD_NUMBER: _ClassVar[int]
    NUM_EPISODES_FIELD_NUMBER: _ClassVar[int]
    MORE_TASKS_FIELD_NUMBER: _ClassVar[int]
    AUTO_START_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    RECORD_BUTTON_FIELD_NUMBER: _ClassVar[int]
    KEEP_BUTTON_FIELD_NUMBER: _ClassVar[int]
    DISCARD_BUTTON_FIELD_NUMBER: _ClassVar[int]
    SPOKEN_CUES_FIELD_NUMBER: _ClassVar[int]
    UPLOAD_FIELD_NUMBER: _ClassVar[int]
    format: DataFormat
    storage: StorageBackend
    dataset_name: str
    local_path: str
    remote_url: str
    plugin_config: _any_pb2.Any
    operation: DataStoreOperation
    task: str
    episodes: _containers.RepeatedScalarFieldContainer[int]
    fps: int
    tolerance_s: float
    missing: MissingPolicy
    video_codec: VideoCodec
    units: JointPositionUnit
    pictures: PictureStorage
    resume: bool
    episode_duration_s: float
    reset_duration_s: float
    warmup_s: float
    num_episodes: int
    more_tasks: _containers.RepeatedScalarFieldContainer[str]
    auto_start: bool
    speed: float
    record_button: str
    keep_button: str
    discard_button: str
    spoken_cues: bool
    upload: UploadTime
    def __init__(self, format: _Optional[_Union[DataFormat, str]] = ..., storage: _Optional[_Union[StorageBackend, str]] = ..., dataset_name: _Optional[str] = ..., local_path: _Optional[str] = ..., remote_url: _Optional[str] = ..., plugin_config: _Optional[_Union[_any_pb2.Any, _Mapping]] = ..., operation: _Optional[_Union[DataStoreOperation, str]] = ..., task: _Optional[str] = ..., episodes: _Optional[_Iterable[int]] = ..., fps: _Optional[int] = ..., tolerance_s: _Optional[float] = ..., missing: _Optional[_Union[MissingPolicy, str]] = ..., video_codec: _Optional[_Union[VideoCodec, str]] = ..., units: _Optional[_Union[JointPositionUnit, str]] = ..., pictures: _Optional[_Union[PictureStorage, str]] = ..., resume: _Optional[bool] = ..., episode_duration_s: _Optional[float] = ..., reset_duration_s: _Optional[float] = ..., warmup_s: _Optional[float] = ..., num_episodes: _Optional[int] = ..., more_tasks: _Optional[_Iterable[str]] = ..., auto_start: _Optional[bool] = ..., speed: _Optional[float] = ..., record_button: _Optional[str] = ..., keep_button: _Optional[str] = ..., discard_button: _Optional[str] = ..., spoken_cues: _Optional[bool] = ..., upload: _Optional[_Union[UploadTime, str]] = ...) -> None: ...

class Training(_message.Message):
    __slots__ = ("environment", "method", "simulator_backend", "rl_config", "imitation_config", "eval_config", "plugin_config", "environment_id", "wandb", "mlflow", "cluster")
    ENVIRONMENT_FIELD_NUMBER: _ClassVar[int]
    METHOD_FIELD_NUMBER: _ClassVar[int]
    SIMULATOR_BACKEND_FIELD_NUMBER: _ClassVar[int]
    RL_CONFIG_FIELD_NUMBER: _ClassVar[int]
    IMITATION_CONFIG_FIELD_NUMBER: _ClassVar[int]
    EVAL_CONFIG_FIELD_NUMBER: _ClassVar[int]
    PLUGIN_CONFIG_FIELD_NUMBER: _ClassVar[int]
    ENVIRONMENT_ID_FIELD_NUMBER: _ClassVar[int]
    WANDB_FIELD_NUMBER: _ClassVar[int]
    MLFLOW_FIELD_NUMBER: _ClassVar[int]
    CLUSTER_FIELD_NUMBER: _ClassVar[int]
    environment: TrainingEnvironment
    method: TrainingMethod
    simulator_backend: SimulatorBackend
    rl_config: RLConfig
    imitation_config: ImitationConfig
    eval_config: EvalConfig
    plugin_config: _any_pb2.Any
    environment_id: str
    wandb: WandbTracking
    mlflow: MlflowTracking
    cluster: ClusterConfig
    def __init__(self, environment: _Optional[_Union[TrainingEnvironment, str]] = ..., method: _Optional[_Union[TrainingMethod, str]] = ..., simulator_backend: _Optional[_Union[SimulatorBackend, str]] = ..., rl_config: _Optional[_Union[RLConfig, _Mapping]] = ..., imitation_config: _Optional[_Union[ImitationConfig, _Mapping]] = ..., eval_config: _Optional[_Union[EvalConfig, _Mapping]] = ..., plugin_config: _Optional[_Union[_any_pb2.Any, _Mapping]] = ..., environment_id: _Optional[str] = ..., wandb: _Optional[_Union[WandbTracking, _Mapping]] = ..., mlflow: _Optional[_Union[MlflowTracking, _Mapping]] = ..., cluster: _Optional[_Union[ClusterConfig, _Mapping]] = ...) -> None: ...

class ClusterConfig(_message.Message):
    __slots__ = ("address", "workers")
    ADDRESS_FIELD_NUMBER: _ClassVar[int]
    WORKERS_FIELD_NUMBER: _ClassVar[int]
    address: str
    workers: int
    def __init__(self, address: _Optional[str] = ..., workers: _Optional[int] = ...) -> None: ...

class WandbTracking(_message.Message):
    __slots__ = ("project", "entity", "server", "offline")
    PROJECT_FIELD_NUMBER: _ClassVar[int]
    ENTITY_FIELD_NUMBER: _ClassVar[int]
    SERVER_FIELD_NUMBER: _ClassVar[int]
    OFFLINE_FIELD_NUMBER: _ClassVar[int]
    project: str
    entity: str
    server: str
    offline: bool
    def __init__(self, project: _Optional[str] = ..., entity: _Optional[str] = ..., server: _Optional[str] = ..., offline: _Optional[bool] = ...) -> None: ...

class MlflowTracking(_message.Message):
    __slots__ = ("experiment", "server")
    EXPERIMENT_FIELD_NUMBER: _ClassVar[int]
    SERVER_FIELD_NUMBER: _ClassVar[int]
    experiment: str
    server: str
    def __init__(self, experiment: _Optional[str] = ..., server: _Optional[str] = ...) -> None: ...

class RLConfig(_message.Message):
    __slots__ = ("algorithm", "num_envs", "total_timesteps", "learning_rate", "gamma", "clip_range", "batch_size", "reward_function", "n_steps", "n_epochs", "gae_lambda", "entropy_weight", "value_weight", "max_grad_norm", "target_kl", "hidden_sizes", "activation", "initial_log_std", "normalize_observations", "normalize_rewards", "randomise", "output_folder", "checkpoint_steps", "resume_run", "physics_threads", "buffer_size", "learning_starts", "tau", "updates_per_step")
    ALGORITHM_FIELD_NUMBER: _ClassVar[int]
    NUM_ENVS_FIELD_NUMBER: _ClassVar[int]
    TOTAL_TIMESTEPS_FIELD_NUMBER: _ClassVar[int]
    LEARNING_RATE_FIELD_NUMBER: _ClassVar[int]
    GAMMA_FIELD_NUMBER: _ClassVar[int]
    CLIP_RANGE_FIELD_NUMBER: _ClassVar[int]
    BATCH_SIZE_FIELD_NUMBER: _ClassVar[int]
    REWARD_FUNCTION_FIELD_NUMBER: _ClassVar[int]
    N_STEPS_FIELD_NUMBER: _ClassVar[int]
    N_EPOCHS_FIELD_NUMBER: _ClassVar[int]
    GAE_LAMBDA_FIELD_NUMBER: _ClassVar[int]
    ENTROPY_WEIGHT_FIELD_NUMBER: _ClassVar[int]
    VALUE_WEIGHT_FIELD_NUMBER: _ClassVar[int]
    MAX_GRAD_NORM_FIELD_NUMBER: _ClassVar[int]
    TARGET_KL_FIELD_NUMBER: _ClassVar[int]
    HIDDEN_SIZES_FIELD_NUMBER: _ClassVar[int]
    ACTIVATION_FIELD_NUMBER: _ClassVar[int]
    INITIAL_LOG_STD_FIELD_NUMBER: _ClassVar[int]
    NORMALIZE_OBSERVATIONS_FIELD_NUMBER: _ClassVar[int]
    NORMALIZE_REWARDS_FIELD_NUMBER: _ClassVar[int]
    RANDOMISE_FIELD_NUMBER: _ClassVar[int]
    OUTPUT_FOLDER_FIELD_NUMBER: _ClassVar[int]
    CHECKPOINT_STEPS_FIELD_NUMBER: _ClassVar[int]
    RESUME_RUN_FIELD_NUMBER: _ClassVar[int]
    PHYSICS_THREADS_FIELD_NUMBER: _ClassVar[int]
    BUFFER_SIZE_FIELD_NUMBER: _ClassVar[int]
    LEARNING_STARTS_FIELD_NUMBER: _ClassVar[int]
    TAU_FIELD_NUMBER: _ClassVar[int]
    UPDATES_PER_STEP_FIELD_NUMBER: _ClassVar[int]
    algorithm: str
    num_envs: int
    total_timesteps: int
    learning_rate: float
    gamma: float
    clip_range: float
    batch_size: int
    reward_function: str
    n_steps: int
    n_epochs: int
    gae_lambda: float
    entropy_weight: float
    value_weight: float
    max_grad_norm: float
    target_kl: float
    hidden_sizes: _containers.RepeatedScalarFieldContainer[int]
    activation: str
    initial_log_std: float
    normalize_observations: bool
    normalize_rewards: bool
    randomise: bool
    output_folder: str
    checkpoint_steps: int
    resume_run: str
    physics_threads: int
    buffer_size: int
    learning_starts: int
    tau: float
    updates_per_step: int
    def __init__(self, algorithm: _Optional[str] = ..., num_envs: _Optional[int] = ..., total_timesteps: _Optional[int] = ..., learning_rate: _Optional[float] = ..., gamma: _Optional[float] = ..., clip_range: _Optional[float] = ..., batch_size: _Optional[int] = ..., reward_function: _Optional[str] = ..., n_steps: _Optional[int] = ..., n_epochs: _Optional[int] = ..., gae_lambda: _Optional[float] = ..., entropy_weight: _Optional[float] = ..., value_weight: _Optional[float] = ..., max_grad_norm: _Optional[float] = ..., target_kl: _Optional[float] = ..., hidden_sizes: _Optional[_Iterable[int]] = ..., activation: _Optional[str] = ..., initial_log_std: _Optional[float] = ..., normalize_observations: _Optional[bool] = ..., normalize_rewards: _Optional[bool] = ..., randomise: _Optional[bool] = ..., output_folder: _Optional[str] = ..., checkpoint_steps: _Optional[int] = ..., resume_run: _Optional[str] = ..., physics_threads: _Optional[int] = ..., buffer_size: _Optional[int] = ..., learning_starts: _Optional[int] = ..., tau: _Optional[float] = ..., updates_per_step: _Optional[int] = ...) -> None: ...

class ImitationConfig(_message.Message):
    __slots__ = ("dataset_name", "num_epochs", "learning_rate", "batch_size", "loss_function", "policy_type", "pretrained", "max_steps", "chunk_size", "actions_per_chunk", "cameras", "image_width", "image_height", "validation_share", "validation_steps", "validation_batches", "colour_jitter", "shift_px", "accumulation_steps", "device", "precision", "threads", "workers", "seed", "output_folder", "checkpoint_steps", "resume_run", "report_steps", "picture_cache_mb", "hidden_size", "feedforward_size", "encoder_layers", "pretrained_backbone", "backbone_learning_rate", "weight_decay", "max_grad_norm", "lora_rank", "learning_rate_schedule", "use_vae", "processes", "machines", "machine_rank", "main_address", "state_noise", "robot_evaluation_steps", "robot_episodes", "robot_wait_s")
    DATASET_NAME_FIELD_NUMBER: _ClassVar[int]
    NUM_EPOCHS_FIELD_NUMBER: _ClassVar[int]
    LEARNING_RATE_FIELD_NUMBER: _ClassVar[int]
    BATCH_SIZE_FIELD_NUMBER: _ClassVar[int]
    LOSS_FUNCTION_FIELD_NUMBER: _ClassVar[int]
    POLICY_TYPE_FIELD_NUMBER: _ClassVar[int]
    PRETRAINED_FIELD_NUMBER: _ClassVar[int]
    MAX_STEPS_FIELD_NUMBER: _ClassVar[int]
    CHUNK_SIZE_FIELD_NUMBER: _ClassVar[int]
    ACTIONS_PER_CHUNK_FIELD_NUMBER: _ClassVar[int]
    CAMERAS_FIELD_NUMBER: _ClassVar[int]
    IMAGE_WIDTH_FIELD_NUMBER: _ClassVar[int]
    IMAGE_HEIGHT_FIELD_NUMBER: _ClassVar[int]
    VALIDATION_SHARE_FIELD_NUMBER: _ClassVar[int]
    VALIDATION_STEPS_FIELD_NUMBER: _ClassVar[int]
    VALIDATION_BATCHES_FIELD_NUMBER: _ClassVar[int]
    COLOUR_JITTER_FIELD_NUMBER: _ClassVar[int]
    SHIFT_PX_FIELD_NUMBER: _ClassVar[int]
    ACCUMULATION_STEPS_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    PRECISION_FIELD_NUMBER: _ClassVar[int]
    THREADS_FIELD_NUMBER: _ClassVar[int]
    WORKERS_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    OUTPUT_FOLDER_FIELD_NUMBER: _ClassVar[int]
    CHECKPOINT_STEPS_FIELD_NUMBER: _ClassVar[int]
    RESUME_RUN_FIELD_NUMBER: _ClassVar[int]
    REPORT_STEPS_FIELD_NUMBER: _ClassVar[int]
    PICTURE_CACHE_MB_FIELD_NUMBER: _ClassVar[int]
    HIDDEN_SIZE_FIELD_NUMBER: _ClassVar[int]
    FEEDFORWARD_SIZE_FIELD_NUMBER: _ClassVar[int]
    ENCODER_LAYERS_FIELD_NUMBER: _ClassVar[int]
    PRETRAINED_BACKBONE_FIELD_NUMBER: _ClassVar[int]
    BACKBONE_LEARNING_RATE_FIELD_NUMBER: _ClassVar[int]
    WEIGHT_DECAY_FIELD_NUMBER: _ClassVar[int]
    MAX_GRAD_NORM_FIELD_NUMBER: _ClassVar[int]
    LORA_RANK_FIELD_NUMBER: _ClassVar[int]
    LEARNING_RATE_SCHEDULE_FIELD_NUMBER: _ClassVar[int]
    USE_VAE_FIELD_NUMBER: _ClassVar[int]
    PROCESSES_FIELD_NUMBER: _ClassVar[int]
    MACHINES_FIELD_NUMBER: _ClassVar[int]
    MACHINE_RANK_FIELD_NUMBER: _ClassVar[int]
    MAIN_ADDRESS_FIELD_NUMBER: _ClassVar[int]
    STATE_NOISE_FIELD_NUMBER: _ClassVar[int]
    ROBOT_EVALUATION_STEPS_FIELD_NUMBER: _ClassVar[int]
    ROBOT_EPISODES_FIELD_NUMBER: _ClassVar[int]
    ROBOT_WAIT_S_FIELD_NUMBER: _ClassVar[int]
    dataset_name: str
    num_epochs: int
    learning_rate: float
    batch_size: int
    loss_function: str
    policy_type: str
    pretrained: str
    max_steps: int
    chunk_size: int
    actions_per_chunk: int
    cameras: _containers.RepeatedScalarFieldContainer[str]
    image_width: int
    image_height: int
    validation_share: float
    validation_steps: int
    validation_batches: int
    colour_jitter: float
    shift_px: int
    accumulation_steps: int
    device: str
    precision: str
    threads: int
    workers: int
    seed: int
    output_folder: str
    checkpoint_steps: int
    resume_run: str
    report_steps: int
    picture_cache_mb: int
    hidden_size: int
    feedforward_size: int
    encoder_layers: int
    pretrained_backbone: bool
    backbone_learning_rate: float
    weight_decay: float
    max_grad_norm: float
    lora_rank: int
    learning_rate_schedule: str
    use_vae: bool
    processes: int
    machines: int
    machine_rank: int
    main_address: str
    state_noise: float
    robot_evaluation_steps: int
    robot_episodes: int
    robot_wait_s: float
    def __init__(self, dataset_name: _Optional[str] = ..., num_epochs: _Optional[int] = ..., learning_rate: _Optional[float] = ..., batch_size: _Optional[int] = ..., loss_function: _Optional[str] = ..., policy_type: _Optional[str] = ..., pretrained: _Optional[str] = ..., max_steps: _Optional[int] = ..., chunk_size: _Optional[int] = ..., actions_per_chunk: _Optional[int] = ..., cameras: _Optional[_Iterable[str]] = ..., image_width: _Optional[int] = ..., image_height: _Optional[int] = ..., validation_share: _Optional[float] = ..., validation_steps: _Optional[int] = ..., validation_batches: _Optional[int] = ..., colour_jitter: _Optional[float] = ..., shift_px: _Optional[int] = ..., accumulation_steps: _Optional[int] = ..., device: _Optional[str] = ..., precision: _Optional[str] = ..., threads: _Optional[int] = ..., workers: _Optional[int] = ..., seed: _Optional[int] = ..., output_folder: _Optional[str] = ..., checkpoint_steps: _Optional[int] = ..., resume_run: _Optional[str] = ..., report_steps: _Optional[int] = ..., picture_cache_mb: _Optional[int] = ..., hidden_size: _Optional[int] = ..., feedforward_size: _Optional[int] = ..., encoder_layers: _Optional[int] = ..., pretrained_backbone: _Optional[bool] = ..., backbone_learning_rate: _Optional[float] = ..., weight_decay: _Optional[float] = ..., max_grad_norm: _Optional[float] = ..., lora_rank: _Optional[int] = ..., learning_rate_schedule: _Optional[str] = ..., use_vae: _Optional[bool] = ..., processes: _Optional[int] = ..., machines: _Optional[int] = ..., machine_rank: _Optional[int] = ..., main_address: _Optional[str] = ..., state_noise: _Optional[float] = ..., robot_evaluation_steps: _Optional[int] = ..., robot_episodes: _Optional[int] = ..., robot_wait_s: _Optional[float] = ...) -> None: ...

class EvalConfig(_message.Message):
    __slots__ = ("model_checkpoint", "num_episodes", "metrics", "compare_with", "seed", "confidence", "bootstrap_samples", "videos", "camera", "randomise", "output_folder", "task", "strategy", "steps_per_chunk", "inference_delay", "compute", "plugin_config")
    MODEL_CHECKPOINT_FIELD_NUMBER: _ClassVar[int]
    NUM_EPISODES_FIELD_NUMBER: _ClassVar[int]
    METRICS_FIELD_NUMBER: _ClassVar[int]
    COMPARE_WITH_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    CONFIDENCE_FIELD_NUMBER: _ClassVar[int]
    BOOTSTRAP_SAMPLES_FIELD_NUMBER: _ClassVar[int]
    VIDEOS_FIELD_NUMBER: _ClassVar[int]
    CAMERA_FIELD_NUMBER: _ClassVar[int]
    RANDOMISE_FIELD_NUMBER: _ClassVar[int]
    OUTPUT_FOLDER_FIELD_NUMBER: _ClassVar[int]
    TASK_FIELD_NUMBER: _ClassVar[int]
    STRATEGY_FIELD_NUMBER: _ClassVar[int]
    STEPS_PER_CHUNK_FIELD_NUMBER: _ClassVar[int]
    INFERENCE_DELAY_FIELD_NUMBER: _ClassVar[int]
    COMPUTE_FIELD_NUMBER: _ClassVar[int]
    PLUGIN_CONFIG_FIELD_NUMBER: _ClassVar[int]
    model_checkpoint: str
    num_episodes: int
    metrics: _containers.RepeatedScalarFieldContainer[str]
    compare_with: str
    seed: int
    confidence: float
    bootstrap_samples: int
    videos: int
    camera: str
    randomise: bool
    output_folder: str
    task: str
    strategy: ExecutionStrategy
    steps_per_chunk: int
    inference_delay: int
    compute: ModelCompute
    plugin_config: _any_pb2.Any
    def __init__(self, model_checkpoint: _Optional[str] = ..., num_episodes: _Optional[int] = ..., metrics: _Optional[_Iterable[str]] = ..., compare_with: _Optional[str] = ..., seed: _Optional[int] = ..., confidence: _Optional[float] = ..., bootstrap_samples: _Optional[int] = ..., videos: _Optional[int] = ..., camera: _Optional[str] = ..., randomise: _Optional[bool] = ..., output_folder: _Optional[str] = ..., task: _Optional[str] = ..., strategy: _Optional[_Union[ExecutionStrategy, str]] = ..., steps_per_chunk: _Optional[int] = ..., inference_delay: _Optional[int] = ..., compute: _Optional[_Union[ModelCompute, _Mapping]] = ..., plugin_config: _Optional[_Union[_any_pb2.Any, _Mapping]] = ...) -> None: ...

class Node(_message.Message):
    __slots__ = ("node_name", "node_id", "node_type", "qos", "publishers", "subscriptions", "python", "host", "ros_namespace", "process_group", "restart", "frame_id")
    NODE_NAME_FIELD_NUMBER: _ClassVar[int]
    NODE_ID_FIELD_NUMBER: _ClassVar[int]
    NODE_TYPE_FIELD_NUMBER: _ClassVar[int]
    QOS_FIELD_NUMBER: _ClassVar[int]
    PUBLISHERS_FIELD_NUMBER: _ClassVar[int]
    SUBSCRIPTIONS_FIELD_NUMBER: _ClassVar[int]
    PYTHON_FIELD_NUMBER: _ClassVar[int]
    HOST_FIELD_NUMBER: _ClassVar[int]
    ROS_NAMESPACE_FIELD_NUMBER: _ClassVar[int]
    PROCESS_GROUP_FIELD_NUMBER: _ClassVar[int]
    RESTART_FIELD_NUMBER: _ClassVar[int]
    FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    node_name: str
    node_id: int
    node_type: NodeType
    qos: QoSSettings
    publishers: _containers.RepeatedCompositeFieldContainer[Publisher]
    subscriptions: _containers.RepeatedCompositeFieldContainer[Subscription]
    python: str
    host: str
    ros_namespace: str
    process_group: str
    restart: RestartPolicy
    frame_id: str
    def __init__(self, node_name: _Optional[str] = ..., node_id: _Optional[int] = ..., node_type: _Optional[_Union[NodeType, str]] = ..., qos: _Optional[_Union[QoSSettings, _Mapping]] = ..., publishers: _Optional[_Iterable[_Union[Publisher, _Mapping]]] = ..., subscriptions: _Optional[_Iterable[_Union[Subscription, _Mapping]]] = ..., python: _Optional[str] = ..., host: _Optional[str] = ..., ros_namespace: _Optional[str] = ..., process_group: _Optional[str] = ..., restart: _Optional[_Union[RestartPolicy, str]] = ..., frame_id: _Optional[str] = ...) -> None: ...

class QoSSettings(_message.Message):
    __slots__ = ("reliability", "durability", "history", "depth", "liveliness", "deadline_s", "lifespan_s", "lease_duration_s")
    RELIABILITY_FIELD_NUMBER: _ClassVar[int]
    DURABILITY_FIELD_NUMBER: _ClassVar[int]
    HISTORY_FIELD_NUMBER: _ClassVar[int]
    DEPTH_FIELD_NUMBER: _ClassVar[int]
    LIVELINESS_FIELD_NUMBER: _ClassVar[int]
    DEADLINE_S_FIELD_NUMBER: _ClassVar[int]
    LIFESPAN_S_FIELD_NUMBER: _ClassVar[int]
    LEASE_DURATION_S_FIELD_NUMBER: _ClassVar[int]
    reliability: Reliability
    durability: Durability
    history: History
    depth: int
    liveliness: Liveliness
    deadline_s: float
    lifespan_s: float
    lease_duration_s: float
    def __init__(self, reliability: _Optional[_Union[Reliability, str]] = ..., durability: _Optional[_Union[Durability, str]] = ..., history: _Optional[_Union[History, str]] = ..., depth: _Optional[int] = ..., liveliness: _Optional[_Union[Liveliness, str]] = ..., deadline_s: _Optional[float] = ..., lifespan_s: _Optional[float] = ..., lease_duration_s: _Optional[float] = ...) -> None: ...

class Publisher(_message.Message):
    __slots__ = ("data_type", "topic_name", "publish_rate_hz", "qos", "override", "override_motion_rad")
    DATA_TYPE_FIELD_NUMBER: _ClassVar[int]
    TOPIC_NAME_FIELD_NUMBER: _ClassVar[int]
    PUBLISH_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    QOS_FIELD_NUMBER: _ClassVar[int]
    OVERRIDE_FIELD_NUMBER: _ClassVar[int]
    OVERRIDE_MOTION_RAD_FIELD_NUMBER: _ClassVar[int]
    data_type: _data_type_pb2.DataType
    topic_name: str
    publish_rate_hz: float
    qos: QoSSettings
    override: bool
    override_motion_rad: float
    def __init__(self, data_type: _Optional[_Union[_data_type_pb2.DataType, str]] = ..., topic_name: _Optional[str] = ..., publish_rate_hz: _Optional[float] = ..., qos: _Optional[_Union[QoSSettings, _Mapping]] = ..., override: _Optional[bool] = ..., override_motion_rad: _Optional[float] = ...) -> None: ...

class Subscription(_message.Message):
    __slots__ = ("data_type", "topic_name", "qos", "external")
    DATA_TYPE_FIELD_NUMBER: _ClassVar[int]
    TOPIC_NAME_FIELD_NUMBER: _ClassVar[int]
    QOS_FIELD_NUMBER: _ClassVar[int]
    EXTERNAL_FIELD_NUMBER: _ClassVar[int]
    data_type: _data_type_pb2.DataType
    topic_name: str
    qos: QoSSettings
    external: bool
    def __init__(self, data_type: _Optional[_Union[_data_type_pb2.DataType, str]] = ..., topic_name: _Optional[str] = ..., qos: _Optional[_Union[QoSSettings, _Mapping]] = ..., external: _Optional[bool] = ...) -> None: ...

class TestConfig(_message.Message):
    __slots__ = ("duration_s",)
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    duration_s: float
    def __init__(self, duration_s: _Optional[float] = ...) -> None: ...

class CalibrationRun(_message.Message):
    __slots__ = ("display",)
    DISPLAY_FIELD_NUMBER: _ClassVar[int]
    display: bool
    def __init__(self, display: _Optional[bool] = ...) -> None: ...
