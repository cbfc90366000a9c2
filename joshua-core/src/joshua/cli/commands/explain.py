"""``joshua explain``: print the documentation of a block, field, value or diagnostic code."""

from __future__ import annotations

import shutil
import sys
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse

    from joshua.textproto.plugin_types import PluginTypes

_WIDEST = 110
_NARROWEST = 50


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of ``joshua explain``."""
    parser.add_argument(
        "name",
        nargs="?",
        metavar="NAME",
        help="field path such as robot.actions.node.qos, message, enum, enum value or diagnostic code; "
        "without it the blocks of a file are listed",
    )


def run(arguments: argparse.Namespace) -> int:
    """Prints one page; exit code 2 with the nearest names where the name is unknown."""
    from joshua.config.explain import Catalogue, explain, overview

    width = max(_NARROWEST, min(shutil.get_terminal_size().columns, _WIDEST))
    if not arguments.name:
        sys.stdout.write(overview(width))
        return ExitCode.OK
    catalogue = Catalogue(_plugin_types)
    found = catalogue.find(arguments.name)
    if found:
        sys.stdout.write(explain(found, catalogue, width))
        return ExitCode.OK
    near = catalogue.suggestions(arguments.name)
    sys.stderr.write(f"joshua explain: there is nothing named {arguments.name!r}\n")
    if near:
        sys.stderr.write(f"  nearest: {', '.join(near)}\n")
    sys.stderr.write("  do:      run `joshua explain` for the blocks of a file\n")
    return ExitCode.INVALID


def _plugin_types() -> PluginTypes:
    from joshua.plugins import load_registry
    from joshua.textproto.plugin_types import PluginTypes

    return PluginTypes(load_registry().message_modules())
