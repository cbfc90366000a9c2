"""The executors of plugins: their options on a command line, their addresses, their modules."""

from __future__ import annotations

import argparse
import importlib
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from joshua_jobs.executor import Executor, JobError

GROUP = "joshua.executors"

#: Options that exist without their plugins, so that the message names the missing one.
PUBLISHED = {"ray": "joshua-ray"}

_NOT_INSTALLED = 3


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add one option for each executor, such as ``--ray ADDRESS``. At most one of them can be given."""
    group = parser.add_mutually_exclusive_group()
    for name in sorted({*PUBLISHED, *_installed()}):
        group.add_argument(
            f"--{name}",
            metavar="ADDRESS",
            action=_Chosen,
            dest="executor",
            default=None,
            help="work on a cluster: HOST:PORT of its head, or local for one of this machine",
        )


def chosen(arguments: argparse.Namespace) -> tuple[str, str] | None:
    """Return the name and the address of the executor of a command line; None for this machine."""
    found: tuple[str, str] | None = arguments.executor
    return found


def check_address(name: str, address: str) -> None:
    """Refuse an executor that is not installed, or an address that it must not use.

    Raises:
        JobError: with exit code 3 if something is not installed, 2 for the address.
    """
    _module(name).check(address)


def opened(executor: tuple[str, str] | None, workers: int | None = None) -> Executor:
    """Open an executor.

    Args:
        executor: name and address; None for the processes of this machine.
        workers: jobs at the same time; None for one per core.

    Raises:
        JobError: it cannot be used.
    """
    if executor is None:
        from joshua_jobs.processes import Processes

        return Processes(workers)
    name, address = executor
    module = _module(name)
    module.check(address)
    made: Executor = module.connect(address, workers)
    return made


class _Chosen(argparse.Action):
    """Keeps the name of the option with the address."""

    def __call__(
        self, parser: Any, namespace: argparse.Namespace, values: Any, option_string: str | None = None
    ) -> None:
        setattr(namespace, self.dest, ((option_string or "").removeprefix("--"), values))


def _installed() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP)}


def _module(name: str) -> Any:
    point = _installed().get(name)
    if point is None:
        owner = PUBLISHED.get(name, f"a plugin with the executor {name}")
        how = f" (from a clone: ./run --with {owner.removeprefix('joshua-')})" if name in PUBLISHED else ""
        raise JobError(f"--{name} requires {owner}, which is not installed. Install it{how}", _NOT_INSTALLED)
    try:
        return importlib.import_module(point.value)
    except ImportError as error:
        owner = point.dist.name if point.dist else name
        raise JobError(f"{owner} is broken ({error}). Install it again", _NOT_INSTALLED) from error
