"""The public names for authors of plugins: devices, models, services, and how a plugin describes them.

Nothing is imported before it is used, so a plugin's description that takes its specs from here stays light.
The other public modules are ``joshua.features`` (what is seen and done), ``joshua.messages`` (ROS 2
messages), ``joshua.testing`` (the conformance kit) and ``joshua.tools`` (load, check, plan, and the client of
a running system).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from joshua.plan.lazy import lazy_names

if TYPE_CHECKING:
    from joshua.config.checks import Context as Context
    from joshua.devices.actuator import Actuator as Actuator
    from joshua.devices.actuator import FloatArray as FloatArray
    from joshua.devices.actuator import JointLimits as JointLimits
    from joshua.devices.actuator import JointReading as JointReading
    from joshua.devices.calibration import LARGEST_OFFSET as LARGEST_OFFSET
    from joshua.devices.calibration import ArmCalibration as ArmCalibration
    from joshua.devices.calibration import MotorCalibration as MotorCalibration
    from joshua.devices.context import ActuatorContext as ActuatorContext
    from joshua.devices.context import DeviceContext as DeviceContext
    from joshua.devices.context import SensorContext as SensorContext
    from joshua.devices.diagnostics import DiagnosticsPublisher as DiagnosticsPublisher
    from joshua.devices.diagnostics import DiagnosticStatus as DiagnosticStatus
    from joshua.devices.errors import DeviceBusy as DeviceBusy
    from joshua.devices.errors import DeviceDisconnected as DeviceDisconnected
    from joshua.devices.errors import DeviceError as DeviceError
    from joshua.devices.errors import DeviceSilent as DeviceSilent
    from joshua.devices.errors import SafetyTripped as SafetyTripped
    from joshua.devices.sensor import Reading as Reading
    from joshua.devices.sensor import Sensor as Sensor
    from joshua.devices.sensor_node import SensorNode as SensorNode
    from joshua.devices.stamps import StampClock as StampClock
    from joshua.devices.units import TICKS_PER_TURN as TICKS_PER_TURN
    from joshua.devices.units import ticks_to_rad as ticks_to_rad
    from joshua.guardian.safe_stop import SafeStopRequest as SafeStopRequest
    from joshua.guardian.safe_stop import SafeStopResult as SafeStopResult
    from joshua.guardian.safe_stop import TorqueState as TorqueState
    from joshua.guardian.silence import AwakeClock as AwakeClock
    from joshua.guardian.silence import witness as witness
    from joshua.mock.motion import FileMotion as FileMotion
    from joshua.mock.motion import Motion as Motion
    from joshua.mock.motion import SineMotion as SineMotion
    from joshua.models.model import JointSpace as JointSpace
    from joshua.models.model import Model as Model
    from joshua.models.model import ModelError as ModelError
    from joshua.models.model import Observation as Observation
    from joshua.modes.queries import lacks as lacks
    from joshua.modes.services import DATA_STORE as DATA_STORE
    from joshua.modes.services import SIMULATION as SIMULATION
    from joshua.modes.spec import ModeSpec as ModeSpec
    from joshua.modes.spec import ServiceSpec as ServiceSpec
    from joshua.node import ros_time as ros_time
    from joshua.node.behaviour import MessagePublisher as MessagePublisher
    from joshua.node.behaviour import NodeBehaviour as NodeBehaviour
    from joshua.node.behaviour import NodeContext as NodeContext
    from joshua.node.errors import Cancelled as Cancelled
    from joshua.node.implementation import load_implementation as load_implementation
    from joshua.node.rates import RateMeter as RateMeter
    from joshua.node.service import Simulator as Simulator
    from joshua.node.service import Store as Store
    from joshua.node.service import Trainer as Trainer
    from joshua.node.verbs import RefusedError as RefusedError
    from joshua.node.verbs import verb as verb
    from joshua.plan import ActuatorFacts as ActuatorFacts
    from joshua.plan import JointRange as JointRange
    from joshua.plan import ModelFacts as ModelFacts
    from joshua.plan import SensorFacts as SensorFacts
    from joshua.plan import ServiceFacts as ServiceFacts
    from joshua.plan import TopicSpec as TopicSpec
    from joshua.plan.graph import ServiceTopic as ServiceTopic
    from joshua.plugins.block_context import BlockContext as BlockContext
    from joshua.plugins.block_values import block_values as block_values
    from joshua.plugins.block_values import default_values as default_values
    from joshua.plugins.emulator import Coupling as Coupling
    from joshua.plugins.emulator import DeviceEmulator as DeviceEmulator
    from joshua.plugins.emulator import EmulatedDevice as EmulatedDevice
    from joshua.plugins.emulator import EmulationError as EmulationError
    from joshua.plugins.emulator import FaultRefusedError as FaultRefusedError
    from joshua.plugins.emulator import PhysicsCamera as PhysicsCamera
    from joshua.plugins.emulator import PhysicsLink as PhysicsLink
    from joshua.plugins.hooks import hookimpl as hookimpl
    from joshua.plugins.settings import ActuatorSettings as ActuatorSettings
    from joshua.plugins.settings import BlockSettings as BlockSettings
    from joshua.plugins.settings import FieldError as FieldError
    from joshua.plugins.settings import FieldErrors as FieldErrors
    from joshua.plugins.settings import FromField as FromField
    from joshua.plugins.sim_adapter import CoupledArm as CoupledArm
    from joshua.plugins.sim_adapter import CoupledCamera as CoupledCamera
    from joshua.plugins.sim_adapter import RealDevice as RealDevice
    from joshua.plugins.sim_adapter import SimAdapterError as SimAdapterError
    from joshua.plugins.specs import ActuatorSpec as ActuatorSpec
    from joshua.plugins.specs import EmulatorSpec as EmulatorSpec
    from joshua.plugins.specs import Environment as Environment
    from joshua.plugins.specs import EnvironmentSpec as EnvironmentSpec
    from joshua.plugins.specs import EpisodeWriterSpec as EpisodeWriterSpec
    from joshua.plugins.specs import ModelSpec as ModelSpec
    from joshua.plugins.specs import ModeOffer as ModeOffer
    from joshua.plugins.specs import PluginSpec as PluginSpec
    from joshua.plugins.specs import SensorSpec as SensorSpec
    from joshua.plugins.specs import SimulatorSpec as SimulatorSpec
    from joshua.plugins.specs import StoreSpec as StoreSpec
    from joshua.plugins.specs import TrainerSpec as TrainerSpec
    from joshua.schema import calibration_pb2 as calibration_pb2
    from joshua.schema import config_pb2 as config_pb2
    from joshua.schema import data_type_pb2 as data_type_pb2
    from joshua.schema import simulation_pb2 as simulation_pb2
    from joshua.schema.data_type_names import TYPE_NAMES as TYPE_NAMES

SECTIONS: dict[str, dict[str, tuple[str, ...]]] = {
    "Devices": {
        "joshua.devices.actuator": ("Actuator", "JointLimits", "JointReading", "FloatArray"),
        "joshua.devices.context": ("DeviceContext", "ActuatorContext", "SensorContext"),
        "joshua.guardian.safe_stop": ("SafeStopRequest", "SafeStopResult", "TorqueState"),
        "joshua.devices.sensor": ("Sensor", "Reading"),
        "joshua.devices.sensor_node": ("SensorNode",),
        "joshua.devices.diagnostics": ("DiagnosticStatus", "DiagnosticsPublisher"),
        "joshua.devices.stamps": ("StampClock",),
        "joshua.guardian.silence": ("AwakeClock", "witness"),
        "joshua.devices.units": ("TICKS_PER_TURN", "ticks_to_rad"),
        "joshua.devices.calibration": ("ArmCalibration", "MotorCalibration", "LARGEST_OFFSET"),
        "joshua.mock.motion": ("Motion", "SineMotion", "FileMotion"),
    },
    "Errors": {
        "joshua.devices.errors": (
            "DeviceError",
            "DeviceDisconnected",
            "DeviceSilent",
            "DeviceBusy",
            "SafetyTripped",
        ),
        "joshua.node.errors": ("Cancelled",),
    },
    "Models": {
        "joshua.models.model": ("Model", "ModelError", "JointSpace", "Observation"),
    },
    "Nodes and services": {
        "joshua.node.behaviour": ("NodeBehaviour", "NodeContext", "MessagePublisher"),
        "joshua.node.service": ("Store", "Trainer", "Simulator"),
        "joshua.node.verbs": ("verb", "RefusedError"),
        "joshua.node.implementation": ("load_implementation",),
        "joshua.node.rates": ("RateMeter",),
        "joshua.node": ("ros_time",),
        "joshua.plan": (
            "TopicSpec",
            "JointRange",
            "ActuatorFacts",
            "SensorFacts",
            "ModelFacts",
            "ServiceFacts",
        ),
    },
    "Settings": {
        "joshua.plugins.settings": (
            "BlockSettings",
            "ActuatorSettings",
            "FieldError",
            "FieldErrors",
            "FromField",
        ),
        "joshua.plugins.block_context": ("BlockContext",),
    },
    "What a plugin provides": {
        "joshua.plugins.hooks": ("hookimpl",),
        "joshua.plugins.specs": (
            "PluginSpec",
            "ActuatorSpec",
            "SensorSpec",
            "ModelSpec",
            "StoreSpec",
            "EpisodeWriterSpec",
            "TrainerSpec",
            "SimulatorSpec",
            "EmulatorSpec",
            "EnvironmentSpec",
            "Environment",
            "ModeOffer",
        ),
    },
    "Operation modes": {
        "joshua.modes.spec": ("ModeSpec", "ServiceSpec"),
        "joshua.plan.graph": ("ServiceTopic",),
        "joshua.config.checks": ("Context",),
        "joshua.modes.queries": ("lacks",),
        "joshua.modes.services": ("SIMULATION", "DATA_STORE"),
    },
    "Emulators and simulators": {
        "joshua.plugins.emulator": (
            "DeviceEmulator",
            "EmulatedDevice",
            "EmulationError",
            "FaultRefusedError",
            "Coupling",
            "PhysicsLink",
            "PhysicsCamera",
        ),
        "joshua.plugins.sim_adapter": ("CoupledArm", "CoupledCamera", "RealDevice", "SimAdapterError"),
    },
    "The schema": {
        "joshua.schema": ("config_pb2", "calibration_pb2", "simulation_pb2", "data_type_pb2"),
        "joshua.schema.data_type_names": ("TYPE_NAMES",),
        "joshua.plugins.block_values": ("block_values", "default_values"),
    },
}
"""The names by the heading that the reference lists them under, and the module that each stands in."""

__getattr__, __dir__ = lazy_names(
    __name__, {module: names for modules in SECTIONS.values() for module, names in modules.items()}
)
