"""The checks of a configuration, one file for each family of rules."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from joshua.config.checks import (
    calibration,
    fields,
    fit,
    identity,
    limits,
    name_rules,
    qos,
    rates,
    resources,
    topics,
    transport,
)
from joshua.config.checks.cascades import without_cascades
from joshua.config.checks.context import Context, Loaded
from joshua.plan import Diagnostic

__all__ = ["Context", "Loaded", "check"]

_FAMILIES: tuple[Callable[[Context], Iterator[Diagnostic]], ...] = (
    fields.check,
    name_rules.check,
    identity.check,
    resources.check,
    fit.check,
    limits.check,
    rates.check,
    topics.check,
    qos.check,
    calibration.check,
    transport.check,
)


def check(loaded: Loaded) -> list[Diagnostic]:
    """Checks a loaded configuration against every rule that needs no device, plugin or other file.

    Args:
        loaded: what ``joshua.config.load`` returned, be it complete or not.

    Returns:
        Every problem, in the order of the families of rules; rendering sorts them by place.
    """
    if not loaded.is_readable:
        return []
    context = Context(loaded)
    findings = [item for family in _FAMILIES for item in family(context)]
    return without_cascades(findings, loaded)
