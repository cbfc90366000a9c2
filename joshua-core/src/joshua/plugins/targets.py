"""Import strings of a provision: loading them, and the deep check that each one is what it claims to be."""

from __future__ import annotations

import importlib
from typing import Any

from joshua.plugins.provision import Provision, ProvisionKind

STANDARD_BEHAVIOURS = {
    ProvisionKind.ACTUATOR: "joshua.devices.actuator_node:ActuatorNode",
    ProvisionKind.SENSOR: "joshua.devices.sensor_node:SensorNode",
    ProvisionKind.MODEL: "joshua.models.inference_node:InferenceNode",
}

_BASE_CLASSES = {
    ProvisionKind.ACTUATOR: "joshua.devices.actuator:Actuator",
    ProvisionKind.SENSOR: "joshua.devices.sensor:Sensor",
    ProvisionKind.MODEL: "joshua.models.model:Model",
    ProvisionKind.EMULATOR: "joshua.plugins.emulator:DeviceEmulator",
    ProvisionKind.EPISODE_WRITER: "joshua.plugins.episodes:EpisodeWriter",
}
_BEHAVIOUR_BASE = "joshua.node.behaviour:NodeBehaviour"
_SETTINGS_BASE = "joshua.plugins.settings:BlockSettings"
_BUS_TOOLS_BASE = "joshua.devices.bus_tools:BusTools"


class TargetError(Exception):
    """An import string leads nowhere; the message names it and the reason.

    A node that fails with it ends with the exit code of a plugin that is not installed.
    """

    exit_code = 3


def load_target(import_string: str) -> Any:
    """Imports what an import string such as ``acme.gripper:Gripper`` names. Raises TargetError."""
    module_name, _, attribute = import_string.partition(":")
    try:
        target: Any = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:
        raise TargetError(f"{import_string} cannot be imported: {type(error).__name__}: {error}") from error
    for name in attribute.split("."):
        try:
            target = getattr(target, name)
        except AttributeError as error:
            raise TargetError(f"{import_string}: {module_name} has no {attribute}") from error
    return target


def behaviour_of(provision: Provision) -> str:
    """Import string of the node behaviour that runs a provision; "" where its kind is no node."""
    return provision.behaviour or STANDARD_BEHAVIOURS.get(provision.kind, "")


def check_targets(provision: Provision) -> list[str]:
    """Imports everything that a provision names and checks the base classes; lists what is wrong.

    This imports drivers, so it belongs to the launch and to ``joshua plugins --check``, never to a
    listing or a validation. A provision with a behaviour of its own may use any implementation class.
    """
    wanted = [
        ("behaviour", provision.behaviour, _BEHAVIOUR_BASE),
        ("settings", provision.settings, _SETTINGS_BASE),
        ("implementation", provision.implementation, _base_class(provision)),
        ("native", provision.native, _base_class(provision)),
        ("safe_stop", provision.safe_stop, ""),
        ("bus_tools", provision.bus_tools, _BUS_TOOLS_BASE),
        ("packaged_files", provision.packaged_files, ""),
        ("stand_in", provision.stand_in, ""),
    ]
    problems: list[str] = []
    for role, import_string, base_string in wanted:
        if not import_string:
            continue
        try:
            target = load_target(import_string)
        except TargetError as error:
            problems.append(f"{role}: {error}")
            continue
        if base_string and not _derives(target, base_string):
            problems.append(
                f"{role}: {import_string} is {_describe(target)}, not a class derived from {base_string}"
            )
    return problems


def _base_class(provision: Provision) -> str:
    return "" if provision.behaviour else _BASE_CLASSES.get(provision.kind, "")


def _derives(target: object, base_string: str) -> bool:
    return isinstance(target, type) and issubclass(target, load_target(base_string))


def _describe(target: object) -> str:
    if not isinstance(target, type):
        return f"a {type(target).__name__}"
    bases = ", ".join(f"{base.__module__}.{base.__qualname__}" for base in target.__bases__)
    return f"a class derived from {bases}"
