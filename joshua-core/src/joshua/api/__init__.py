"""The public names for authors of plugins: devices, models, services, and how a plugin describes them.

Nothing is imported before it is used, so a plugin's description that takes its specs from here stays light.
What fewer plugins need stands in modules of this package: ``calibration``, ``clocks``, ``emulation``,
``modes``, ``motions``, ``nodes``, ``schema``, ``simulation``, ``specs`` and ``transports``. The other public
modules are ``joshua.features`` (what is seen and done), ``joshua.messages`` (ROS 2 messages),
``joshua.testing`` (the conformance kit) and ``joshua.tools`` (load, check, plan, and the client of a running
system).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from joshua.plan.lazy import lazy_names

if TYPE_CHECKING:
    from joshua.devices.actuator import Actuator as Actuator
    from joshua.devices.actuator import FloatArray as FloatArray
    from joshua.devices.actuator import JointLimits as JointLimits
    from joshua.devices.actuator import JointReading as JointReading
    from joshua.devices.context import ActuatorContext as ActuatorContext
    from joshua.devices.context import SensorContext as SensorContext
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
    from joshua.guardian.safe_stop import SafeStopRequest as SafeStopRequest
    from joshua.guardian.safe_stop import SafeStopResult as SafeStopResult
    from joshua.guardian.safe_stop import TorqueState as TorqueState
    from joshua.models.model import JointSpace as JointSpace
    from joshua.models.model import Model as Model
    from joshua.models.model import ModelError as ModelError
    from joshua.models.model import Observation as Observation
    from joshua.node.behaviour import NodeBehaviour as NodeBehaviour
    from joshua.node.context import NodeContext as NodeContext
    from joshua.node.errors import Cancelled as Cancelled
    from joshua.node.verbs import RefusedError as RefusedError
    from joshua.node.verbs import verb as verb
    from joshua.plan import JointRange as JointRange
    from joshua.plugins.block_context import BlockContext as BlockContext
    from joshua.plugins.hooks import hookimpl as hookimpl
    from joshua.plugins.settings import ActuatorSettings as ActuatorSettings
    from joshua.plugins.settings import BlockSettings as BlockSettings
    from joshua.plugins.settings import FieldError as FieldError
    from joshua.plugins.settings import FieldErrors as FieldErrors
    from joshua.plugins.settings import FromField as FromField
    from joshua.plugins.specs import ActuatorSpec as ActuatorSpec
    from joshua.plugins.specs import EpisodeWriterSpec as EpisodeWriterSpec
    from joshua.plugins.specs import ModelSpec as ModelSpec
    from joshua.plugins.specs import ModeOffer as ModeOffer
    from joshua.plugins.specs import PluginSpec as PluginSpec
    from joshua.plugins.specs import SensorSpec as SensorSpec
    from joshua.plugins.specs import SimulatorSpec as SimulatorSpec
    from joshua.plugins.specs import StoreSpec as StoreSpec
    from joshua.plugins.specs import TrainerSpec as TrainerSpec
    from joshua.plugins.specs import TransportSpec as TransportSpec

SECTIONS: dict[str, dict[str, tuple[str, ...]]] = {
    "Devices": {
        "joshua.devices.actuator": ("Actuator", "JointLimits", "JointReading", "FloatArray"),
        "joshua.devices.context": ("ActuatorContext", "SensorContext"),
        "joshua.guardian.safe_stop": ("SafeStopRequest", "SafeStopResult", "TorqueState"),
        "joshua.devices.sensor": ("Sensor", "Reading"),
        "joshua.devices.sensor_node": ("SensorNode",),
        "joshua.plan": ("JointRange",),
        "joshua.devices.diagnostics": ("DiagnosticStatus",),
        "joshua.devices.stamps": ("StampClock",),
    },
    "Errors of devices": {
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
    "Services and verbs": {
        "joshua.node.behaviour": ("NodeBehaviour",),
        "joshua.node.context": ("NodeContext",),
        "joshua.node.verbs": ("verb", "RefusedError"),
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
            "ModeOffer",
            "TransportSpec",
        ),
    },
}
"""The names by the heading that the reference lists them under, and the module that each stands in."""

__getattr__, __dir__ = lazy_names(
    __name__, {module: names for modules in SECTIONS.values() for module, names in modules.items()}
)
