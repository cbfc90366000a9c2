"""The checks of a configuration, one file per family of rules."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from importlib import import_module
from itertools import islice

from joshua.config.checks.context import Context
from joshua.config.loading import LoadedConfig
from joshua.plan import Diagnostic, Severity
from joshua.textproto.limits import MAX_PROBLEMS

__all__ = ["Context", "at_most", "check", "settle"]

# Each family is a module with a function ``check``; its condition selects the files that it concerns, so that
# other files do not import it.
_FAMILIES: dict[str, Callable[[Context], bool]] = {
    "fields": lambda context: True,
    "name_rules": lambda context: True,
    "identity": lambda context: bool(context.graph.entries),
    "resources": lambda context: bool(context.graph.entries) or context.config.HasField("calibration"),
    "fit": lambda context: bool(context.graph.entries) or context.config.HasField("ai"),
    "rates": lambda context: bool(context.graph.entries),
    "topics": lambda context: bool(context.graph.entries),
    "qos": lambda context: bool(context.graph.entries),
    "no_effect": lambda context: True,
    "calibration": lambda context: context.config.HasField("calibration"),
    "transport": lambda context: (
        context.config.HasField("transport") or any(entry.node.host for entry in context.graph.entries)
    ),
}


def check(loaded: LoadedConfig, without: Collection[str] = ()) -> list[Diagnostic]:
    """Check a loaded configuration against every rule that needs no device, plugin or other file.

    Args:
        loaded: the result of ``joshua.config.load``, complete or not.
        without: families that do not apply in the file's mode.

    Returns:
        Every problem, in the order of the families. Rendering sorts them by position.
    """
    if not loaded.is_readable:
        return []
    context = Context(loaded)
    families = (
        import_module(f"joshua.config.checks.{name}")
        for name, concerns in _FAMILIES.items()
        if name not in without and concerns(context)
    )
    return settle((item for family in families for item in family.check(context)), loaded)


def settle(findings: Iterator[Diagnostic], loaded: LoadedConfig) -> list[Diagnostic]:
    """Limit the findings of a family of checks, and omit those that depend on unknown values.

    Args:
        findings: of the checks; loaded: the checked configuration.
    """
    taken = at_most(findings)
    if not taken or (
        loaded.graph.all_published and not any(item.severity is Severity.ERROR for item in loaded.diagnostics)
    ):
        return taken
    from joshua.config.checks.taint import untainted

    return untainted(taken, loaded)


def at_most(findings: Iterator[Diagnostic], most: int = MAX_PROBLEMS) -> list[Diagnostic]:
    """Limit the number of findings, and report if there are more."""
    taken = list(islice(findings, most))
    if next(findings, None) is not None:
        taken.append(
            Diagnostic(
                code="too-many-problems",
                severity=Severity.ERROR,
                message=f"Checking stopped after {most} problems; there may be more.",
                remedy="Correct these problems and run the command again.",
            )
        )
    return taken
