"""``joshua presets``: list the configurations that ship with the core, or print one."""

from __future__ import annotations

import shutil
import sys
import textwrap
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable

    from joshua.cli.presets import Preset

# Order of the operation modes in the schema.
MODES = ("TELEOPERATE", "INFERENCE", "TRAINING", "CALIBRATION", "TEST", "DATA_STORE", "SIMULATION")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of ``joshua presets``."""
    parser.add_argument("name", nargs="?", metavar="PRESET", help="print this preset's file")


def run(arguments: argparse.Namespace) -> int:
    """Prints the list of presets, or the file of one."""
    from joshua.cli.presets import preset_names, read_preset, read_presets

    if not arguments.name:
        width = min(shutil.get_terminal_size().columns, 120)
        sys.stdout.write(listing(read_presets(), width))
        return ExitCode.OK
    if arguments.name not in preset_names():
        sys.stderr.write(unknown_preset("joshua presets", arguments.name, preset_names()))
        return ExitCode.INVALID
    sys.stdout.write(read_preset(arguments.name).text)
    return ExitCode.OK


def listing(presets: Iterable[Preset], width: int) -> str:
    """Prints presets for people, grouped by mode: name, summary, and the plugins that each needs.

    Args:
        width: columns of the terminal.
    """
    presets = list(presets)
    column = max(len(preset.name) for preset in presets) + 4
    lines = []
    for mode in MODES:
        lines.append(f"MODE_{mode}")
        for preset in presets:
            if preset.mode == mode:
                lines += _entry(preset, column, max(width, column + 30))
        lines.append("")
    lines.append("Copy one to change it:  joshua new my_robot --from PRESET")
    return "\n".join(lines) + "\n"


def _entry(preset: Preset, column: int, width: int) -> list[str]:
    plugins = f"needs {preset.plugins}" if preset.plugins else "needs no plugin"
    wrapped = [
        line
        for text in (preset.summary, plugins)
        for line in textwrap.wrap(text, width - column, break_on_hyphens=False)
    ]
    first = f"  {preset.name}".ljust(column) + wrapped[0]
    return [first, *(" " * column + line for line in wrapped[1:])]


def unknown_preset(command: str, name: str, names: list[str]) -> str:
    """Words the error that there is no preset of a name, the nearest names first."""
    import difflib

    nearest = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    lines = [f"{command}: there is no preset {name!r}"]
    if nearest:
        lines.append(f"  nearest: {', '.join(nearest)}")
    lines.append("  see: joshua presets")
    return "\n".join(lines) + "\n"
