"""The checks of a configuration, one file for each family of rules."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice

from joshua.config.checks import (
    calibration,
    device_types,
    fields,
    fit,
    identity,
    limits,
    name_rules,
    no_effect,
    qos,
    rates,
    resources,
    topics,
    transport,
)
from joshua.config.checks.cascades import without_cascades
from joshua.config.checks.context import Context, Loaded
from joshua.config.limits import MAX_PROBLEMS
from joshua.plan import Diagnostic, Severity

__all__ = ["Context", "Loaded", "at_most", "check"]

_FAMILIES: tuple[Callable[[Context], Iterator[Diagnostic]], ...] = (
    fields.check,
    name_rules.check,
    identity.check,
    resources.check,
    fit.check,
    limits.check,
    rates.check,
    topics.check,
    device_types.check,
    qos.check,
    calibration.check,
    no_effect.check,
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
    findings = at_most(item for family in _FAMILIES for item in family(context))
    return without_cascades(findings, loaded)


def at_most(findings: Iterator[Diagnostic], most: int = MAX_PROBLEMS) -> list[Diagnostic]:
    """Takes so many findings as a person may read, and says so where there are more."""
    taken = list(islice(findings, most))
    if next(findings, None) is not None:
        taken.append(
            Diagnostic(
                code="too-many-problems",
                severity=Severity.ERROR,
                message=f"Checking stopped after {most} problems; there may be more.",
                remedy="Correct the problems that are shown and run the command again.",
            )
        )
    return taken
