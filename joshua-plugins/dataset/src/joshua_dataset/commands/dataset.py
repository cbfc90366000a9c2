"""``joshua dataset``: look at, repair and change data sets."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

SUMMARY = "look at and repair data sets"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the actions of ``joshua dataset``."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    info = actions.add_parser("info", help="what a data set holds")
    info.add_argument("folder", type=Path, metavar="FOLDER")
    repair = actions.add_parser("repair", help="complete or discard an episode that a kill left unfinished")
    repair.add_argument("folder", type=Path, metavar="FOLDER")
    repair.add_argument("--cut", action="store_true", help="discard it in place of completing it")


def run(arguments: argparse.Namespace) -> int:
    """Carry the action out. Exit code 0; 1 where the data set cannot be read or repaired."""
    from joshua.features import EpisodeError
    from joshua.tools import ExitCode

    from joshua_dataset.reader import DatasetError

    try:
        if arguments.action == "info":
            sys.stdout.write(description(arguments.folder) + "\n")
        else:
            from joshua_dataset.repair import repair

            sys.stdout.write(repair(arguments.folder, cut=arguments.cut) + "\n")
    except (DatasetError, EpisodeError) as error:
        sys.stderr.write(f"joshua dataset {arguments.action}: {error}\n")
        return ExitCode.FAILED
    return ExitCode.OK


def description(folder: Path) -> str:
    """What a data set holds, as text. Raises DatasetError."""
    from joshua_dataset.reader import Dataset

    found = Dataset.read(folder)
    length_s = found.frames / found.fps
    layout = found.version if found.format == "lerobot" else found.format
    lines = [
        f"{folder}: {found.episodes} episodes, {found.frames} frames, {length_s:.1f} s at {found.fps} Hz",
        f"robot type: {found.robot_type or 'none'}   layout: {layout}   pictures: "
        + (f"{found.pictures} {found.codec}".strip() if found.features.pictures else "none"),
    ]
    for feature in found.features.values():
        shape = " x ".join(map(str, feature.shape))
        unit = f" {feature.unit}" if feature.unit else ""
        names = "" if feature.is_picture or not feature.names else f"   {', '.join(feature.names)}"
        lines.append(f"  {feature.key:<28} {feature.dtype} {shape}{unit}{names}")
    lines += [f"  task {number}: {task}" for number, task in enumerate(found.tasks)]
    lost = {name: 0 for name in found.counters if not name.startswith("worst")}
    for episode in found.episode_list():
        for name in lost:
            lost[name] += episode.counts.get(name, 0)
    if any(lost.values()):
        counts = ", ".join(f"{count} {name}" for name, count in lost.items())
        lines.append(f"  frames that lacked a value: {counts}")
    return "\n".join(lines)
