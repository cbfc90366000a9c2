"""The commands of ``joshua``: name, module and one line of help, so that help imports none of them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Command:
    """One row of the command table; the module is imported only when the command is used."""

    name: str
    module: str
    summary: str


COMMANDS: tuple[Command, ...] = (
    Command("presets", "joshua.cli.commands.presets", "list the presets, or print one"),
    Command("new", "joshua.cli.commands.new", "copy a preset, to make it your own"),
    Command(
        "plugins",
        "joshua.cli.commands.plugins",
        "list the plugins, what each provides, and what is wrong with one",
    ),
    Command("status", "joshua.cli.commands.status", "show the systems that run on this machine"),
    Command("stop", "joshua.cli.commands.stop", "stop the systems that run on this machine"),
    Command("estop", "joshua.cli.commands.estop", "take the torque off every actuator, and keep it off"),
    Command("resume", "joshua.cli.commands.resume", "give torque again to an actuator that stopped"),
    Command(
        "call",
        "joshua.cli.commands.call",
        "ask a node of a running system for something, or list what can be asked",
    ),
    Command("fmt", "joshua.cli.commands.fmt", "give configuration files one layout"),
    Command("explain", "joshua.cli.commands.explain", "explain a block, field, value or diagnostic code"),
    Command(
        "doctor",
        "joshua.cli.commands.doctor",
        "look at this machine and its devices: what is wrong, and what to do about it",
    ),
    Command("emulate", "joshua.cli.commands.emulate", "run the emulators of a file alone"),
    Command("topic", "joshua.cli.commands.topic", "list, watch and publish topics of a running graph"),
    Command("node", "joshua.cli.commands.node", "list the nodes of a running graph"),
    Command("plan", "joshua.cli.commands.plan", "show what a file would start, and start nothing"),
)
