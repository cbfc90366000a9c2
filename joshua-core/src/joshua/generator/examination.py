"""From a path to a checked plan: everything left of «supervise», without touching a device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from joshua.plan import Diagnostic, Plan, Severity


@dataclass(frozen=True)
class Request:
    """What the user asked for.

    Attributes:
        path: configuration file; overrides: ``--set`` options, in order.
        host: this machine's name in the file; "" starts every node.
        blocked_plugins: plugins that are left out.
        launch: whether nodes are going to be started, which turns missing files and plugins into errors.
        duration_s: length of the run; None leaves it to the mode.
    """

    path: str
    overrides: Sequence[str] = ()
    host: str = ""
    blocked_plugins: Sequence[str] = ()
    launch: bool = False
    duration_s: float | None = None


@dataclass(frozen=True)
class Examination:
    """What is known about a configuration: findings, sources for rendering, and the plan if it is good."""

    diagnostics: Sequence[Diagnostic]
    sources: Mapping[str, str]
    plan: Plan | None


def examine(request: Request) -> Examination:
    """Loads, checks and plans a configuration; reports every problem at once and never raises for one."""
    from joshua.config import check, load
    from joshua.config.checks.paths import check_paths
    from joshua.generator.planning import make_plan
    from joshua.modes import check_mode
    from joshua.plugins import load_registry

    registry = load_registry(blocked=tuple(request.blocked_plugins))
    loaded = load(request.path, overrides=request.overrides, message_types=registry.message_modules())
    diagnostics = [*loaded.diagnostics, *check(loaded), *check_mode(loaded)]
    diagnostics += check_paths(loaded, launch=request.launch)
    plan, findings = make_plan(loaded, registry, request)
    diagnostics += findings
    if plan is None or any(item.severity is Severity.ERROR for item in diagnostics):
        return Examination(diagnostics, loaded.sources, None)
    return Examination(diagnostics, loaded.sources, plan.model_copy(update={"findings": tuple(diagnostics)}))
