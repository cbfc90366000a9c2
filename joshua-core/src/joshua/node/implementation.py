"""Loads the classes and settings of a plan from their import strings, in the child process."""

from __future__ import annotations

from typing import Any

from joshua.node.behaviour import NodeBehaviour
from joshua.plan import NodeSpec, installing
from joshua.plugins.targets import TargetError, load_target


def load_implementation(spec: NodeSpec, base: type) -> tuple[Any, Any]:
    """Imports the class that a node's behaviour drives, and creates its settings.

    Args:
        spec: the node's part of the plan.
        base: class that the implementation must derive from.

    Returns:
        The class, and an instance of the plugin's settings model, or None if it names none.

    Raises:
        TargetError: the class or the settings model cannot be imported, or has the wrong base class.
    """
    implementation = _load(spec, spec.implementation, base)
    settings_type = _load(spec, spec.settings_type, object) if spec.settings_type else None
    return implementation, settings_type.model_validate(spec.settings) if settings_type else None


def load_behaviour(spec: NodeSpec) -> type[NodeBehaviour]:
    """Imports the behaviour class of a node. Raises TargetError."""
    behaviour: type[NodeBehaviour] = _load(spec, spec.behaviour, NodeBehaviour)
    return behaviour


def _load(spec: NodeSpec, import_string: str, base: type) -> Any:
    try:
        target = load_target(import_string)
        if not (isinstance(target, type) and issubclass(target, base)):
            raise TargetError(f"{import_string} does not derive from {base.__module__}:{base.__qualname__}")
    except TargetError as error:
        missing = isinstance(error.__cause__, ModuleNotFoundError)
        command = installing.install(spec.plugin) if missing else installing.reinstall(spec.plugin)
        verb = "install" if missing else "reinstall"
        raise TargetError(f"{spec.full_name}: {error}; {verb} the plugin: {command}") from error
    return target
