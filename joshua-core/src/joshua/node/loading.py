"""From the import strings of a plan to classes."""

from __future__ import annotations

import importlib

from joshua.node.behaviour import NodeBehaviour
from joshua.node.errors import ImplementationMissingError
from joshua.plan import NodeSpec


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
            f"pip install {spec.plugin}"
        ) from error
    except AttributeError as error:
        raise ImplementationMissingError(
            f"{spec.full_name} needs {spec.behaviour}, but {module_name} has no {attribute!r}: "
            f"the installed {spec.plugin} does not fit, pip install --upgrade {spec.plugin}"
        ) from error
    if not (isinstance(target, type) and issubclass(target, NodeBehaviour)):
        raise ImplementationMissingError(
            f"{spec.full_name}: {spec.behaviour} is {target!r}, expected a subclass of "
            "joshua.node.behaviour.NodeBehaviour"
        )
    return target
