"""From the import strings of a plan to classes and settings, in the child process."""

from __future__ import annotations

import importlib
from typing import Any

from joshua.node.behaviour import NodeBehaviour
from joshua.node.errors import ImplementationMissingError
from joshua.plan import NodeSpec, installing
from joshua.plugins.targets import TargetError, load_target


def load_implementation(spec: NodeSpec, base: type) -> tuple[Any, Any]:
    """Imports the class that a node's behaviour drives, and makes its settings.

    Args:
        spec: the node's part of the plan.
        base: class that the implementation must be derived from.

    Returns:
        The class, and the settings: an instance of the plugin's settings model, or None where it
        names none.

    Raises:
        TargetError: the class or the settings model cannot be imported, or is of another kind.
    """
    try:
        implementation = load_target(spec.implementation)
        if not (isinstance(implementation, type) and issubclass(implementation, base)):
            raise TargetError(
                f"{spec.implementation} is not derived from {base.__module__}:{base.__qualname__}"
            )
        settings_type = load_target(spec.settings_type) if spec.settings_type else None
    except TargetError as error:
        raise TargetError(
            f"{spec.full_name}: {error}; install the plugin anew: {installing.reinstall(spec.plugin)}"
        ) from error
    return implementation, settings_type.model_validate(spec.settings) if settings_type else None


def load_behaviour(spec: NodeSpec) -> type[NodeBehaviour]:
    """Imports the behaviour class of a node.

    Raises:
        ImplementationMissingError: the module is not installed, or holds no such behaviour.
    """
    module_name, _, attribute = spec.behaviour.partition(":")
    try:
        target: object = importlib.import_module(module_name)
        for part in attribute.split("."):
            target = getattr(target, part)
    except ModuleNotFoundError as error:
        raise ImplementationMissingError(
            f"{spec.full_name} needs {spec.behaviour}, but the module {error.name} is not installed: "
            f"{installing.install(spec.plugin)}"
        ) from error
    except AttributeError as error:
        raise ImplementationMissingError(
            f"{spec.full_name} needs {spec.behaviour}, but {module_name} has no {attribute!r}: "
            f"the installed {spec.plugin} does not fit, {installing.upgrade(spec.plugin)}"
        ) from error
    if not (isinstance(target, type) and issubclass(target, NodeBehaviour)):
        raise ImplementationMissingError(
            f"{spec.full_name}: {spec.behaviour} is {target!r}, expected a subclass of "
            "joshua.node.behaviour.NodeBehaviour"
        )
    return target
