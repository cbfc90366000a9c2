"""The argument parser: lazy subcommands, and errors that name the nearest valid option."""

from __future__ import annotations

import argparse
import difflib
import importlib
import shlex
import sys
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn

from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import RUN_ONLY, RUN_OR_PLAN, add_run_options
from joshua.cli.table import COMMANDS, Command

DESCRIPTION = "One text file describes a robot and one command runs it: joshua --config robot.pbtxt"
EPILOG = """exit codes: 0 good order, 1 a node failed, 2 invalid configuration or command line,
3 a plugin or extra is missing, 4 hardware is absent or refused, 130 interrupted before start

plugins bring further commands, such as calibrate: joshua plugins lists them"""


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors suggest the nearest option, and whose abbreviations are off."""

    arguments: Sequence[str] = ()

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        kwargs.setdefault("allow_abbrev", False)
        kwargs.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        super().__init__(*args, **kwargs)

    def error(self, message: str) -> NoReturn:
        """Prints the message with the nearest valid option and ends with exit code 2, or 3."""
        unknown = self._unknown_options()
        if unknown:
            message = f"unrecognized arguments: {' '.join(unknown)}"
        elif late := self._late_command(message):
            message = f"{late} is a command of a plugin and stands before all options: {self.prog} {late} …"
        lines = [f"{self.prog}: error: {message}"]
        lines += [f"  nearest: {hint}" for hint in self._nearest(message)]
        if missing := self._missing_plugin(message):
            lines.append(f"  {missing}")
        if message.startswith("argument COMMAND:") and (file := self._file()):
            lines.append(f"  to run a file: {self.prog} --config {shlex.quote(file)}")
        lines.append(f"  see: {self.prog} --help")
        sys.stderr.write("\n".join(lines) + "\n")
        sys.exit(ExitCode.NOT_INSTALLED if missing else ExitCode.INVALID)

    def _missing_plugin(self, message: str) -> str:
        """Which plugin brings an unknown option to this command, and how to install it; "" for none."""
        words = [word for word in message.partition("unrecognized arguments:")[2].split() if word[0] == "-"]
        if not words:
            return ""
        from joshua.plan import installing
        from joshua.plugins import hints

        options = [f"{self.prog.split()[-1]} {word.partition('=')[0]}" for word in words]
        brings = {option: hints.stated().commands.get(option, "") for option in options}
        found = [
            f"{option} needs the plugin {distribution}: {installing.install(distribution)}"
            for option, distribution in brings.items()
            if distribution
        ]
        return found[0] if found else ""

    def _file(self) -> str:
        """The configuration that somebody wrote where a command belongs; "" for none."""
        return next((word for word in self.arguments if word.endswith(".pbtxt")), "")

    def _late_command(self, message: str) -> str:
        """The command of a plugin that stands behind an option, where none is looked for; "" for none."""
        word = _invalid_choice(message)
        if not word or isinstance(self, CommandParser):
            return ""
        from joshua.cli.plugin_commands import plugin_commands

        return word if any(command.name == word for command in plugin_commands()) else ""

    def _unknown_options(self) -> list[str]:
        # argparse takes the value of a misspelt option for the command and complains about that.
        known = self._option_string_actions
        words = [word.partition("=")[0] for word in self.arguments]
        return [word for word in words if word.startswith("--") and word not in known and word != "--"]

    def _nearest(self, message: str) -> list[str]:
        options = [option for action in self._actions for option in action.option_strings]
        if message.startswith("unrecognized arguments:"):
            words = message.partition(":")[2].split()
            unknown = [word.partition("=")[0] for word in words if word.startswith("-")]
            return [near for word in unknown for near in difflib.get_close_matches(word, options, n=1)]
        if word := _invalid_choice(message):
            names = [
                name
                for action in self._actions
                if isinstance(action, argparse._SubParsersAction)
                for name in action.choices
            ]
            if not isinstance(self, CommandParser):
                from joshua.cli.plugin_commands import plugin_commands

                names += [command.name for command in plugin_commands()]
            return difflib.get_close_matches(word, names, n=3, cutoff=0.5)
        return []


def _invalid_choice(message: str) -> str:
    """The word that argparse takes for no choice; "" where it says something else."""
    return message.partition("invalid choice: ")[2].split(" ")[0].strip("'\"")


class CommandParser(Parser):
    """The parser of one subcommand; it imports the command's module when it is first used."""

    command: Command | None = None
    _populated = False

    def populate(self) -> None:
        """Adds the command's arguments; a second call does nothing."""
        if self.command is not None and not self._populated:
            self._populated = True
            module = importlib.import_module(self.command.module)
            module.add_arguments(self)
            self.set_defaults(run=module.run)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Populates the parser, then parses; what it does not know nobody knows."""
        self.populate()
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown


def build_parser(*, populate: bool = False, further: Sequence[Command] = ()) -> Parser:
    """Makes the parser of the whole command line.

    Args:
        populate: import every command, as completion and the reference pages need.
        further: commands of plugins.
    """
    parser = Parser(prog="joshua", description=DESCRIPTION, epilog=EPILOG)
    add_run_options(parser)
    commands = parser.add_subparsers(
        dest="command", title="commands", metavar="COMMAND", parser_class=CommandParser
    )
    for command in (*COMMANDS, *further):
        sub = commands.add_parser(command.name, help=command.summary, description=command.summary)
        sub.command = command
        if populate:
            sub.populate()
    return parser


def parse(argv: Sequence[str] | None) -> tuple[Parser, argparse.Namespace]:
    """Parses the command line; ends with exit code 2 when it is invalid."""
    words = list(sys.argv[1:] if argv is None else argv)
    names = {command.name for command in COMMANDS}
    further: list[Command] = []
    if words and not words[0].startswith("-") and words[0] not in names:
        further = commands_of_plugins(words[0])
        names |= {command.name for command in further}
    parser = build_parser(further=further)
    first_command = next((index for index, word in enumerate(words) if word in names), len(words))
    parser.arguments = words[:first_command]
    arguments = parser.parse_args(words)
    if arguments.command:
        refuse_without_effect(parser, arguments.command)
    return parser, arguments


def refuse_without_effect(parser: Parser, command: str) -> None:
    """Ends with exit code 2 for an option of a run before a command, which would not see it there.

    So `joshua --emulate calibrate` does not open the real arm.
    """
    known = RUN_ONLY if command == "plan" else (*RUN_ONLY, *RUN_OR_PLAN)
    options = [word.partition("=")[0] for word in parser.arguments]
    for option in options:
        if option in known:
            own = next(sub for sub in _commands(parser) if sub.prog.split()[-1] == command)
            takes = option in own._option_string_actions
            remedy = f"write joshua {command} {option} …" if takes else f"joshua {command} takes none"
            parser.error(f"{option} before {command} has no effect there: {remedy}")


def _commands(parser: Parser) -> Iterator[Parser]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from action.choices.values()


def commands_of_plugins(name: str) -> list[Command]:
    """The command of that name that a plugin brings, if any; ends with exit code 3 if it cannot be used."""
    from joshua.cli.plugin_commands import PluginCommandError, find_command

    try:
        command = find_command(name)
    except PluginCommandError as error:
        sys.stderr.write(f"joshua: error: {error}\n")
        sys.exit(ExitCode.NOT_INSTALLED)
    return [] if command is None else [command]
