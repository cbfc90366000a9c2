"""``joshua explain``: print the documentation of a block, field, value or diagnostic code."""

from __future__ import annotations

import shutil
import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse

_WIDEST, _NARROWEST = 110, 50


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua explain``."""
    parser.add_argument(
        "name",
        nargs="?",
        default="",
        metavar="NAME",
        help="field path such as robot.actions.node.qos, message, enum, enum value or diagnostic code; "
        "omitted lists the blocks of a file",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print one page; exit code 2 with the nearest names if the name is unknown."""
    width = max(_NARROWEST, min(shutil.get_terminal_size().columns, _WIDEST))
    try:
        sys.stdout.write(explain(arguments.name, width))
    except LookupError as error:
        sys.stderr.write(
            f"joshua explain: {error.args[0]}\n  do:      run `joshua explain` for the blocks of a file\n"
        )
        return ExitCode.INVALID
    return ExitCode.OK


def explain(name: str = "", width: int = 80) -> str:
    """Return the documentation of a block, field, value or diagnostic code; "" lists the blocks of a file.

    Raises:
        LookupError: unknown name. The message lists the nearest.
    """
    from joshua.config.explain import Catalogue, overview
    from joshua.config.explain import explain as page
    from joshua.plugins import load_registry
    from joshua.textproto.plugin_types import PluginTypes

    if not name:
        return overview(width)
    catalogue = Catalogue(lambda: PluginTypes(load_registry().message_modules()))
    if found := catalogue.find(name):
        return page(found, catalogue, width)
    near = catalogue.suggestions(name)
    raise LookupError(f"nothing is named {name!r}" + (f"\n  nearest: {', '.join(near)}" if near else ""))
