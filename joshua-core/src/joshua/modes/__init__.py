"""The operation modes: one file and one ``ModeSpec`` each. Plugins can add more."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import TYPE_CHECKING

from joshua.config.checks import Context, settle
from joshua.modes.queries import mode_name, mode_position, unused
from joshua.modes.spec import ModeSpec, ServiceSpec
from joshua.plan import Diagnostic
from joshua.plugins import ModeOffer
from joshua.schema import config_pb2 as pb
from joshua.textproto.nearest import nearest

if TYPE_CHECKING:
    from joshua.config import LoadedConfig
    from joshua.plugins import Registry

__all__ = ["ModeSpec", "ServiceSpec", "check_mode", "mode_name", "mode_of"]

# Modules with a ``SPEC``, named like their modes; only that of the file's mode is imported.
_MODULES = ("teleoperate", "inference", "training", "test", "data_store", "simulation")


def mode_of(config: pb.Config, registry: Registry | None = None) -> ModeSpec:
    """Return the mode of a file, adapted to the file's choices.

    An unset mode, or one whose plugin is missing, starts every device. ``check_mode`` reports the missing
    plugin, and checks that the plugin might waive are skipped.
    """
    spec = _find(config, registry)
    if isinstance(spec, ModeSpec):
        return spec.for_file(spec, config)
    return ModeSpec(mode_name(config), works_uncalibrated=bool(config.general.mode))


def _find(config: pb.Config, registry: Registry | None) -> ModeSpec | str | None:
    """Return the mode as declared, or why its plugin cannot provide it, or None if no plugin does."""
    name = mode_name(config)
    module = name.removeprefix("MODE_").lower()
    if module in _MODULES and config.general.mode != pb.MODE_PLUGIN:
        spec: ModeSpec = import_module(f"joshua.modes.{module}").SPEC
        return spec
    offer = registry.modes().get(name) if registry is not None and name else None
    if offer is None:
        return None
    from joshua.plugins.targets import TargetError, load_target

    try:
        found = load_target(offer.implementation)
    except TargetError as error:
        return str(error)
    return found if isinstance(found, ModeSpec) else f"{offer.implementation} is no joshua.modes.ModeSpec"


def check_mode(
    loaded: LoadedConfig, registry: Registry | None = None, *, launch: bool = False
) -> list[Diagnostic]:
    """Check that a file contains what its operation mode needs. Without a mode, there are no findings.

    Args:
        loaded: the result of ``joshua.config.load``, complete or not.
        registry: the installed plugins, which may provide the mode.
        launch: nodes will be started, so a mode whose plugin is missing is an error.
    """
    context = Context(loaded, launch=launch)
    findings = [*_plugin_fields(context)]
    if context.config.general.mode and mode_name(context.config):
        found = _find(context.config, registry)
        if isinstance(found, ModeSpec):
            try:
                findings += [*found.check(context), *unused(context, found.for_file(found, context.config))]
            except Exception as error:
                if found.check.__module__.startswith(__name__) or registry is None:
                    raise
                reason = f"its check failed: {type(error).__name__}: {error}"
                findings.append(_without_plugin(context, registry, reason))
        elif registry is not None:
            findings.append(_without_plugin(context, registry, found))
    return settle(iter(findings), loaded)


def _plugin_fields(context: Context) -> Iterator[Diagnostic]:
    """Check MODE_PLUGIN and the fields that belong to it."""
    general = context.config.general
    if general.mode == pb.MODE_PLUGIN and not general.plugin_mode:
        yield context.error(
            "mode-lacks-field",
            "MODE_PLUGIN requires general.plugin_mode, the name of the mode",
            "general.plugin_mode",
            position=mode_position(context),
            remedy='Add plugin_mode: "..." to general; `joshua plugins` lists the modes of plugins',
        )
    elif general.mode and general.mode != pb.MODE_PLUGIN:
        for name in ("plugin_mode", "plugin_config"):
            if context.loaded.positions.is_set(f"general.{name}"):
                message = f"{name} has no effect: it belongs to MODE_PLUGIN"
                remedy = "Remove it, or set mode: MODE_PLUGIN in general"
                yield context.note("field-unused", message, f"general.{name}", remedy=remedy)


def _without_plugin(context: Context, registry: Registry, reason: str | None) -> Diagnostic:
    name = mode_name(context.config)
    own = context.config.general.mode == pb.MODE_PLUGIN
    path = "general.plugin_mode" if own else "general.mode"
    known = [offer.name for offer in registry.modes().values() if offer.name] if own else []
    near = nearest(name, known)
    if reason is not None:
        code, message, remedy = (
            "broken-plugin",
            f"{name}: {reason}",
            "Run `joshua plugins --check` for details",
        )
    else:
        code, message = "plugin-missing", registry.missing(path, ModeOffer, "", name)
        remedy = f"Did you mean {near[0]}?" if near else registry.remedy(ModeOffer, "", name)
    return context.missing(code, message, path, allowed=tuple(near), remedy=remedy)
