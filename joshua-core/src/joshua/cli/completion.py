"""Shell completion: a script for bash, zsh or fish, made from the argument parser.

Nothing here is imported unless a script is asked for, and a shell that has the script starts no Python.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

#: Names of values that are paths of files.
FILE_METAVARS = ("PATH", "FILE")


def completion_script(parser: argparse.ArgumentParser, shell: str) -> str:
    """Makes the completion script of a shell.

    Args:
        parser: the parser of the whole command line, every subcommand populated; it is changed.
        shell: ``bash``, ``zsh`` or ``fish``.
    """
    import shtab

    from joshua.cli.presets import preset_names

    for action in actions(parser):
        if action.metavar in FILE_METAVARS:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
        elif action.metavar == "PRESET":
            action.choices = preset_names()
    return str(shtab.complete(parser, shell=shell))


def actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yields every option and argument of a parser and of its subcommands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for sub in dict.fromkeys(action.choices.values()):
                yield from actions(sub)
