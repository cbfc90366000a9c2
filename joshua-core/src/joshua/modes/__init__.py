"""The operation modes: one file and one ``ModeSpec`` each."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import TYPE_CHECKING

from joshua.config.checks import Context, settle
from joshua.modes.queries import mode_name, unused
from joshua.modes.spec import ModeSpec, ServiceSpec
from joshua.plan import Diagnostic
from joshua.schema import config_pb2 as pb

if TYPE_CHECKING:
    from joshua.config import LoadedConfig

__all__ = ["ModeSpec", "ServiceSpec", "check_mode", "mode_name", "mode_of"]

# Modules with a ``SPEC``; only that of the file's mode is imported.
_MODULES = {
    "MODE_TELEOPERATE": "teleoperate",
    "MODE_INFERENCE": "inference",
    "MODE_TRAINING": "training",
    "MODE_CALIBRATION": "calibration",
    "MODE_TEST": "test",
    "MODE_DATA_STORE": "data_store",
    "MODE_SIMULATION": "simulation",
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


def mode_of(config: pb.Config) -> ModeSpec:
    """The mode of a file, with what the file's own choices change of it.

    A mode that nobody knows starts every device.
    """
    spec = _find(config)
    return spec.for_file(spec, config) if isinstance(spec, ModeSpec) else ModeSpec(mode_name(config))


def _find(config: pb.Config) -> ModeSpec | None:
    """The mode as its author wrote it; None where nobody brings it."""
    name = mode_name(config)
    if name in _MODULES:
        spec: ModeSpec = import_module(f"joshua.modes.{_MODULES[name]}").SPEC
        return spec
    return None


def check_mode(loaded: LoadedConfig) -> list[Diagnostic]:
    """Checks that the file holds what its operation mode needs; a file without a mode has no findings here.

    Args:
        loaded: what ``joshua.config.load`` returned, be it complete or not.
    """
    context = Context(loaded)
    spec = _find(context.config)
    if spec is None:
        return []
    findings = list(_checked(context, spec))
    if not context.graph.all_published:
        findings = [item for item in findings if item.code not in ABSENT]
    return settle(iter(findings), loaded, absent=ABSENT)


def _checked(context: Context, spec: ModeSpec) -> Iterator[Diagnostic]:
    yield from spec.check(context)
    yield from unused(context, spec.for_file(spec, context.config))
