"""Options that the actions of ``joshua dataset`` share, and the workers and the progress of those."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from joshua_jobs.choice import add_options, chosen, opened
from joshua_jobs.executor import Executor


def one(actions: Any, name: str, text: str) -> argparse.ArgumentParser:
    """Add an action on one data set."""
    parser: argparse.ArgumentParser = actions.add_parser(name, help=text)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    return parser


def workers(parser: argparse.ArgumentParser) -> None:
    """Add the number of processes, and the clusters in their place."""
    parser.add_argument(
        "--workers", type=positive, metavar="N", help="episodes at once (default: one per core)"
    )
    add_options(parser)


def episodes(parser: argparse.ArgumentParser) -> None:
    """Add the choice of episodes."""
    parser.add_argument(
        "--episodes", type=numbers, required=True, metavar="LIST", help="such as 0-9,12; counted from 0"
    )


def positive(text: str) -> int:
    """Parse a whole number of at least 1."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is less than 1")
    return number


def numbers(text: str) -> tuple[int, ...]:
    """Parse episode numbers such as ``0-9,12``."""
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()):
            raise argparse.ArgumentTypeError(
                f"{part!r} is not an episode: write numbers and ranges, such as 0-9,12"
            )
        found += range(int(first), int(last or first) + 1)
    return tuple(found)


@contextlib.contextmanager
def opened_workers(arguments: argparse.Namespace) -> Iterator[Executor]:
    """Open the workers of a command, and say at the end whether some were lost."""
    with opened(chosen(arguments), arguments.workers) as workers:
        yield workers
        if workers.lost:
            sys.stderr.write(f"{workers.lost} jobs were repeated, because their workers were lost\n")


@contextlib.contextmanager
def progress_of_episodes() -> Iterator[Callable[[int, int], None]]:
    """Show the number of finished episodes on a terminal."""
    shown = sys.stderr.isatty()

    def show(done: int, total: int) -> None:
        if shown:
            sys.stderr.write(f"\r{done} of {total} episodes")
            sys.stderr.flush()

    yield show
    if shown:
        sys.stderr.write("\n")
