"""The commands of ``joshua``: those of the core in a table, those of plugins by their entry points.

A command of a plugin is an entry point of the group ``joshua.commands``: its name is the command, its value a
module like those in ``joshua.cli.commands``, with a ``SUMMARY``. Only a word that is no command of the core
is searched there.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass

ENTRY_POINT_GROUP = "joshua.commands"


@dataclass(frozen=True, eq=False, repr=False)
class Command:
    """One row of the command table. The module is imported only if the command is used.

    Attributes:
        summary: one line of help; distribution: of the command. Either is "" if unknown.
    """

    name: str
    module: str
    summary: str = ""
    distribution: str = ""


COMMANDS = tuple(
    Command(name, f"joshua.cli.commands.{name.replace('-', '_')}", summary)
    for name, summary in (
        ("presets", "list the presets, or print one"),
        ("new", "copy a preset to a new file"),
        ("new-plugin", "write a plugin with a working driver to start from"),
        ("plugins", "list the plugins, what each provides, and the problems of each"),
        ("status", "show the systems that run on this machine"),
        ("stop", "stop a running system"),
        ("estop", "disable the torque of every actuator until the e-stop is released"),
        ("resume", "re-enable the torque of an actuator that stopped"),
        ("call", "call a verb of a node in a running system, or list the verbs"),
        ("fmt", "format configuration files"),
        ("explain", "explain a block, field, value or diagnostic code"),
        ("doctor", "check this machine and its devices, and say how to solve each problem"),
        ("emulate", "run only the emulators of a file"),
        ("plan", "show the nodes that a file starts, without starting them"),
    )
)


class PluginCommandError(Exception):
    """A command of a plugin cannot be used. The message says which, why, and what to do."""


def plugin_commands() -> list[Command]:
    """List the commands of installed plugins by name, without importing them."""
    from importlib import metadata

    from joshua.plugins.discovery import normalise

    found = {  # a folder that occurs twice in the path lists them twice
        (point.name, normalise(point.dist.name) if point.dist else "(unknown)", point.value)
        for point in metadata.entry_points(group=ENTRY_POINT_GROUP)
    }
    return [Command(name, module, distribution=owner) for name, owner, module in sorted(found)]


def find_command(name: str) -> Command | None:
    """Find the command of that name from a plugin; None if there is none.

    Raises:
        PluginCommandError: two plugins provide it, or it cannot be imported, or its plugin is not installed.
    """
    from joshua.plan import installing
    from joshua.plugins import hints

    commands = [command for command in plugin_commands() if command.name == name]
    if len(commands) > 1:
        owners = " and ".join(command.distribution for command in commands)
        raise PluginCommandError(f"{owners} both bring the command {name}. Uninstall one of them")
    if commands:
        return load_command(commands[0])
    if distribution := hints.stated().commands.get(name):
        raise PluginCommandError(f"{name} {installing.requires(distribution)}")
    return None


def usable_commands() -> list[Command]:
    """Load every command of an installed plugin, except broken ones and those with a name of the core."""
    taken = {command.name for command in COMMANDS}
    usable = []
    for command in plugin_commands():
        if command.name in taken:
            continue
        try:
            usable.append(load_command(command))
        except PluginCommandError:
            continue  # reported when the command is used
        taken.add(command.name)
    return usable


def commands_by_distribution() -> dict[str, list[str]]:
    """List the commands of each installed plugin."""
    found: dict[str, list[str]] = {}
    for command in plugin_commands():
        found.setdefault(command.distribution, []).append(command.name)
    return found


def load_command(command: Command) -> Command:
    """Import a command's module for its summary. Raises PluginCommandError."""
    try:
        module = importlib.import_module(command.module)
        return Command(command.name, command.module, str(module.SUMMARY), command.distribution)
    except (Exception, SystemExit) as error:
        from joshua.plan import installing

        raise PluginCommandError(
            f"the command {command.name} of {command.distribution} cannot be loaded "
            f"({type(error).__name__}: {error}): {installing.reinstall(command.distribution)}"
        ) from error
