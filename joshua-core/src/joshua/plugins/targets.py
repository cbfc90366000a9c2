"""Import strings of specs: loading them, and a deep check of each one."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua.plan.facts import ServiceFacts
    from joshua.plugins.specs import PluginSpec

#: Import strings of a spec, with their required base classes; "" for any.
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


#: Constructor arguments of the implementations, by base class.
_MADE_WITH = {
    "joshua.devices.actuator:Actuator": ("settings", "context"),
    "joshua.devices.sensor:Sensor": ("settings", "context"),
    "joshua.models.model:Model": ("settings", "joints", "features"),
    "joshua.node.behaviour:NodeBehaviour": ("context",),
    "joshua.features.episodes:EpisodeWriter": ("layout",),
    "joshua.plugins.emulator:DeviceEmulator": ("device",),
    "joshua.transport.transports:Transport": ("settings",),
}


class TargetError(Exception):
    """An import string cannot be loaded. The message names it and the reason.

    A node that fails with it ends with the exit code of a missing plugin.
    """

    exit_code = 3


def load_target(import_string: str) -> Any:
    """Load an import string such as ``acme.gripper:Gripper``. Raises TargetError."""
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
    """Make the ``gymnasium.vector.VectorEnv`` of a plan, seeded if the file has a seed.

    Args:
        facts: of the trainer's node; num_envs: number of environments, 0 for the file's.

    Raises:
        ValueError: the plan has no environment; TargetError: its plugin cannot be imported.
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
    """Import everything that a spec names and check it without a device. Returns the problems.

    Checks base classes, missing methods, the constructor, and the settings against the block. It imports
    drivers, so only the launch and ``joshua plugins --check`` call it, never a listing or a validation. A
    spec with a custom behaviour may use any implementation class.
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
        found = []
        if base_string and not _derives(target, base_string):
            found = [f"{import_string} is {_describe(target)}, not a class derived from {base_string}"]
        elif base_string and isinstance(target, type):
            found = _unfinished(target, _MADE_WITH.get(base_string, ()))
        if role == "settings" and not found:
            found = _unlike_the_block(target, spec)
        problems += [f"{role}: {text}" for text in found]
    return problems


def _unfinished(target: type, made_with: tuple[str, ...]) -> list[str]:
    """Find missing abstract methods, and a constructor that the runtime cannot call."""
    import inspect

    missing = sorted(getattr(target, "__abstractmethods__", ()))
    problems = [f"{target.__name__} does not implement {', '.join(missing)}"] if missing else []
    if made_with:
        try:
            inspect.signature(target).bind(*made_with)
        except TypeError as error:
            call = f"{target.__name__}({', '.join(made_with)})"
            problems.append(f"{target.__name__} cannot be constructed as {call}: {error}")
    return problems


def _unlike_the_block(settings_type: Any, spec: PluginSpec) -> list[str]:
    """Find settings that read a missing field of the block, and settings of actuators without joints."""
    from joshua.plugins.hints import block_message
    from joshua.plugins.settings import ActuatorSettings, BlockSettings, source_of

    problems = []
    if spec.kind == "actuator" and not issubclass(settings_type, ActuatorSettings):
        problems.append(f"{settings_type.__name__} does not derive from joshua.api.ActuatorSettings")
    elif spec.kind == "actuator" and settings_type.joints is ActuatorSettings.joints:
        problems.append(f"{settings_type.__name__} names no joints: override joints")
    message = block_message(spec.block)
    own = [base for base in settings_type.__mro__ if base is not BlockSettings and "si_values" in vars(base)]
    fields = {} if own or message is None else settings_type.model_fields  # else it makes its values itself
    for name, field in fields.items():
        path, inner = source_of(name, field).path, message
        if path == name and not field.is_required():
            continue  # set by programs, not by the block
        for part in path.split("."):
            known = inner.fields_by_name if inner is not None else {}
            if part not in known:
                reads = f"{settings_type.__name__}.{name} reads the field {path}"
                allowed = ", ".join(known) or "none"
                problems.append(f"{reads}, which {message.full_name} does not have; fields there: {allowed}")
                break
            inner = known[part].message_type
    return problems


def _derives(target: object, base_string: str) -> bool:
    """Whether a class derives from another, by name, because its bases are already imported."""
    bases = target.__mro__ if isinstance(target, type) else ()
    return base_string in (f"{base.__module__}:{base.__qualname__}" for base in bases)


def _describe(target: object) -> str:
    if not isinstance(target, type):
        return f"a {type(target).__name__}"
    bases = ", ".join(f"{base.__module__}.{base.__qualname__}" for base in target.__bases__)
    return f"a class derived from {bases}"
