"""Import strings of specs: loading them, and the deep check that each one is what it claims to be."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua.plan.facts import ServiceFacts
    from joshua.plugins.specs import PluginSpec

#: Import strings of a spec, with what each must derive from; "" for anything.
ROLES = {
    "behaviour": "joshua.node.behaviour:NodeBehaviour",
    "settings": "joshua.plugins.settings:BlockSettings",
    "implementation": "",
    "native": "",
    "safe_stop": "joshua.guardian.safe_stop:SafeStopRequest",
    "bus_tools": "joshua_servo.bus_tools:BusTools",
    "packaged_files": "",
    "prepare": "",
    "sim_adapter": "",
}


class TargetError(Exception):
    """An import string leads nowhere; the message names it and the reason.

    A node that fails with it ends with the exit code of a plugin that is not installed.
    """

    exit_code = 3


def load_target(import_string: str) -> Any:
    """Imports what an import string such as ``acme.gripper:Gripper`` names. Raises TargetError."""
    module_name, _, attribute = import_string.partition(":")
    try:
        target: Any = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:
        raise TargetError(f"{import_string} cannot be imported: {type(error).__name__}: {error}") from error
    for name in attribute.split("."):
        try:
            target = getattr(target, name)
        except AttributeError as error:
            raise TargetError(f"{import_string}: {module_name} has no {attribute}") from error
    return target


def make_environment(facts: ServiceFacts, *, num_envs: int = 0) -> Any:
    """Makes the ``gymnasium.vector.VectorEnv`` of a plan, seeded where the file has a seed.

    Args:
        facts: of the trainer's node; num_envs: another number than the file's, 0 for the file's.

    Raises:
        ValueError: the plan has no environment; TargetError: the plugin that offers it cannot be imported.
    """
    chosen = facts.environment
    if chosen is None:
        raise ValueError("the plan has no environment: the file trains on a robot or from a data set")
    return load_target(chosen.make)(
        chosen.environment_id,
        reward_function=chosen.reward_function,
        num_envs=num_envs or chosen.num_envs,
        seed=chosen.seed,
    )


def check_targets(spec: PluginSpec) -> list[str]:
    """Imports everything that a spec names and checks the base classes; lists what is wrong.

    This imports drivers, so it belongs to the launch and to ``joshua plugins --check``, never to a
    listing or a validation. What has a behaviour of its own may use any implementation class.
    """
    own_base = "" if getattr(spec, "behaviour", "") else spec.base
    problems: list[str] = []
    for role, base in ROLES.items():
        import_string = getattr(spec, role, "")
        if not import_string:
            continue
        base_string = own_base if role in ("implementation", "native") else base
        try:
            target = load_target(import_string)
        except TargetError as error:
            problems.append(f"{role}: {error}")
            continue
        if base_string and not _derives(target, base_string):
            problems.append(
                f"{role}: {import_string} is {_describe(target)}, not a class derived from {base_string}"
            )
    return problems


def _derives(target: object, base_string: str) -> bool:
    """Whether a class derives from another, by name: what it derives from has been imported with it."""
    bases = target.__mro__ if isinstance(target, type) else ()
    return base_string in (f"{base.__module__}:{base.__qualname__}" for base in bases)


def _describe(target: object) -> str:
    if not isinstance(target, type):
        return f"a {type(target).__name__}"
    bases = ", ".join(f"{base.__module__}.{base.__qualname__}" for base in target.__bases__)
    return f"a class derived from {bases}"
