"""Commands that plugins bring: entry points of the group ``joshua.commands``, read as metadata.

The name of the entry point is the command, its value the module, which is like those in
``joshua.cli.commands``. Nothing is looked up unless a word on the command line is no command of the core.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from importlib import metadata

from joshua.cli.table import COMMANDS, Command
from joshua.plan import installing
from joshua.plugins import hints
from joshua.plugins.discovery import normalise

ENTRY_POINT_GROUP = "joshua.commands"


@dataclass(frozen=True)
class PluginCommand:
    """A command of a plugin: its name, its module, and the distribution that brings it."""

    name: str
    module: str
    distribution: str


class PluginCommandError(Exception):
    """A command of a plugin cannot be used; the message says which, why, and what to do."""


def plugin_commands() -> list[PluginCommand]:
    """Lists the commands of installed plugins by name, without importing them."""
    found = {
        PluginCommand(point.name, point.value, normalise(point.dist.name) if point.dist else "(unknown)")
        for point in metadata.entry_points(group=ENTRY_POINT_GROUP)
    }
    return sorted(found, key=lambda command: (command.name, command.distribution))


def find_command(name: str) -> Command | None:
    """The command of that name that a plugin brings; None where there is none.

    Raises:
        PluginCommandError: two plugins bring it, its module cannot be imported, or the plugin that is known
            to bring it is not installed.
    """
    commands = [command for command in plugin_commands() if command.name == name]
    if len(commands) > 1:
        owners = " and ".join(command.distribution for command in commands)
        raise PluginCommandError(f"{owners} both bring the command {name}: uninstall one of them")
    if commands:
        return load_command(commands[0])
    if distribution := hints.stated().commands.get(name):
        raise PluginCommandError(
            f"{name} needs the plugin {distribution}: {installing.install(distribution)}"
        )
    return None


def usable_commands() -> list[Command]:
    """Every command of an installed plugin that can be loaded and does not take a name of the core."""
    taken = {command.name for command in COMMANDS}
    usable = []
    for command in plugin_commands():
        if command.name in taken:
            continue
        try:
            usable.append(load_command(command))
        except PluginCommandError:
            continue  # whoever uses it reads why
        taken.add(command.name)
    return usable


def commands_by_distribution() -> dict[str, list[str]]:
    """Names of the commands that each installed plugin brings."""
    found: dict[str, list[str]] = {}
    for command in plugin_commands():
        found.setdefault(command.distribution, []).append(command.name)
    return found


def load_command(command: PluginCommand) -> Command:
    """Imports a command's module for its summary. Raises PluginCommandError."""
    try:
        module = importlib.import_module(command.module)
        return Command(command.name, command.module, str(module.SUMMARY))
    except (Exception, SystemExit) as error:
        raise PluginCommandError(
            f"the command {command.name} of {command.distribution} cannot be loaded "
            f"({type(error).__name__}: {error}): {installing.reinstall(command.distribution)}"
        ) from error
