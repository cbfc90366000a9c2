"""``joshua find-cameras``: list the cameras of this machine with their formats and stable names."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import argparse

    from joshua_camera.survey import FoundCamera

SUMMARY = "list the cameras of this machine, save pictures, and write stable names into a file"

NOTHING = """no camera was found

Plug one in. If it is plugged in already:
  - if lsusb does not show it, try another cable or socket
  - in a container, pass the device on: docker run --device /dev/video0
  - a phone or a network camera needs no device, but needs its address in the file:
    source: "http://192.168.1.7:8080/video"
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua find-cameras``."""
    import argparse

    parser.add_argument(
        "--save",
        metavar="FOLDER",
        type=Path,
        help="save a picture of each camera in this folder",
    )
    parser.add_argument(
        "--write",
        dest="write_to",
        metavar="CONFIG",
        default="",
        help="write the stable name of each camera into a configuration",
    )
    parser.add_argument("--node", metavar="NAME", default="", help="with --write: only the node of this name")
    parser.add_argument(
        "--camera", metavar="PATH", default="", help="with --write and --node: the camera of that node"
    )
    parser.add_argument(
        "--show-only", action="store_true", help="with --write: show the change, but write nothing"
    )
    parser.add_argument("--format", choices=("text", "json"), default=argparse.SUPPRESS, help="output format")


def run(arguments: argparse.Namespace) -> int:
    """Print the list. Exit code 0; 4 if there is no camera or none delivered a picture."""
    from joshua.tools import ExitCode

    from joshua_camera.survey import survey

    if not arguments.write_to:
        for option in ("node", "camera", "show_only"):
            if getattr(arguments, option):
                name = f"--{option.replace('_', '-')}"
                sys.stderr.write(
                    f"joshua find-cameras: {name} has no effect without --write CONFIG: add it\n"
                )
                return ExitCode.INVALID
    try:
        if arguments.save is not None:
            arguments.save.mkdir(parents=True, exist_ok=True)
        cameras = survey(arguments.save)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        sys.stderr.write(f"joshua find-cameras: {arguments.save} cannot be written: {reason}\n")
        return ExitCode.INVALID
    if arguments.write_to:
        from joshua_camera.commands.write_source import write

        return write(arguments, cameras)
    if getattr(arguments, "format", "text") == "json":
        sys.stdout.write(json.dumps([as_json(camera) for camera in cameras], indent=2) + "\n")
    else:
        sys.stdout.write("\n".join(map(paragraph, cameras)) if cameras else NOTHING)
    taken = not arguments.save or any(camera.picture for camera in cameras)
    return ExitCode.OK if cameras and taken else ExitCode.HARDWARE


def paragraph(camera: FoundCamera) -> str:
    """Return one camera as text: what to write into the file, then its formats."""
    lines = [f"{camera.path}: {camera.name or 'camera without a name'}"]
    if camera.source:
        lines.append(f'  source: "{camera.source}"')
    else:
        lines.append(f"  device_id: {camera.index}")
    for entry in camera.formats:
        for size in entry.sizes:
            rates = ", ".join(f"{rate:g}" for rate in size.rates_hz)
            lines.append(f"  {entry.code}  {size.width} × {size.height}" + (f"  {rates} Hz" if rates else ""))
    if camera.picture:
        lines.append(f"  picture: {camera.picture}")
    if camera.note:
        lines.append(f"  note: {camera.note}")
    if camera.problem:
        lines.append(f"  problem: {camera.problem}")
    return "\n".join(lines) + "\n"


def as_json(camera: FoundCamera) -> dict[str, Any]:
    """Return one camera as JSON."""
    return {
        "path": camera.path,
        "device_id": camera.index,
        "source": camera.source,
        "note": camera.note,
        "name": camera.name,
        "formats": [
            {
                "pixel_format": entry.code,
                "name": entry.name,
                "sizes": [
                    {"width": size.width, "height": size.height, "rates_hz": list(size.rates_hz)}
                    for size in entry.sizes
                ],
            }
            for entry in camera.formats
        ],
        "picture": camera.picture,
        "problem": camera.problem,
    }
