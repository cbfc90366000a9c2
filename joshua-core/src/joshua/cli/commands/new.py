"""``joshua new``: copy a preset into the current folder under a new name."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse

    from joshua.cli.presets import Preset

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
_GENERAL = re.compile(r"^general \{.*?^\}", re.DOTALL | re.MULTILINE)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua new``."""
    parser.add_argument("name", metavar="NAME", help="name of the copy: NAME.pbtxt in the current folder")
    parser.add_argument("--from", dest="preset", metavar="PRESET", help="the preset to copy")
    parser.add_argument(
        "--id", metavar="ID", help="general.id of the copy, shared by the files of one robot; default: NAME"
    )
    parser.add_argument("--force", action="store_true", help="replace the file if it exists")


def run(arguments: argparse.Namespace) -> int:
    """Write the copy and say what to do next."""
    from joshua.cli.commands.presets import unknown_preset
    from joshua.cli.presets import SUFFIX, preset_names, read_preset

    if not arguments.preset:
        return _refuse(
            "no preset given",
            f"name one: joshua new {arguments.name} --from test_mock_hardware",
            "see: joshua presets",
        )
    name = arguments.name.removesuffix(SUFFIX)
    robot_id = arguments.id or name
    for text in (name, robot_id):
        if not _NAME.fullmatch(text):
            return _refuse(
                f"{text!r} is not a valid name",
                "allowed: letters, digits, _ and -, a letter or digit first; no folder",
            )
    preset_name = arguments.preset.removesuffix(SUFFIX)
    if preset_name not in preset_names():
        sys.stderr.write(unknown_preset("joshua new", preset_name, preset_names()))
        return ExitCode.INVALID
    target = Path(f"{name}{SUFFIX}")
    preset = read_preset(preset_name)
    try:
        with target.open("w" if arguments.force else "x", encoding="utf-8") as file:
            file.write(copy_of(preset, name, robot_id))
    except FileExistsError:
        return _refuse(
            f"{target} exists already, so nothing was written",
            "choose another name, or replace the file with --force",
        )
    except OSError as error:
        return _refuse(f"{target} cannot be written: {error.strerror}", "check the folder's permissions")
    sys.stdout.write(next_steps(preset, target))
    return ExitCode.OK


def copy_of(preset: Preset, name: str, robot_id: str) -> str:
    """Return a preset's text with ``general.name``, ``general.id`` and its own commands replaced."""
    text = preset.text.replace(f"--config {preset.name}.pbtxt", f"--config {name}.pbtxt")

    def rename(match: re.Match[str]) -> str:
        block = re.sub(r'^(\s*name:) ".*"$', rf'\1 "{name}"', match.group(), flags=re.MULTILINE)
        return re.sub(r'^(\s*id:) ".*"$', rf'\1 "{robot_id}"', block, flags=re.MULTILINE)

    return _GENERAL.sub(rename, text, count=1)


def next_steps(preset: Preset, target: Path) -> str:
    """Return what to change in the copy and which commands come next."""
    from joshua.cli.commands.presets import needs

    lines = [f"{target} written, from the preset {preset.name}"]
    rows = preset.sections.get("Change", ())
    lines += [f"  {'change:' if index == 0 else '':8}{row}" for index, row in enumerate(rows)]
    if preset.plugins:
        lines.append(f"  needs:  {needs(preset).removeprefix('needs ')}")
    lines.append(f"  check:  joshua --config {target} --validate-only")
    lines.append(f"  run:    joshua --config {target}")
    return "\n".join(lines) + "\n"


def _refuse(problem: str, *hints: str) -> int:
    sys.stderr.write("\n".join([f"joshua new: {problem}", *(f"  {hint}" for hint in hints)]) + "\n")
    return ExitCode.INVALID
