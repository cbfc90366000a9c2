"""``joshua presets``: list the configurations that come with the core, or print one."""

from __future__ import annotations

import re
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
    """Add the options of ``joshua presets``."""
    parser.add_argument("name", nargs="?", metavar="PRESET", help="print the file of this preset")


def run(arguments: argparse.Namespace) -> int:
    """Print the list of presets, or the file of one."""
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
    """Lay out presets by mode: name, summary, and the plugins that each needs, in a width of columns."""
    presets = list(presets)
    column = max(len(preset.name) for preset in presets) + 4
    width = max(width, column + 30) - column
    lines = []
    for mode in MODES:
        lines.append(f"MODE_{mode}")
        for preset in presets:
            if preset.mode == mode:
                texts = [preset.summary, needs(preset)]
                first, *rest = [
                    line for text in texts for line in textwrap.wrap(text, width, break_on_hyphens=False)
                ]
                lines += [f"  {preset.name}".ljust(column) + first, *(" " * column + line for line in rest)]
        lines.append("")
    lines.append("Copy one to change it:  joshua new my_robot --from PRESET")
    return "\n".join(lines) + "\n"


def needs(preset: Preset) -> str:
    """What a preset needs, and what of it is not installed."""
    from importlib import metadata

    if not preset.plugins:
        return "needs no plugin"
    names = dict.fromkeys(re.findall(r"joshua-[a-z0-9-]+", preset.plugins))
    missing = [name for name in names if not any(metadata.distributions(name=name))]
    state = f"not installed: {', '.join(missing)}" if missing else "installed"
    return f"needs {preset.plugins} ({state})"


def unknown_preset(command: str, name: str, names: list[str]) -> str:
    """Return the error that no preset has a name, with the nearest names."""
    import difflib

    nearest = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    lines = [f"{command}: no preset is named {name!r}"]
    if nearest:
        lines.append(f"  nearest: {', '.join(nearest)}")
    lines.append("  see: joshua presets")
    return "\n".join(lines) + "\n"
