"""Blocks that stand in the file and have no effect in its mode: nothing is ignored silently."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from joshua.config.checks import Context
from joshua.modes.parts import mode_name
from joshua.modes.share import mode_share
from joshua.plan import Diagnostic
from joshua.schema import config_pb2 as pb

_DRIVING = (pb.MODE_TELEOPERATE, pb.MODE_INFERENCE, pb.MODE_TEST, pb.MODE_DATA_STORE)


class _Use(NamedTuple):
    """Where a block counts: the modes, and what they are called in a sentence."""

    modes: tuple[int, ...]
    where: str


_USES = {
    "test": _Use((pb.MODE_TEST,), "in MODE_TEST"),
    "calibration_run": _Use((pb.MODE_CALIBRATION,), "in MODE_CALIBRATION"),
    "ai.training": _Use((pb.MODE_TRAINING,), "in MODE_TRAINING"),
    "ai.data_store": _Use(
        (
            pb.MODE_TELEOPERATE,
            pb.MODE_INFERENCE,
            pb.MODE_TRAINING,
            pb.MODE_DATA_STORE,
            pb.MODE_SIMULATION,
        ),
        "where episodes are recorded or read: teleoperation, inference, training, data store and simulation",
    ),
    # Outside its own mode the block describes the physics of `joshua --sim`.
    "simulation": _Use(
        (*_DRIVING, pb.MODE_CALIBRATION, pb.MODE_SIMULATION, pb.MODE_TRAINING),
        "in MODE_SIMULATION, in training, and where devices run with --sim",
    ),
}


def check(context: Context) -> Iterator[Diagnostic]:
    """Notes every block that the mode does not use."""
    config, mode = context.config, context.config.general.mode
    for path, use in _USES.items():
        owner, _, name = path.rpartition(".")
        if mode not in use.modes and (config.ai if owner else config).HasField(name):
            yield _note(context, path, path, f"it counts {use.where}")
    if config.simulation.HasField("generate") and mode in _DRIVING:
        yield _note(context, "simulation.generate", "simulation.generate", "it counts in MODE_SIMULATION")
    share = mode_share(config)
    if config.ai.models and not share.models and mode != pb.MODE_TRAINING:
        yield _note(context, "ai.models", "ai.models[0]", "models run in MODE_INFERENCE and MODE_TEST")
    if not share.devices and (config.robot.actions or config.robot.perceptions):
        yield _note(context, "robot", "robot", f"{_without_devices(context)} starts no device")


def _note(context: Context, path: str, place: str, reason: str) -> Diagnostic:
    return context.note(
        "block-unused",
        f"{path.rpartition('.')[2]} has no effect in {mode_name(context)}; {reason}",
        path,
        position=context.block_position(place),
        remedy="Remove it, or change general.mode",
        related=context.see("general.mode", "mode"),
    )


def _without_devices(context: Context) -> str:
    return "training in simulation" if context.config.general.mode == pb.MODE_TRAINING else "an upload"
