"""Blocks that stand in the file and have no effect in its mode: nothing is ignored silently."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from joshua.config.checks import Context
from joshua.modes.parts import mode_name
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
        (*_DRIVING, pb.MODE_SIMULATION, pb.MODE_TRAINING),
        "in MODE_SIMULATION, in training, and where devices run with --sim",
    ),
    "ai.models": _Use(
        (*_DRIVING, pb.MODE_SIMULATION, pb.MODE_TRAINING), "in the modes that start nodes or train"
    ),
}


def check(context: Context) -> Iterator[Diagnostic]:
    """Notes every block that the mode does not use."""
    mode = context.config.general.mode
    for path, use in _USES.items():
        if mode in use.modes or not _stands(context, path):
            continue
        place = f"{path}[0]" if path == "ai.models" else path
        yield context.note(
            "block-unused",
            f"{path.rpartition('.')[2]} has no effect in {mode_name(context)}; it counts {use.where}",
            path,
            position=context.block_position(place),
            remedy="Remove it, or change general.mode",
            related=context.see("general.mode", "mode"),
        )


def _stands(context: Context, path: str) -> bool:
    config = context.config
    if path == "ai.models":
        return bool(config.ai.models)
    owner, _, name = path.rpartition(".")
    return bool((config.ai if owner else config).HasField(name))
