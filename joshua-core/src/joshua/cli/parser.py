"""The argument parser: lazy subcommands, and errors that name the nearest valid option."""

from __future__ import annotations

import argparse
import importlib
import os
import re
import sys
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn

from joshua.cli import table
from joshua.cli.exit_codes import ExitCode
from joshua.cli.options import add_run_options
from joshua.cli.table import COMMANDS, Command
from joshua.plan.foreign_text import raw

DESCRIPTION = "One text file describes a robot, one command runs it: joshua --config FILE"
EPILOG = """A command that takes a file takes it as FILE or as --config FILE.

exit codes: 0 success, 1 a node failed, 2 invalid configuration or command line,
3 a plugin or extra is not installed, 4 hardware is absent or refused,
130 interrupted before the start

Plugins bring further commands, such as calibrate: joshua plugins lists them."""


class _HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Looks for the width of the terminal without shutil: argparse makes a formatter for each argument."""

    def __init__(self, prog: str, **options: Any) -> None:
        columns = os.environ.get("COLUMNS", "")
        try:
            width = int(columns) if columns.isdecimal() else os.get_terminal_size(sys.stdout.fileno()).columns
        except (OSError, ValueError):
            width = 0
        super().__init__(prog, **{"width": (width or 80) - 2, **options})


class Parser(argparse.ArgumentParser):
    """An argument parser without abbreviations, whose errors suggest the nearest option."""

    arguments: Sequence[str] = ()

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        kwargs.setdefault("allow_abbrev", False)
        kwargs.setdefault("formatter_class", _HelpFormatter)
        super().__init__(*args, **kwargs)

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print help with the colours that argparse gives it."""
        if message:
            raw(file or sys.stderr).write(message)

    def error(self, message: str) -> NoReturn:
        """Print the message with the nearest valid option and exit with 2, or 3 if a plugin is missing."""
        # argparse mistakes the value of a misspelt option for the command and reports that
        options = [word.partition("=")[0] for word in self.arguments if word.startswith("--")]
        unknown = [word for word in options if word not in self._option_string_actions and word != "--"]
        word = message.partition("invalid choice: ")[2].split(" ")[0].strip("'\"")
        if unknown:
            message, word = f"unrecognized arguments: {' '.join(unknown)}", ""
        elif word and any(command.name == word for command in self._plugin_commands()):
            message = f"{word} is a command of a plugin and must be the first argument: {self.prog} {word} …"
            word = ""
        is_command = message.startswith("argument COMMAND:")
        if choice := re.fullmatch(r"argument (.+): invalid choice: (.+) \(choose from (.+)\)", message):
            name, found, choices = choice.groups()
            message = f"there is no command {found}"
            if not is_command:
                word, allowed = "", choices.replace("'", "")
                message = f"{name} is {found}; allowed: {allowed}"
        words = message.partition("unrecognized arguments:")[2].split()
        unrecognized = [word.partition("=")[0] for word in words if word.startswith("-")]
        lines = [f"{self.prog}: error: {message}"]
        lines += [f"  nearest: {hint}" for hint in self._nearest(unrecognized, word)]
        missing = self._missing_plugin(unrecognized)
        lines += [f"  {missing}"] * bool(missing)
        file = next((word for word in self.arguments if word.endswith(".pbtxt")), "")
        if file and is_command:
            import shlex

            lines.append(f"  to run a file: {self.prog} --config {shlex.quote(file)}")
        lines.append(f"  see: {self.prog} --help")
        from joshua.supervisor.tables import Screen

        screen = Screen.of(sys.stderr)
        sys.stderr.writelines(f"{piece}\n" for line in lines for piece in screen.wrap(line, indent=4))
        sys.exit(ExitCode.NOT_INSTALLED if missing else ExitCode.INVALID)

    def commands(self) -> dict[str, Parser]:
        """The parsers of the subcommands by name."""
        groups = [action for action in self._actions if isinstance(action, argparse._SubParsersAction)]
        return {name: parser for group in groups for name, parser in group.choices.items()}

    def takes(self, option: str) -> bool:
        """Whether this command or a subcommand has an option."""
        return option in self._option_string_actions or any(
            sub.takes(option) for sub in self.commands().values()
        )

    def _plugin_commands(self) -> list[Command]:
        """Commands of plugins for an unknown word; a subcommand has none."""
        return [] if isinstance(self, CommandParser) else table.plugin_commands()

    def _missing_plugin(self, unrecognized: Sequence[str]) -> str:
        """The plugin that adds an unknown option to this command, and how to install it; "" for none."""
        for word in unrecognized:
            from joshua.plan import installing
            from joshua.plugins import hints

            option = f"{self.prog.split()[-1]} {word}"
            if distribution := hints.stated().commands.get(option):
                return f"{option} {installing.requires(distribution)}"
        return ""

    def _nearest(self, unrecognized: Sequence[str], word: str) -> list[str]:
        from difflib import get_close_matches

        options = list(self._option_string_actions)
        near = [name for option in unrecognized for name in get_close_matches(option, options, n=1)]
        if not word:
            return near
        names = [*self.commands(), *(command.name for command in self._plugin_commands())]
        return get_close_matches(word, names, n=3, cutoff=0.5)


class CommandParser(Parser):
    """The parser of one subcommand, made at its first use. Then it imports the command's module."""

    command: Command | None = None
    _populated = False

    def __init__(self, **options: Any) -> None:
        self._options = options

    def __getattr__(self, name: str) -> Any:
        """Make the parser when an attribute is read that it does not have yet."""
        options = vars(self).pop("_options", None)
        if options is None:
            raise AttributeError(f"{type(self).__name__} has no attribute {name}")
        super().__init__(**options)
        return getattr(self, name)

    def populate(self) -> None:
        """Add the command's arguments. Idempotent."""
        if self.command is not None and not self._populated:
            self._populated = True
            module = importlib.import_module(self.command.module)
            module.add_arguments(self)
            self.set_defaults(run=module.run)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Populate the parser, then parse. An unknown argument is an error."""
        self.populate()
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown


def build_parser(*, populate: bool = False, further: Sequence[Command] = ()) -> Parser:
    """Make the parser of the whole command line.

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
    """Parse the command line. Exits with 2 if it is invalid."""
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
        refuse_without_effect(parser, arguments, words[first_command + 1 :])
    return parser, arguments


def refuse_without_effect(parser: Parser, arguments: argparse.Namespace, after: Sequence[str]) -> None:
    """Exit with 2 for an option before a command that ignores it there.

    So `joshua --emulate doctor` does not open the real arm by mistake.
    """
    command = arguments.command
    own = parser.commands()[command]
    behind = {word.partition("=")[0] for word in after}
    for option in _options(parser.arguments):
        if not own.takes(option):
            parser.error(f"{option} has no effect on joshua {command}: leave it out")
        if option in behind:
            parser.error(f"{option} is given before and after {command}: write it once, after {command}")
    before = argparse.Namespace()
    parser.parse_known_args(list(parser.arguments), before)
    if before.config not in (None, arguments.config):
        parser.error(f"two files are given, {before.config} and {arguments.config}: leave one out")


def _options(words: Sequence[str]) -> Iterator[str]:
    yield from (word.partition("=")[0] for word in words if word.startswith("--"))


def commands_of_plugins(name: str) -> list[Command]:
    """Find the command of that name from a plugin, if any. Exits with 3 if it cannot be used."""
    try:
        command = table.find_command(name)
    except table.PluginCommandError as error:
        sys.stderr.write(f"joshua: error: {error}\n")
        sys.exit(ExitCode.NOT_INSTALLED)
    return [] if command is None else [command]
