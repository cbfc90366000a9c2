"""``joshua presets``: list the configurations that come with the core, or print one."""

from __future__ import annotations

import shutil
import sys
import textwrap
from functools import cache
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
    from joshua.plan import installing

    presets = list(presets)
    column = max(len(preset.name) for preset in presets) + 4
    width = max(width, column + 30)
    lines = []
    for mode in MODES:
        lines.append(f"MODE_{mode}")
        for preset in presets:
            if preset.mode == mode:
                texts = [preset.summary, needs(preset)]
                first, *rest = [line for text in texts for line in _wrapped(text, width - column)]
                lines += [f"  {preset.name}".ljust(column) + first, *(" " * column + line for line in rest)]
        lines.append("")
    missing = dict.fromkeys(name for preset in presets for name in preset.required if not is_usable(name))
    ready = sum(all(map(is_usable, preset.required)) and has_extras(preset) for preset in presets)
    lines += _wrapped(
        f"{ready} of {len(presets)} presets can run with the plugins that are installed.", width
    )
    for hint in installing.hints(missing):  # a command is not wrapped
        lines += [hint] if hint.startswith("install") else _wrapped(hint, width)
    lines += _wrapped("Copy one to change it:  joshua new my_robot --from PRESET", width)
    return "\n".join(lines) + "\n"


def _wrapped(text: str, width: int) -> list[str]:
    return textwrap.wrap(text, width, break_on_hyphens=False)


def needs(preset: Preset) -> str:
    """Requirements of a preset, and whether they are installed or can be installed."""
    from joshua.plan import installing

    missing = [name for name in preset.required if not is_usable(name)]
    absent = [name for name in missing if not installing.is_offered(name)]
    state = "installed"
    if missing:
        state = f"cannot run, not installed: {', '.join(missing)}"
    if absent:
        state = f"cannot run, not available yet: {', '.join(absent)}"
    if not missing and not has_extras(preset):
        state = "installed, but not all that they need: see its header"
    return f"needs {preset.plugins} ({state})"


@cache
def _usable() -> frozenset[str]:
    from joshua.plugins import PluginStatus, load_registry

    rows = load_registry().rows()
    return frozenset(row.distribution for row in rows if row.status is PluginStatus.OK)


def is_usable(distribution: str) -> bool:
    """Whether the plugin of a distribution is installed and works."""
    return distribution in _usable()


def has_extras(preset: Preset) -> bool:
    """Whether what the extras of its plugins bring is installed beside them."""
    from joshua.plan import installing

    return all(installing.has_extra(*extra) for extra in preset.extras)


def unknown_preset(command: str, name: str, names: list[str]) -> str:
    """Return the error for an unknown preset, with the nearest names."""
    import difflib

    nearest = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    lines = [f"{command}: no preset is named {name!r}"]
    if nearest:
        lines.append(f"  nearest: {', '.join(nearest)}")
    lines.append("  see: joshua presets")
    return "\n".join(lines) + "\n"
