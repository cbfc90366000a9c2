"""``joshua dataset``: look at, check, repair, change, upload and download data sets."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from joshua_jobs.executor import JobError

from joshua_dataset.commands import making, transfers
from joshua_dataset.commands.options import numbers, one, opened_workers, progress_of_episodes, workers

SUMMARY = "show, check, repair, change, upload and download data sets"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the actions of ``joshua dataset``."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    one(actions, "info", "show what a data set contains")
    check = one(actions, "check", "find gaps, frozen pictures, jumps and inconsistencies")
    check.add_argument("--no-pictures", action="store_true", help="check only the numbers, which is faster")
    workers(check)
    view = one(actions, "view", "write one HTML page with curves, videos and timing, and open it")
    view.add_argument(
        "--episodes", type=numbers, default=(), metavar="LIST", help="such as 0-2 (default: first three)"
    )
    view.add_argument(
        "--output", type=Path, metavar="PAGE", help="file of the page (default: beside the data set)"
    )
    view.add_argument("--no-open", action="store_true", help="only write the page")
    stats = one(actions, "stats", "compute the statistics from the data")
    stats.add_argument(
        "--write", action="store_true", help="replace those of the data set and of its episodes"
    )
    workers(stats)
    repair = one(actions, "repair", "mend what `check` finds, and complete what a kill left unfinished")
    repair.add_argument(
        "--cut", action="store_true", help="discard an unfinished episode instead of completing it"
    )
    repair.add_argument(
        "--task", default="", metavar="TEXT", help="the task of the rows for which the data set names none"
    )
    workers(repair)
    making.add_actions(actions)
    export = one(actions, "export", "write a data set for Foxglove, rosbag2 or Rerun")
    export.add_argument("target", type=Path, metavar="TARGET")
    export.add_argument(
        "--to", choices=("mcap", "rerun"), default="mcap", help="MCAP with ROS 2 messages (default), or .rrd"
    )
    transfers.add_actions(actions)


def run(arguments: argparse.Namespace) -> int:
    """Run the action. Exit code 0; 1 if the data set is faulty, or cannot be read or written."""
    from joshua.features import EpisodeError
    from joshua.tools import ExitCode

    from joshua_dataset.reader import DatasetError

    try:
        if arguments.action in transfers.ACTIONS:
            return transfers.run(arguments)
        if getattr(arguments, "executor", None):
            _make_absolute(arguments)
        if arguments.action in making.ACTIONS:
            return making.run(arguments)
        return int(globals()[f"_{arguments.action}"](arguments))
    except JobError as error:
        sys.stderr.write(f"joshua dataset {arguments.action}: {error}\n")
        return error.exit_code
    except (DatasetError, EpisodeError) as error:
        sys.stderr.write(f"joshua dataset {arguments.action}: {error}\n")
        return ExitCode.FAILED


def _make_absolute(arguments: argparse.Namespace) -> None:
    """Make folders absolute, because the workers of a cluster have other working directories."""
    for name in {"folder", "target", "into"} & set(vars(arguments)):
        setattr(arguments, name, getattr(arguments, name).absolute())
    if "folders" in vars(arguments):
        arguments.folders = [folder.absolute() for folder in arguments.folders]


def _info(arguments: argparse.Namespace) -> int:
    _print(description(arguments.folder))
    return 0


def _print(text: str) -> None:
    """Print lines, wrapped to the width of a terminal."""
    from joshua.tools import Screen

    screen = Screen.of(sys.stdout)
    for line in text.splitlines():
        sys.stdout.writelines(f"{piece}\n" for piece in screen.wrap(line, indent=4))


def _repair(arguments: argparse.Namespace) -> int:
    from joshua_dataset.repair import repair

    with opened_workers(arguments) as workers:
        report = repair(arguments.folder, cut=arguments.cut, task=arguments.task, workers=workers)
    _print(str(report))
    return 0 if report.is_complete else 1


def _check(arguments: argparse.Namespace) -> int:
    from joshua_dataset.checking import Looked, check
    from joshua_dataset.output import counted

    errors = warnings = 0
    looked = Looked()
    with opened_workers(arguments) as workers:
        pictures = not arguments.no_pictures
        for problem in check(arguments.folder, pictures=pictures, workers=workers, looked=looked):
            _print(str(problem))
            errors += problem.serious
            warnings += not problem.serious
    found = f"{counted(errors, 'error')}, {counted(warnings, 'warning')}"
    _print(f"{arguments.folder}: {found}; {looked}")
    return 1 if errors else 0


def _view(arguments: argparse.Namespace) -> int:
    import tempfile
    import webbrowser

    from joshua.features import EpisodeError

    from joshua_dataset.page import write_page

    folder: Path = arguments.folder.resolve()
    page = arguments.output or folder.with_name(f"{folder.name}.html")
    with tempfile.TemporaryDirectory() as scratch:
        try:
            shown = write_page(folder, page, arguments.episodes, Path(scratch))
        except OSError as error:
            raise EpisodeError(f"{page} cannot be written: {error.strerror or error}") from error
    sys.stdout.write(f"{page}: episodes {', '.join(map(str, shown)) or 'none'}\n")
    if not arguments.no_open:
        webbrowser.open(page.resolve().as_uri())
    return 0


def _stats(arguments: argparse.Namespace) -> int:
    from joshua.tools import Screen, columns

    from joshua_dataset.metadata import EPISODES_STATS, STATS
    from joshua_dataset.reader import Dataset
    from joshua_dataset.recomputing import recompute, recomputed

    compute = recompute if arguments.write else recomputed
    with opened_workers(arguments) as workers:
        found = compute(arguments.folder, workers=workers)
    dataset = Dataset.read(arguments.folder)
    features = dataset.features
    figures = ("min", "mean", "max", "std")
    rows = [("FEATURE", "NAME", *map(str.upper, figures))]
    for key, values in found.items():
        feature = features[key]
        if feature.unit == "ns":
            continue  # times
        labels = ("red", "green", "blue") if feature.is_picture else feature.names
        for number, label in enumerate(labels or map(str, range(values["mean"].size))):
            cells = [f"{values[name].ravel()[number]:.4f}" for name in figures]
            rows.append((key, label, *cells))
    layout = columns(rows, screen=Screen.of(sys.stdout), right=range(2, 6), group=0, flexible=1)
    sys.stdout.writelines(f"{line}\n" for line in layout)
    if arguments.write:
        stored = [arguments.folder / name for name in (STATS, EPISODES_STATS)]
        names = " and ".join(str(path) for path in stored if path.exists())
        sys.stdout.write(f"the statistics of {dataset.episodes} episodes are replaced: {names}\n")
    return 0


def _export(arguments: argparse.Namespace) -> int:
    from joshua_dataset.export import export

    with progress_of_episodes() as progress:
        count = export(arguments.folder, arguments.target, arguments.to, progress)
    sys.stdout.write(f"{arguments.target}: {count} episodes\n")
    return 0


def description(folder: Path) -> str:
    """Describe a data set as text. Raises DatasetError."""
    from joshua.tools import describe_pointers

    from joshua_dataset.changes import files_of
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
    for episode in found.episode_list(with_statistics=False) if lost else ():
        for name in lost:
            lost[name] += episode.counts.get(name, 0)
    if any(lost.values()):
        counts = ", ".join(f"{count} {name}" for name, count in lost.items())
        lines.append(f"  frames that lacked a value: {counts}")
    pointers = describe_pointers(folder, files_of(folder))
    if pointers is not None:
        lines.append(". ".join(pointers))
    return "\n".join(lines)
