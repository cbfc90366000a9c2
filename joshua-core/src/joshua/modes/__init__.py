"""One file per operation mode: which nodes, blocks and runs it needs, and its checks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain

from joshua.config.checks import Context, Loaded, at_most
from joshua.config.checks.cascades import without_cascades
from joshua.modes import (
    calibration,
    data_store,
    inference,
    simulation,
    teleoperate,
    test,
    training,
    unused,
)
from joshua.plan import Diagnostic
from joshua.schema import config_pb2 as pb

__all__ = ["check_mode"]

_CHECKS: dict[int, Callable[[Context], Iterator[Diagnostic]]] = {
    pb.MODE_TELEOPERATE: teleoperate.check,
    pb.MODE_INFERENCE: inference.check,
    pb.MODE_TRAINING: training.check,
    pb.MODE_CALIBRATION: calibration.check,
    pb.MODE_TEST: test.check,
    pb.MODE_DATA_STORE: data_store.check,
    pb.MODE_SIMULATION: simulation.check,
}

# Findings of the modes that say that a part of the file is absent.
ABSENT = frozenset(
    (
        "mode-lacks-actuator",
        "mode-lacks-block",
        "mode-lacks-device",
        "mode-lacks-field",
        "mode-lacks-follower",
        "mode-lacks-leader",
        "mode-lacks-model",
        "mode-lacks-publisher",
        "follower-without-leader",
        "model-drives-nothing",
        "model-without-camera",
        "mapping-unpublished",
    )
)


def check_mode(loaded: Loaded) -> list[Diagnostic]:
    """Checks that the file holds what its operation mode needs; a file without a mode has no findings here.

    Args:
        loaded: what ``joshua.config.load`` returned, be it complete or not.
    """
    context = Context(loaded)
    check = _CHECKS.get(context.config.general.mode)
    if check is None:
        return []
    findings = at_most(chain(check(context), unused.check(context)))
    return without_cascades(findings, loaded, absent=ABSENT)
