"""The plugin host: loads what is installed and turns every fault of a plugin into a row with its reason."""

from __future__ import annotations

import importlib
from collections.abc import Iterable

import pluggy

from joshua.plugins.discovery import Candidate, discover, is_blocked
from joshua.plugins.hooks import PROJECT_NAME, PluginHooks
from joshua.plugins.registry import PluginRow, PluginStatus, Registry
from joshua.plugins.specs import PluginSpec
from joshua.plugins.verify import verify_specs


def load_registry(blocked: Iterable[str] = ()) -> Registry:
    """Loads the light module of every installed plugin and verifies what it declares.

    Args:
        blocked: names of distributions or entry points whose modules are not imported.

    Returns:
        The registry; a plugin that is broken, blocked or in conflict is a row in it.
    """
    names = tuple(blocked)
    manager = pluggy.PluginManager(PROJECT_NAME)
    manager.add_hookspecs(PluginHooks)
    return Registry(tuple(_load(manager, candidate, names) for candidate in discover()))


class _BrokenPluginError(Exception):
    """A plugin cannot be used; the arguments are the reasons."""


def _load(manager: pluggy.PluginManager, candidate: Candidate, blocked: tuple[str, ...]) -> PluginRow:
    specs: tuple[PluginSpec, ...] = ()
    reasons: tuple[str, ...] = ()
    if is_blocked(candidate, blocked):
        status, reasons = PluginStatus.BLOCKED, ("blocked on request; its module was not imported",)
    else:
        try:
            specs = _ask(manager, candidate)
            status = PluginStatus.OK
        except _BrokenPluginError as error:
            status, reasons = PluginStatus.BROKEN, tuple(map(str, error.args))
    return PluginRow(
        name=candidate.name,
        distribution=candidate.distribution,
        version=candidate.version,
        status=status,
        reasons=reasons,
        specs=specs,
        module=candidate.target,
    )


def _ask(manager: pluggy.PluginManager, candidate: Candidate) -> tuple[PluginSpec, ...]:
    """Imports a plugin's module, registers its hooks and asks what it provides."""
    try:
        plugin = _load_target(candidate.target)
    except (Exception, SystemExit) as error:
        if _asks_for_old_names(error):
            raise _BrokenPluginError(_old_contract("imports Provision", candidate)) from error
        raise _BrokenPluginError(
            f"{candidate.target} cannot be imported: {type(error).__name__}: {error}"
        ) from error
    try:
        manager.register(plugin, name=candidate.key)
        _check_hooks(manager, plugin, candidate)
        answers = _specs(manager, candidate)
    except _BrokenPluginError:
        manager.unregister(plugin)
        raise
    except (pluggy.PluginValidationError, ValueError) as error:
        if manager.is_registered(plugin):
            manager.unregister(plugin)
        raise _BrokenPluginError(" ".join(str(error).split())) from error
    if any(type(answer).__name__ == "Provision" for answer in answers):
        raise _BrokenPluginError(_old_contract("returns Provision objects", candidate))
    problems = verify_specs(answers)
    if problems:
        raise _BrokenPluginError(*problems)
    return tuple(answer for answer in answers if isinstance(answer, PluginSpec))


def _load_target(target: str) -> object:
    """Imports what an entry point names: a module, or an object in it."""
    module, _, attributes = target.partition(":")
    found: object = importlib.import_module(module.strip())
    for attribute in filter(None, attributes.strip().split(".")):
        found = getattr(found, attribute)
    return found


def _asks_for_old_names(error: BaseException) -> bool:
    """Whether an import failed for a name that the contract of plugins had before there were specs."""
    return (
        isinstance(error, ImportError)
        and error.name in ("joshua.plugins", "joshua.plugins.provision")
        and "rovision" in str(error)
    )


def _old_contract(what: str, candidate: Candidate) -> str:
    return (
        f"was written for an earlier version of JOSHUA: it {what}. A plugin declares each thing that it "
        "provides as ActuatorSpec, SensorSpec or the like of joshua.plugins, in the hook joshua_specs: "
        f"pip install --upgrade {candidate.distribution}, or change it as docs/guides/plugins.md shows"
    )


def _check_hooks(manager: pluggy.PluginManager, plugin: object, candidate: Candidate) -> None:
    callers = manager.get_hookcallers(plugin) or []
    known = sorted(name for name in vars(PluginHooks) if name.startswith(f"{PROJECT_NAME}_"))
    unknown = [caller.name for caller in callers if not caller.has_spec()]
    if "joshua_provisions" in unknown:
        raise _BrokenPluginError(_old_contract("implements the hook joshua_provisions", candidate))
    if unknown:
        raise _BrokenPluginError(
            *(f"{name} is no hook of this version of JOSHUA; allowed: {', '.join(known)}" for name in unknown)
        )
    if not callers:
        raise _BrokenPluginError(
            f"declares no hook: mark the function {known[0]} with @joshua.plugins.hookimpl, "
            "and let the entry point name its module"
        )


def _specs(manager: pluggy.PluginManager, candidate: Candidate) -> list[object]:
    implementation = next(
        impl for impl in manager.hook.joshua_specs.get_hookimpls() if impl.plugin_name == candidate.key
    )
    if implementation.hookwrapper or implementation.wrapper:
        raise _BrokenPluginError("joshua_specs is a hook wrapper; a plugin answers only for itself")
    try:
        answer = implementation.function()
        if isinstance(answer, (str, PluginSpec)) or not isinstance(answer, Iterable):
            raise _BrokenPluginError(
                f"joshua_specs returned {type(answer).__name__}, not an iterable of specs"
            )
        return list(answer)
    except _BrokenPluginError:
        raise
    except (Exception, SystemExit) as error:
        raise _BrokenPluginError(f"joshua_specs failed: {type(error).__name__}: {error}") from error
