# ruff: noqa: I001 - by headings, which the reference lists the names under

# Devices
from joshua.devices.actuator import Actuator as Actuator
from joshua.devices.actuator import JointLimits as JointLimits
from joshua.devices.actuator import JointReading as JointReading
from joshua.devices.actuator import FloatArray as FloatArray
from joshua.devices.context import ActuatorContext as ActuatorContext
from joshua.devices.context import SensorContext as SensorContext
from joshua.guardian.safe_stop import SafeStopRequest as SafeStopRequest
from joshua.guardian.safe_stop import SafeStopResult as SafeStopResult
from joshua.guardian.safe_stop import TorqueState as TorqueState
from joshua.devices.sensor import Sensor as Sensor
from joshua.devices.sensor import Reading as Reading
from joshua.plan import JointRange as JointRange
from joshua.devices.diagnostics import DiagnosticStatus as DiagnosticStatus

# Errors of devices
from joshua.devices.errors import DeviceError as DeviceError
from joshua.devices.errors import ConfigurationError as ConfigurationError
from joshua.devices.errors import DeviceDisconnected as DeviceDisconnected
from joshua.devices.errors import DeviceSilent as DeviceSilent
from joshua.devices.errors import DeviceBusy as DeviceBusy
from joshua.devices.errors import SafetyTripped as SafetyTripped
from joshua.node.errors import Cancelled as Cancelled

# Models
from joshua.models.model import Model as Model
from joshua.models.model import ModelError as ModelError
from joshua.models.model import JointSpace as JointSpace
from joshua.models.model import Observation as Observation

# Services and verbs
from joshua.node.behaviour import Simulator as Simulator
from joshua.node.behaviour import Store as Store
from joshua.node.behaviour import Trainer as Trainer
from joshua.node.context import NodeContext as NodeContext
from joshua.node.verbs import verb as verb
from joshua.node.verbs import RefusedError as RefusedError

# Settings
from joshua.plugins.settings import BlockSettings as BlockSettings
from joshua.plugins.settings import ActuatorSettings as ActuatorSettings
from joshua.plugins.settings import FieldError as FieldError
from joshua.plugins.settings import FieldErrors as FieldErrors
from joshua.plugins.settings import FromField as FromField
from joshua.plugins.block_context import BlockContext as BlockContext

# What a plugin provides
from joshua.plugins.host import hookimpl as hookimpl
from joshua.plugins.specs import PluginSpec as PluginSpec
from joshua.plugins.specs import ActuatorSpec as ActuatorSpec
from joshua.plugins.specs import SensorSpec as SensorSpec
from joshua.plugins.specs import ModelSpec as ModelSpec
from joshua.plugins.specs import StoreSpec as StoreSpec
from joshua.plugins.specs import TrainerSpec as TrainerSpec
from joshua.plugins.specs import SimulatorSpec as SimulatorSpec

SECTIONS: dict[str, dict[str, tuple[str, ...]]]
