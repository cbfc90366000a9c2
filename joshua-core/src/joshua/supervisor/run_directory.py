"""The directory of one running system: lock, control socket, pointer to the log; and who holds which node."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import secrets
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from joshua.guardian import latch
from joshua.ipc.client import INFO_NAME, LOCK_NAME, SOCKET_NAME, RunInfo, is_free, read_info
from joshua.ipc.run_bases import RunDirectoryError, other_bases, private
from joshua.plan import RunFacts

LOG_NAME = "log.jsonl"
PHYSICS_FOLDER = "physics"


class NodesInUseError(Exception):
    """Another run holds nodes of this one; the message names it."""


class RunDirectory:
    """One running system's directory; made by ``create``, removed by ``close``."""

    def __init__(self, path: Path, info: RunInfo, descriptors: list[int]) -> None:
        self.path = path
        self.info = info
        self._descriptors = descriptors

    @classmethod
    def create(
        cls,
        base: Path,
        source: str,
        domain_id: int,
        nodes: Sequence[str],
        *,
        robot: str = "",
        actuators: Sequence[str] = (),
    ) -> RunDirectory:
        """Takes the nodes and makes the directory; removes those of runs that were killed.

        Raises:
            NodesInUseError: another run holds a node of the same name in the same domain.
            RunDirectoryError: the base cannot be made or is not this user's own.
        """
        since = time.strftime("%Y-%m-%d %H:%M:%S")
        run, process_id = secrets.token_hex(4), os.getpid()
        info = RunInfo(run, process_id, source, since, domain_id, tuple(nodes), robot, tuple(actuators))
        return cls(base / "runs" / run, info, _make(base, info))

    def restore(self) -> bool:
        """Makes the directory anew where somebody has removed it; returns whether that was needed.

        The system does so at the last log-out of a user, and with files below /tmp that have become old.

        Raises:
            NodesInUseError: another run has taken the nodes meanwhile.
            RunDirectoryError: it cannot be made now.
        """
        if all(os.path.exists(self.path / name) for name in (INFO_NAME, LOCK_NAME)):  # noqa: PTH110 (raises nothing)
            return False
        self._let_go()
        self._descriptors = _make(self.path.parents[1], self.info)
        return True

    @property
    def socket_path(self) -> Path:
        """The control socket, for ``joshua status`` and others."""
        return self.path / SOCKET_NAME

    def facts(self, log: Path) -> RunFacts:
        """What the actuators of the run are told of it."""
        return RunFacts(
            log=str(log.absolute()),
            socket=str(self.socket_path),
            robot=self.info.robot,
            domain_id=self.info.domain_id,
            latch_folder=str(latch_folder(self.path.parents[1])),
            estop_files=str(self.path / latch.FOLDER_NAME),
        )

    def point_to_log(self, log: Path) -> None:
        """Lets ``log.jsonl`` in this directory point to the log file."""
        with contextlib.suppress(OSError):  # only a convenience
            (self.path / LOG_NAME).symlink_to(log.absolute())

    def close(self) -> None:
        """Removes the directory and lets the nodes go; a second call does nothing."""
        shutil.rmtree(self.path, ignore_errors=True)
        self._let_go()

    def _let_go(self) -> None:
        while self._descriptors:
            os.close(self._descriptors.pop())


def _make(base: Path, info: RunInfo) -> list[int]:
    """Makes the directory of a run; returns the locks that it holds."""
    runs = private(private(base) / "runs")
    locks = private(base / "nodes")
    descriptors: list[int] = []
    try:
        with _locked(base / LOCK_NAME):
            remove_stale(runs)
            remove_stale(base / PHYSICS_FOLDER)
            _take_nodes(locks, info, descriptors)
            _refuse_held([other / "nodes" for other in other_bases(base)], info)
            path = runs / info.run
            path.mkdir(mode=0o700)
            descriptors.append(_lock(path / LOCK_NAME, wait=True))
            (path / INFO_NAME).write_text(json.dumps(asdict(info)))
    except (OSError, NodesInUseError) as error:
        for descriptor in descriptors:
            os.close(descriptor)
        if isinstance(error, NodesInUseError):
            raise
        raise _unusable(base, error) from error
    return descriptors


@contextlib.contextmanager
def physics_folder(base: Path) -> Iterator[Path]:
    """A folder for the socket between emulated devices and their simulation, which are there before the run.

    It goes at the end, and the next run at this base removes those of processes that were killed.

    Raises:
        RunDirectoryError: the base cannot be made or is not this user's own.
    """
    folders = private(private(base) / PHYSICS_FOLDER)
    path = folders / secrets.token_hex(4)
    try:
        with _locked(base / LOCK_NAME):
            remove_stale(folders)
            path.mkdir(mode=0o700)
            descriptor = _lock(path / LOCK_NAME, wait=True)
    except OSError as error:
        raise _unusable(base, error) from error
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)
        os.close(descriptor)


def _unusable(base: Path, error: OSError) -> RunDirectoryError:
    return RunDirectoryError(
        f"{base}: {error.strerror or error}; free space, or set XDG_RUNTIME_DIR to another folder"
    )


def latch_folder(base: Path) -> Path:
    """Where the e-stops of this user's robots are latched: beside the runs, because they outlive one."""
    return base / latch.FOLDER_NAME


def remove_stale(runs: Path) -> None:
    """Removes the directories whose owner is gone: nobody holds the lock in them any more."""
    for path in runs.glob("*/"):
        if is_free(path / LOCK_NAME):
            shutil.rmtree(path, ignore_errors=True)


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Keeps other processes from creating and cleaning at the same time; they hold it for milliseconds."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _lock(path: Path, *, wait: bool = False) -> int:
    """Locks a file for the life of this process; raises BlockingIOError if another holds it.

    Args:
        wait: for those that only look whether it is held, which takes them microseconds.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        os.close(descriptor)
        raise
    return descriptor


def _take_nodes(locks: Path, info: RunInfo, descriptors: list[int]) -> None:
    """Locks each node, and adds the descriptors that hold the locks. Raises NodesInUseError."""
    held: dict[str, list[str]] = {}
    for node in info.nodes:
        path = locks / _lock_name(info, node)
        try:
            descriptor = _lock(path)
        except BlockingIOError:
            held.setdefault(_holder(path), []).append(node)
            continue
        descriptors.append(descriptor)
        os.ftruncate(descriptor, 0)
        os.write(descriptor, json.dumps(asdict(info)).encode())
    if held:
        raise _in_use(held)


def _refuse_held(folders: Sequence[Path], info: RunInfo) -> None:
    """Looks for the nodes among those of runs in other environments. Raises NodesInUseError."""
    held: dict[str, list[str]] = {}
    for folder in folders:
        for node in info.nodes:
            path = folder / _lock_name(info, node)
            if path.exists() and not is_free(path):
                held.setdefault(_holder(path), []).append(node)
    if held:
        raise _in_use(held)


def _lock_name(info: RunInfo, node: str) -> str:
    return f"{info.domain_id}{node.replace('/', '.')}"


def _in_use(held: Mapping[str, Sequence[str]]) -> NodesInUseError:
    lines = [f"{', '.join(nodes)}: held by {holder}" for holder, nodes in held.items()]
    return NodesInUseError(
        "another run has these nodes: " + "; ".join(lines) + ". Stop it with Ctrl-C or `joshua stop`, "
        "or run this file in another ROS_DOMAIN_ID"
    )


def _holder(path: Path) -> str:
    info = read_info(path)
    if info is None:
        return "a run that does not say more"
    return f"process {info.process_id}, which runs {info.source} since {info.since}"
