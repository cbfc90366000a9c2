"""Queries of a file that the checks of several modes share."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.config.checks import Context
from joshua.modes.spec import ModeSpec
from joshua.plan import Diagnostic, Position
from joshua.schema import config_pb2 as pb

#: Blocks that have an effect only in some modes, and where. A mode lists those that it uses.
_COUNTS = {
    "test": "in MODE_TEST",
    "calibration_run": "in MODE_CALIBRATION",
    "ai.training": "in MODE_TRAINING",
    "ai.data_store": "where episodes are recorded or read: teleoperation, inference, training, data store "
    "and simulation",
    # Outside MODE_SIMULATION, the block describes the physics of `joshua --sim`.
    "simulation": "in MODE_SIMULATION, in training, and where devices run with --sim",
}


def mode_name(config: pb.Config) -> str:
    """Name of the file's mode: ``MODE_…``, or the name of a plugin's mode; "" for an unknown number."""
    mode = config.general.mode
    if mode == pb.MODE_PLUGIN:
        return config.general.plugin_mode
    return pb.OperationMode.Name(mode) if mode in pb.OperationMode.values() else ""


def lacks(context: Context, code: str, what: str, path: str, **details: object) -> Diagnostic:
    """Return the error that the mode needs something that the file lacks."""
    return context.error(
        code,
        f"{mode_name(context.config)} needs {what}",
        path,
        position=details.pop("position", None) or mode_position(context),
        **details,
    )


def mode_position(context: Context) -> Position | None:
    """Position of ``general.mode``, because something missing has no position of its own."""
    return context.position("general.mode")


def unused(context: Context, spec: ModeSpec) -> Iterator[Diagnostic]:
    """Note every block of the file that has no effect in its mode, because nothing is ignored silently."""
    config = context.config
    for path, where in _COUNTS.items():
        owner, _, name = path.rpartition(".")
        if not spec.uses(path) and (config.ai if owner else config).HasField(name):
            yield _unused(context, path, path, f"it counts {where}")
    if config.simulation.HasField("generate") and spec.uses("simulation") and spec.name != "MODE_SIMULATION":
        yield _unused(context, "simulation.generate", "simulation.generate", "it applies in MODE_SIMULATION")
    if config.ai.models and not spec.models and not spec.uses("ai.models"):
        yield _unused(context, "ai.models", "ai.models[0]", "models run in MODE_INFERENCE and MODE_TEST")
    if not spec.devices and (config.robot.actions or config.robot.perceptions):
        yield _unused(context, "robot", "robot", f"{spec.idle or spec.name} starts no device")


def _unused(context: Context, path: str, place: str, reason: str) -> Diagnostic:
    message = f"{path.rpartition('.')[2]} has no effect in {mode_name(context.config)}; {reason}"
    remedy = "Remove it, or change general.mode"
    related = context.see("general.mode", "mode")
    return context.note("block-unused", message, path, remedy=remedy, related=related)
