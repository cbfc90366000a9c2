"""From a node's part of the plan to its driver or model class and settings, in the child process."""

from __future__ import annotations

from typing import Any

from joshua.plan import NodeSpec
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
            f"{spec.full_name}: {error}; install the plugin anew: pip install --force-reinstall {spec.plugin}"
        ) from error
    return implementation, settings_type.model_validate(spec.settings) if settings_type else None
