"""The directory of a running system (lock, control socket, link to the log) and the locks of its nodes."""

from __future__ import annotations

import contextlib
import fcntl
import json
import logging
import os
import secrets
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from joshua.guardian import energised, latch
from joshua.ipc.client import INFO_NAME, LOCK_NAME, SOCKET_NAME, RunInfo, is_free, read_info
from joshua.ipc.run_bases import RunDirectoryError, other_bases, private
from joshua.plan import RunFacts
from joshua.supervisor.control_server import ControlServer, Handler
from joshua.supervisor.logbook import Logbook
from joshua.supervisor.reactor import Reactor

LOG_NAME = "log.jsonl"
PHYSICS_FOLDER = "physics"
LINK_FOLDER = "links"


class NodesInUseError(Exception):
    """Another run holds nodes of this one. The message names it."""


class RunDirectory:
    """One running system's directory, made by ``create`` and removed by ``close``."""

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
        """Locks the nodes and creates the directory. Removes the directories of killed runs.

        Raises:
            NodesInUseError: another run holds a node of the same name in the same domain.
            RunDirectoryError: the base cannot be created or does not belong to this user.
        """
        since = time.strftime("%Y-%m-%d %H:%M:%S")
        run, process_id = secrets.token_hex(4), os.getpid()
        info = RunInfo(run, process_id, source, since, domain_id, tuple(nodes), robot, tuple(actuators))
        return cls(base / "runs" / run, info, _make(base, info))

    def restore(self) -> bool:
        """Creates the directory again if it was removed, and returns whether it was.

        The system removes it at a user's last log-out, or as an old file below /tmp.

        Raises:
            NodesInUseError: another run has locked the nodes meanwhile.
            RunDirectoryError: it cannot be created.
        """
        if all(os.path.exists(self.path / name) for name in (INFO_NAME, LOCK_NAME)):  # noqa: PTH110 (raises nothing)
            return False
        base = self.path.parents[1]
        self._unlock()
        with contextlib.suppress(OSError):  # the next step reports it
            base.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        try:
            self._descriptors = _make(base, self.info)
        except RunDirectoryError:
            self._descriptors = _relock(base, self.info)
            raise
        return True

    @property
    def socket_path(self) -> Path:
        """Path of the control socket."""
        return self.path / SOCKET_NAME

    def facts(self, log: Path) -> RunFacts:
        """Facts of the run for its actuators."""
        return RunFacts(
            log=str(log.absolute()),
            socket=str(self.socket_path),
            robot=self.info.robot,
            domain_id=self.info.domain_id,
            latch_folder=str(latch.latch_folder(self.path.parents[1])),
            estop_files=str(self.path / latch.FOLDER_NAME),
            source=self.info.source,
            run=self.info.run,
            energised_folder=str(energised.energised_folder(self.path.parents[1])),
        )

    def point_to_log(self, log: Path) -> None:
        """Links ``log.jsonl`` in this directory to the log file."""
        with contextlib.suppress(OSError):  # only a convenience
            (self.path / LOG_NAME).symlink_to(log.absolute())

    def close(self) -> None:
        """Removes the directory and unlocks the nodes. Idempotent."""
        shutil.rmtree(self.path, ignore_errors=True)
        self._unlock()

    def _unlock(self) -> None:
        while self._descriptors:
            os.close(self._descriptors.pop())


def _make(base: Path, info: RunInfo) -> list[int]:
    """Creates the directory of a run and returns the descriptors of its locks."""
    runs = private(private(base) / "runs")
    nodes = private(base / "nodes")
    with contextlib.ExitStack() as undo, _unusable(base), _locked(base):
        remove_stale(runs)
        for name in (PHYSICS_FOLDER, LINK_FOLDER):
            remove_stale(base / name)
        descriptors = _lock_nodes([nodes, *(other / "nodes" for other in other_bases(base))], info, undo)
        latch.LatchFolder(latch.latch_folder(base)).keep_spare()
        path = runs / info.run
        path.mkdir(mode=0o700, exist_ok=True)  # a part of it may be left
        descriptors.append(_lock(path / LOCK_NAME, undo, wait=True))
        # Last and whole, because it makes the run visible.
        latch.write_whole(path / INFO_NAME, json.dumps(asdict(info)).encode())
        undo.pop_all()
    return descriptors


@contextlib.contextmanager
def socket_folder(base: Path, name: str) -> Iterator[Path]:
    """A folder for the sockets of a simulation, which starts before the run, or of the links between nodes.

    It is removed at the end. The next run at this base removes the folders of killed processes.

    Raises:
        RunDirectoryError: the base cannot be created or does not belong to this user.
    """
    folders = private(private(base) / name)
    path = folders / secrets.token_hex(4)
    with contextlib.ExitStack() as stack:
        with _unusable(base), _locked(base):
            remove_stale(folders)
            path.mkdir(mode=0o700)
            _lock(path / LOCK_NAME, stack, wait=True)
        stack.callback(shutil.rmtree, path, ignore_errors=True)
        yield path


def remove_stale(runs: Path) -> None:
    """Removes the directories whose lock is free, because their owner is gone."""
    for path in runs.glob("*/"):
        if is_free(path / LOCK_NAME):
            shutil.rmtree(path, ignore_errors=True)


@contextlib.contextmanager
def _unusable(base: Path) -> Iterator[None]:
    """Turns OSError into RunDirectoryError."""
    try:
        yield
    except OSError as error:
        raise RunDirectoryError(
            f"{base}: {error.strerror or error}. Free space, or set XDG_RUNTIME_DIR to another folder"
        ) from error


@contextlib.contextmanager
def _locked(base: Path) -> Iterator[None]:
    """Keeps other processes from creating and cleaning at the same time, for milliseconds."""
    with contextlib.ExitStack() as stack:
        _lock(base / LOCK_NAME, stack, wait=True)
        yield


def _lock(path: Path, stack: contextlib.ExitStack, *, wait: bool = False) -> int:
    """Locks a file until ``stack`` closes its descriptor, and returns that.

    Args:
        wait: for a lock that is held only for microseconds, by a process that checks it.

    Raises:
        BlockingIOError: another process holds the lock.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    stack.callback(os.close, descriptor)
    fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    return descriptor


def _lock_nodes(folders: Sequence[Path], info: RunInfo, stack: contextlib.ExitStack) -> list[int]:
    """Locks each node in the first folder and checks its locks in the others. Raises NodesInUseError."""
    held: dict[str, list[str]] = {}
    descriptors: list[int] = []
    text = json.dumps(asdict(info)).encode()
    for folder in folders:
        for node in info.nodes:
            path = folder / f"{info.domain_id}{node.replace('/', '.')}"
            if folder is not folders[0]:
                if path.exists() and not is_free(path):
                    held.setdefault(_holder(path), []).append(node)
                continue
            try:
                descriptor = _lock(path, stack)
            except BlockingIOError:
                held.setdefault(_holder(path), []).append(node)
                continue
            descriptors.append(descriptor)
            if os.pread(descriptor, len(text) + 1, 0) != text:
                os.ftruncate(descriptor, 0)
                os.pwrite(descriptor, text, 0)
    if held:
        lines = [f"{', '.join(nodes)}: held by {holder}" for holder, nodes in held.items()]
        raise NodesInUseError(
            "another run has these nodes: " + "; ".join(lines) + ". Stop it with Ctrl-C or `joshua stop`, "
            "or run this file in another ROS_DOMAIN_ID"
        )
    return descriptors


def _relock(base: Path, info: RunInfo) -> list[int]:
    """Locks the nodes again whose files are still there, because the directory could not be created."""
    with contextlib.ExitStack() as undo, contextlib.suppress(OSError, NodesInUseError):
        descriptors = _lock_nodes([base / "nodes"], info, undo)
        undo.pop_all()
        return descriptors
    return []


def _holder(path: Path) -> str:
    info = read_info(path)
    if info is None:
        return "an unknown run"
    return f"process {info.process_id}, which runs {info.source} since {info.since}"


class RunPlace:
    """Keeps a run reachable: creates its directory and socket again if they are removed.

    Args:
        reactor: the supervisor's loop; logbook: of the run.
        directory: of the run, closed by this object.
        handlers: of the requests on the control socket.
    """

    def __init__(
        self, reactor: Reactor, logbook: Logbook, directory: RunDirectory, handlers: Mapping[str, Handler]
    ) -> None:
        self._reactor = reactor
        self._logbook = logbook
        self._directory = directory
        self._handlers = handlers
        self._server: ControlServer | None = None
        self._lost = self._unserved = False
        self._serve()

    def look(self) -> None:
        """Creates the place again if a part of it is gone. Takes three file checks."""
        try:
            restored = self._directory.restore()
        except (NodesInUseError, RunDirectoryError) as error:
            if not self._lost:
                self._lost = True
                text = f"its directory was removed, so joshua estop and stop do not find this run: {error}"
                self._logbook.write(logging.ERROR, text)
            return
        if restored or not os.path.exists(self._directory.socket_path):  # noqa: PTH110 (raises nothing)
            self._serve()
        if restored:
            self._lost = False
            self._logbook.write(
                logging.WARNING, "the directory of this run was removed and has been created again"
            )

    def close(self) -> None:
        """Removes the directory. Idempotent."""
        if self._server is not None:
            self._server.close()
        self._directory.close()

    def _serve(self) -> None:
        if self._server is not None:
            self._server.close()
            self._server = None
        self._directory.point_to_log(self._logbook.path)
        try:
            self._server = ControlServer(self._reactor, self._directory.socket_path, self._handlers)
        except OSError as error:
            if not self._unserved:  # the next look tries again
                self._unserved = True
                text = f"no control socket, so no `joshua status`: {error}"
                self._logbook.write(logging.WARNING, text)
        else:
            self._unserved = False
