"""One file per operation mode: which nodes, blocks and runs it needs, and its checks."""

from __future__ import annotations

from importlib import import_module

from joshua.config.checks import Context, Loaded, settle
from joshua.plan import Diagnostic
from joshua.schema import config_pb2 as pb

__all__ = ["check_mode"]

# Each mode is a module with a function ``check``; only that of the file's mode is imported.
_MODULES = {
    pb.MODE_TELEOPERATE: "teleoperate",
    pb.MODE_INFERENCE: "inference",
    pb.MODE_TRAINING: "training",
    pb.MODE_CALIBRATION: "calibration",
    pb.MODE_TEST: "test",
    pb.MODE_DATA_STORE: "data_store",
    pb.MODE_SIMULATION: "simulation",
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
    name = _MODULES.get(context.config.general.mode)
    if name is None:
        return []
    modules = [import_module(f"joshua.modes.{module}") for module in (name, "unused")]
    findings = (item for module in modules for item in module.check(context))
    if not context.all_published:
        findings = (item for item in findings if item.code not in ABSENT)
    return settle(findings, loaded, absent=ABSENT)
