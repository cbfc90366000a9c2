"""The command line reference, made from the argument parser."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from joshua.cli.exit_codes import ExitCode
from joshua.cli.parser import build_parser
from joshua.cli.table import usable_commands

from reference.markdown import code, table

HEAD = """# Command line

`joshua --config PATH` checks a file and runs it. Everything else is a subcommand.
"""

# Commands of the libraries that device plugins stand on.
BROUGHT = ("calibrate",)

EXIT_CODES = {
    ExitCode.OK: "finished, or stopped by the user",
    ExitCode.FAILED: "a node failed, or the run ended in error",
    ExitCode.INVALID: "the configuration or the command line is invalid; nothing was started",
    ExitCode.NOT_INSTALLED: "a needed plugin or extra is not installed; nothing was started",
    ExitCode.HARDWARE: "hardware is absent or refused",
    ExitCode.INTERRUPTED: "interrupted before the start",
}


def command_line_page() -> str:
    """Makes the page: the main command, the exit codes, and one section for each subcommand."""
    parser = build_parser(populate=True, further=[c for c in usable_commands() if c.name in BROUGHT])
    lines = [HEAD, "## joshua --config", "", *options_table(parser), "## Exit codes", ""]
    lines += table(("Code", "Meaning"), ((str(int(number)), text) for number, text in EXIT_CODES.items()))
    for name, sub in subparsers(parser):
        lines += command_section(f"joshua {name}", sub, level=2)
    return "\n".join(lines)


def command_section(name: str, parser: argparse.ArgumentParser, level: int) -> Iterator[str]:
    """Yields the lines of one command and of the commands below it."""
    usage = " ".join(parser.format_usage().removeprefix("usage:").split())
    description = (parser.description or "").strip()
    yield from (f"{'#' * level} {name}", "", sentence(description), "", "```text", usage, "```", "")
    yield from options_table(parser)
    for inner, sub in subparsers(parser):
        yield from command_section(f"{name} {inner}", sub, level + 1)


def subparsers(parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Yields the subcommands of a parser."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from action.choices.items()


def options_table(parser: argparse.ArgumentParser) -> list[str]:
    """Makes the table of a command's arguments and options; nothing where it has none."""
    rows = [
        (argument_text(action), sentence(action.help or ""))
        for action in parser._actions
        if action.help is not argparse.SUPPRESS
        and not isinstance(action, (argparse._HelpAction, argparse._SubParsersAction))
    ]
    return table(("Argument", "Meaning"), rows) if rows else []


def argument_text(action: argparse.Action) -> str:
    """Words an argument or option with the name of its value."""
    value = action.metavar or ("" if action.nargs == 0 else action.dest.upper())
    if action.choices is not None and not action.metavar:
        value = "{" + ",".join(map(str, action.choices)) + "}"
    if not action.option_strings:
        return code(str(value or action.dest))
    return code(f"{', '.join(action.option_strings)} {value}".strip())


def sentence(text: str) -> str:
    """Makes a sentence of a line of help."""
    text = text.strip().replace("%%", "%")
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", ":")) or not text else ".")
