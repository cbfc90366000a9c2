"""The plugin host: loads the installed plugins, and lists faulty ones with their reason."""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from dataclasses import replace

import pluggy

from joshua.plugins.discovery import PluginRow, PluginStatus, discover, is_blocked
from joshua.plugins.registry import Registry
from joshua.plugins.specs import PluginSpec
from joshua.plugins.verify import verify_specs

_HOOK = "joshua_specs"
PROJECT_NAME = "joshua"

hookspec = pluggy.HookspecMarker(PROJECT_NAME)
hookimpl = pluggy.HookimplMarker(PROJECT_NAME)


class PluginHooks:
    """Hooks that a plugin may implement."""

    @hookspec
    def joshua_specs(self) -> Iterable[PluginSpec]:
        """Return the specs of the plugin."""
        raise NotImplementedError


def load_registry(blocked: Iterable[str] = ()) -> Registry:
    """Load the light module of every installed plugin and verify its declarations.

    Args:
        blocked: names of distributions or entry points whose modules are not imported.

    Returns:
        The registry, with a row for each broken, blocked or conflicting plugin.
    """
    names = tuple(blocked)
    manager = pluggy.PluginManager(PROJECT_NAME)
    manager.add_hookspecs(PluginHooks)
    return Registry(tuple(_load(manager, row, names) for row in discover()))


class _BrokenPluginError(Exception):
    """A plugin cannot be used. The arguments are the reasons."""


def _load(manager: pluggy.PluginManager, row: PluginRow, blocked: tuple[str, ...]) -> PluginRow:
    if is_blocked(row, blocked):
        reasons = ("blocked on request; its module was not imported",)
        return replace(row, status=PluginStatus.BLOCKED, reasons=reasons)
    try:
        return replace(row, specs=_ask(manager, row))
    except _BrokenPluginError as error:
        return replace(row, status=PluginStatus.BROKEN, reasons=tuple(map(str, error.args)))


def _ask(manager: pluggy.PluginManager, row: PluginRow) -> tuple[PluginSpec, ...]:
    """Import a plugin's module, register its hooks and call them."""
    try:
        plugin = _load_target(row.module)
    except (Exception, SystemExit) as error:
        if isinstance(error, ImportError) and (
            error.name in ("joshua.plugins", "joshua.plugins.provision") and "rovision" in str(error)
        ):
            raise _old_contract("imports Provision", row) from error
        reason = f"{row.module} cannot be imported: {type(error).__name__}: {error}"
        raise _BrokenPluginError(reason) from error
    try:
        manager.register(plugin, name=row.key)
        answers = _answers(manager, plugin, row)
    except (_BrokenPluginError, pluggy.PluginValidationError, ValueError) as error:
        if manager.is_registered(plugin):
            manager.unregister(plugin)
        if isinstance(error, _BrokenPluginError):
            raise
        raise _BrokenPluginError(" ".join(str(error).split())) from error
    if any(type(answer).__name__ == "Provision" for answer in answers):
        raise _old_contract("returns Provision objects", row)
    if problems := verify_specs(answers):
        raise _BrokenPluginError(*problems)
    return tuple(answer for answer in answers if isinstance(answer, PluginSpec))


def _load_target(target: str) -> object:
    """Import the target of an entry point: a module, or an object in it."""
    module, _, attributes = target.partition(":")
    found: object = importlib.import_module(module.strip())
    for attribute in filter(None, attributes.strip().split(".")):
        found = getattr(found, attribute)
    return found


def _old_contract(what: str, row: PluginRow) -> _BrokenPluginError:
    return _BrokenPluginError(
        f"was written for an earlier version of JOSHUA: it {what}. A plugin declares each thing that it "
        "provides as ActuatorSpec, SensorSpec or the like of joshua.api, in the hook joshua_specs. "
        f"Upgrade {row.distribution}, or change it as docs/guides/plugins.md shows."
    )


def _answers(manager: pluggy.PluginManager, plugin: object, row: PluginRow) -> list[object]:
    callers = manager.get_hookcallers(plugin) or []
    unknown = [caller.name for caller in callers if not caller.has_spec()]
    if "joshua_provisions" in unknown:
        raise _old_contract("implements the hook joshua_provisions", row)
    if unknown:
        raise _BrokenPluginError(
            *(f"{name} is not a hook of this version of JOSHUA; allowed: {_HOOK}" for name in unknown)
        )
    if not callers:
        raise _BrokenPluginError(
            f"declares no hook. Mark the function {_HOOK} with @joshua.api.hookimpl, and let the entry point "
            "name its module."
        )
    implementations = manager.hook.joshua_specs.get_hookimpls()
    implementation = next(impl for impl in implementations if impl.plugin_name == row.key)
    if implementation.hookwrapper or implementation.wrapper:
        raise _BrokenPluginError(f"{_HOOK} is a hook wrapper, which is not allowed")
    try:
        answer = implementation.function()
        if not isinstance(answer, (str, PluginSpec)) and isinstance(answer, Iterable):
            return list(answer)
    except (Exception, SystemExit) as error:
        raise _BrokenPluginError(f"{_HOOK} failed: {type(error).__name__}: {error}") from error
    raise _BrokenPluginError(f"{_HOOK} returned {type(answer).__name__}, not an iterable of specs")
