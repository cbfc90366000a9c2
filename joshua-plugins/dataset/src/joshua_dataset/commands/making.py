"""``joshua dataset convert``, ``split``, ``merge`` and ``delete``: data sets made of episodes of others."""

from __future__ import annotations

import argparse
import contextlib
import shlex
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from joshua_jobs.executor import Executor

from joshua_dataset.commands.options import episodes, one, opened_workers, progress_of_episodes, workers

ACTIONS = ("convert", "split", "merge", "delete")

FORMATS = ("lerobot", "parquet", "csv", "jsonl")


def add_actions(actions: Any) -> None:
    """Add the actions to ``joshua dataset``."""
    convert = one(actions, "convert", "write a data set in another format, codec or layout version")
    convert.add_argument("target", type=Path, metavar="TARGET")
    made(convert)
    split = one(actions, "split", "write some episodes into a data set of their own")
    split.add_argument("target", type=Path, metavar="TARGET")
    episodes(split)
    made(split)
    merge = actions.add_parser("merge", help="write several data sets into one")
    merge.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    merge.add_argument(
        "--into", type=Path, required=True, metavar="TARGET", help="folder of the new data set"
    )
    made(merge)
    remove = one(actions, "delete", "remove episodes and renumber the others")
    episodes(remove)
    skipping(remove)
    workers(remove)


def made(parser: argparse.ArgumentParser) -> None:
    """Add the options of a new data set."""
    parser.add_argument(
        "--format", choices=FORMATS, default="lerobot", help="format of the tables (default lerobot, v3)"
    )
    parser.add_argument("--codec", choices=("h264", "hevc", "av1"), default="", help="codec of the videos")
    parser.add_argument(
        "--pictures", choices=("video", "png", "jpeg"), default="", help="how to store pictures"
    )
    skipping(parser)
    workers(parser)


def skipping(parser: argparse.ArgumentParser) -> None:
    """Add the choice to go on without the damaged episodes."""
    parser.add_argument(
        "--skip-damaged", action="store_true", help="leave out the episodes in which `check` finds damage"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the action; return 0. Raises EpisodeError, DatasetError and JobError."""
    return int(globals()[f"_{arguments.action}"](arguments))


def _convert(arguments: argparse.Namespace) -> int:
    from joshua_dataset.transform import Source

    return _build([Source(arguments.folder)], arguments.target, arguments)


def _split(arguments: argparse.Namespace) -> int:
    from joshua_dataset.transform import Source

    return _build([Source(arguments.folder, arguments.episodes)], arguments.target, arguments)


def _merge(arguments: argparse.Namespace) -> int:
    from joshua_dataset.transform import Source

    return _build([Source(folder) for folder in arguments.folders], arguments.into, arguments)


def _build(sources: Any, target: Path, arguments: argparse.Namespace) -> int:
    from joshua_dataset.transform import build

    with opened_workers(arguments) as workers, progress_of_episodes() as progress, _advised(arguments):
        used = [_fit(source, arguments, workers) for source in sources]
        count = build(
            used,
            target,
            table_format=arguments.format,
            codec=arguments.codec,
            pictures=arguments.pictures,
            workers=workers,
            progress=progress,
        )
    sys.stdout.write(f"{target}: {count} episodes\n")
    return 0


@contextlib.contextmanager
def _advised(arguments: argparse.Namespace) -> Iterator[None]:
    """Add to a refusal which episodes can be left out, and the command that does."""
    from joshua.features import EpisodeError

    from joshua_dataset.fitness import UnfitError
    from joshua_dataset.skipping import advice
    from joshua_dataset.transform import DamagedEpisodeError

    command = shlex.join(_words(arguments))
    try:
        yield
    except UnfitError as error:
        raise UnfitError(f"{error}{advice(error.problems, command)}", error.problems) from error
    except DamagedEpisodeError as error:
        raise EpisodeError(f"{error}. Run `{command} --skip-damaged` to leave it out") from error


def _words(arguments: argparse.Namespace) -> list[str]:
    """Return the words of a command that makes a data set, or changes one."""
    from joshua_dataset.checks.problem import spelled

    words = ["joshua", "dataset", arguments.action]
    given = vars(arguments)
    words += [str(folder) for folder in given.get("folders", [given.get("folder")])]
    words += [str(given["target"])] if "target" in given else []
    words += ["--into", str(given["into"])] if "into" in given else []
    words += ["--episodes", spelled(sorted(set(given["episodes"])))] if "episodes" in given else []
    defaults = {"format": "lerobot", "codec": "", "pictures": ""}
    for name, default in defaults.items():
        if given.get(name, default) != default:
            words += [f"--{name}", str(given[name])]
    return words


def _fit(source: Any, arguments: argparse.Namespace, workers: Executor) -> Any:
    """Return what is used of a source: all of it, or what is not damaged. Raises EpisodeError."""
    from joshua_dataset.skipping import whole_episodes

    if not arguments.skip_damaged:
        _require_fit(source, workers)
        return source
    chosen = whole_episodes(source.folder, source.episodes, workers=workers)
    sys.stdout.writelines(f"{line}\n" for line in chosen.lines(source.folder))
    return replace(source, episodes=chosen.episodes)


def _require_fit(source: Any, workers: Executor) -> None:
    """Refuse a source in which a check finds errors; say what it warns of. Raises EpisodeError."""
    from joshua_dataset.fitness import require_fit
    from joshua_dataset.reader import Dataset

    left_out: set[int] = set()
    if source.episodes is not None:
        left_out = set(range(Dataset.read(source.folder).episodes)) - set(source.episodes)
    warnings = require_fit(source.folder, "used", left_out=left_out, workers=workers)
    if warnings:
        sys.stderr.write(
            f"{source.folder} has {len(warnings)} warnings, the first: {warnings[0].sentence}. "
            f"`joshua dataset check {source.folder}` names all\n"
        )


def _delete(arguments: argparse.Namespace) -> int:
    from joshua_dataset.skipping import whole_episodes
    from joshua_dataset.transform import delete

    with opened_workers(arguments) as workers, _advised(arguments):
        damaged: dict[int, str] = {}
        if arguments.skip_damaged:
            chosen = whole_episodes(arguments.folder, workers=workers)
            sys.stdout.writelines(f"{line}\n" for line in chosen.lines(arguments.folder))
            damaged = chosen.left_out
        left = delete(arguments.folder, arguments.episodes, damaged=damaged, workers=workers)
    sys.stdout.write(f"{arguments.folder}: {left} episodes are left\n")
    return 0
