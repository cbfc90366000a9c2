"""Client of this user's running systems: finds them and sends requests to their control sockets."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.ipc.run_bases import base_directories, socket_address

if TYPE_CHECKING:
    from joshua.ipc.messages import VerbInfo
    from joshua.plan.events import Event, RunStatus

LOCK_NAME = "lock"
INFO_NAME = "run.json"
SOCKET_NAME = "control.sock"

#: Extra time for the answer to a call: after its timeout the supervisor answers with the reason.
GRACE_S = 2.0


@dataclass(frozen=True)
class RunInfo:
    """Description of a run.

    Attributes:
        run: its name; process_id: of its supervisor; source: its file, as given.
        since: local start time; domain_id: ROS 2 domain; nodes: fully qualified names.
        robot: ``general.id`` of its file; actuators: the nodes with joints.
    """

    run: str
    process_id: int
    source: str
    since: str
    domain_id: int
    nodes: tuple[str, ...]
    robot: str = ""
    actuators: tuple[str, ...] = ()


class CallError(Exception):
    """A running system refused a request or did not answer. The message says why.

    Attributes:
        code: ``unreachable``, ``unknown-node``, ``unknown-verb``, ``invalid`` (the request does not match the
            verb), ``not-allowed``, ``not-running``, ``refused``, ``failed``, ``gone`` (the node ended) or
            ``timeout``.
        allowed: alternatives, the nearest first.
    """

    def __init__(self, code: str, message: str, allowed: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.code = code
        self.allowed = tuple(allowed)


class RunningSystem:
    """One run on this machine, for scripts, dashboards and the commands of ``joshua``.

    Args:
        path: directory of the run; info: its description.
    """

    def __init__(self, path: Path, info: RunInfo) -> None:
        self.path = path
        self.info = info

    @classmethod
    def all(cls, environment: Mapping[str, str] = os.environ) -> list[RunningSystem]:
        """Every running system of this user, whatever environment it was started in."""
        bases = base_directories(environment)
        return [cls(path, info) for base in bases for path, info in running_systems(base)]

    @classmethod
    def find(cls, word: str = "", environment: Mapping[str, str] = os.environ) -> RunningSystem:
        """The system of a file or a process id; "" for the only one.

        Raises:
            CallError: no system matches, or several do.
        """
        systems = cls.all(environment)
        wanted = {word, os.path.abspath(word)}  # noqa: PTH100 (links stay as they are)
        chosen = [
            item for item in systems if not word or {item.info.source, str(item.info.process_id)} & wanted
        ]
        if len(chosen) == 1:
            return chosen[0]
        problem = f"{word} is not running" if systems else "no system is running"
        problem = "several systems are running, name one of them" if chosen else problem
        raise CallError(
            "unreachable", problem, [f"{item.info.process_id}  {item.info.source}" for item in systems]
        )

    @property
    def name(self) -> str:
        """Description for messages."""
        return f"process {self.info.process_id}, which runs {self.info.source}"

    def has(self, node: str) -> bool:
        """Whether a word names a node of this run, as in ``is_named``."""
        return any(is_named(name, node) for name in self.info.nodes)

    def status(self) -> RunStatus:
        """Current status. Raises CallError."""
        from joshua.plan.events import RunStatus, event_of

        answer = self.request({"request": "status"})
        try:
            status = event_of({"event": "status", **answer["status"]})
            assert isinstance(status, RunStatus)
        except (ValueError, TypeError, KeyError) as error:
            raise self._unreachable(error) from error
        return status

    def events(self, names: Sequence[str] = ()) -> Iterator[Event]:
        """Yields the events of the run, its status first, until it ends.

        Args:
            names: of events, such as ``progress``; empty for all but log lines.

        Raises:
            CallError: the run does not answer or refuses.
        """
        from joshua.plan.events import event_of

        try:
            with _connected(self.path / SOCKET_NAME, 5.0) as connection, connection.makefile("rb") as lines:
                connection.sendall(_line({"request": "subscribe", "events": list(names)}))
                connection.settimeout(None)
                for line in lines:
                    record = json.loads(line)
                    if "error" in record:
                        raise _error_of(record)
                    with contextlib.suppress(ValueError):  # unknown to this version
                        yield event_of(record)
        except ConnectionResetError:
            return  # the run has ended
        except (OSError, ValueError) as error:
            raise self._unreachable(error) from error

    def verbs(self, node: str, *, timeout_s: float = 5.0) -> tuple[VerbInfo, ...]:
        """Verbs of a node. Raises CallError."""
        from joshua.ipc.messages import LIST_VERBS, VerbInfo

        infos = self.call(node, LIST_VERBS, timeout_s=timeout_s)["verbs"]
        return tuple(VerbInfo.model_validate(info) for info in infos)

    def call(
        self,
        node: str,
        verb: str,
        payload: Mapping[str, Any] | None = None,
        *,
        timeout_s: float = 10.0,
        start: bool = False,
    ) -> dict[str, Any]:
        """Calls a verb of a node and returns the reply.

        Args:
            node: its full name, or the last part of it.
            payload: fields of the verb's request, JSON-able.
            timeout_s: for the reply. An expired call is not executed.
            start: start a node that is down, and wait for one that is starting.

        Raises:
            CallError: no reply within the timeout.
        """
        request = {"request": "call", "node": node, "verb": verb, "payload": dict(payload or {})}
        try:
            answer = self.request({**request, "timeout_s": timeout_s, "start": start}, timeout_s + GRACE_S)
        except CallError as error:
            if error.code == "unknown-node" and (other := self._run_of(node)) is not None:
                text = f"{error}: it is a node of another run: {other.name}"
                raise CallError(error.code, text, error.allowed) from None
            raise
        return dict(answer.get("reply", {}))

    def stop(self, timeout_s: float = 15.0) -> bool:
        """Stops the run and returns whether it ended in time. Raises CallError."""
        deadline_s = time.monotonic() + timeout_s
        try:
            with _connected(self.path / SOCKET_NAME, 5.0) as connection:
                answer = _exchange(connection, {"request": "stop"})
                if "error" in answer:
                    raise _error_of(answer)
                # The end of the connection needs no file, which may have vanished.
                _await_end(connection, deadline_s)
        except (OSError, ValueError) as error:
            raise self._unreachable(error) from error
        # A run that cannot remove its directory, on a read-only file system, has ended when the lock is free.
        while not is_free(self.path / LOCK_NAME):
            if time.monotonic() > deadline_s:
                return False
            time.sleep(0.02)
        return True

    def request(self, request: Mapping[str, Any], timeout_s: float = 5.0) -> dict[str, Any]:
        """Sends one request to the control socket and returns the answer. Raises CallError."""
        try:
            answer = ask(self.path / SOCKET_NAME, request, timeout_s)
        except (OSError, ValueError) as error:
            raise self._unreachable(error) from error
        if "error" in answer:
            raise _error_of(answer)
        return answer

    def _unreachable(self, error: Exception) -> CallError:
        return CallError("unreachable", f"{self.name}, does not answer: {str(error) or type(error).__name__}")

    def _run_of(self, node: str) -> RunningSystem | None:
        others = (item for item in RunningSystem.all() if item.info.run != self.info.run)
        return next((item for item in others if item.has(node)), None)


def is_named(full_name: str, word: str) -> bool:
    """Whether a word names a node: full name, with or without the first slash, or its last part."""
    return word in (full_name, full_name.lstrip("/"), full_name.rpartition("/")[2])


def ask(path: Path, request: Mapping[str, Any], timeout_s: float = 5.0) -> dict[str, Any]:
    """Sends one request to a control socket and returns the answer.

    Raises:
        OSError: no answer.
        ValueError: the answer does not belong to this protocol.
    """
    with _connected(path, timeout_s) as connection:
        return _exchange(connection, request)


def answers(path: Path, request: Mapping[str, Any], timeout_s: float) -> Iterator[dict[str, Any]]:
    """Sends one request to a control socket and yields its answers until the run closes the connection.

    Args:
        timeout_s: for each answer.

    Raises:
        OSError: no answer in time.
        ValueError: an answer does not belong to this protocol.
    """
    with _connected(path, timeout_s) as connection, connection.makefile("rb") as lines:
        connection.sendall(_line(request))
        for line in lines:
            answer = json.loads(line)
            if not isinstance(answer, dict):
                raise ValueError(f"expected an object, found {answer!r}")
            yield answer


def _exchange(connection: socket.socket, request: Mapping[str, Any]) -> dict[str, Any]:
    connection.sendall(_line(request))
    data = b""
    while not data.endswith(b"\n"):
        part = connection.recv(65536)
        if not part:
            raise ConnectionResetError("the run closed the connection")
        data += part
    answer = json.loads(data)
    if not isinstance(answer, dict):
        raise ValueError(f"expected an object, found {answer!r}")
    return answer


def _await_end(connection: socket.socket, deadline_s: float) -> None:
    with contextlib.suppress(OSError):  # a time-out, or a connection that its owner's end has reset
        while (left_s := deadline_s - time.monotonic()) > 0:
            connection.settimeout(left_s)
            if not connection.recv(65536):
                return


def _connected(path: Path, timeout_s: float) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        connection.settimeout(timeout_s)
        with socket_address(path) as address:
            connection.connect(address)
    except OSError:
        connection.close()
        raise
    return connection


def _line(request: Mapping[str, Any]) -> bytes:
    return json.dumps(request).encode() + b"\n"


def _error_of(answer: Mapping[str, Any]) -> CallError:
    allowed = [str(name) for name in answer.get("allowed", ())]
    return CallError(str(answer.get("code", "failed")), str(answer["error"]), allowed)


def running_systems(base: Path) -> list[tuple[Path, RunInfo]]:
    """Running systems below a base directory, oldest first."""
    return [(path, info) for path, info in all_systems(base) if not is_free(path / LOCK_NAME)]


def all_systems(base: Path) -> list[tuple[Path, RunInfo]]:
    """Running systems and those killed since the last start of a run, oldest first."""
    found = [(path, read_info(path / INFO_NAME)) for path in sorted((base / "runs").glob("*/"))]
    return sorted(((path, info) for path, info in found if info), key=lambda item: item[1].since)


def is_free(lock: Path) -> bool:
    """Whether a lock file is not locked. A file that cannot be opened is free."""
    try:
        # Not for writing, which a file system that has become read-only refuses.
        descriptor = os.open(lock, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return True
    try:
        # Shared: two commands that check at the same time must not take each other for the run.
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    else:
        return True
    finally:
        os.close(descriptor)


def read_info(path: Path) -> RunInfo | None:
    """Description of a run, None if the file cannot be read."""
    try:
        fields = json.loads(path.read_text())
        lists = {name: tuple(fields[name]) for name in ("nodes", "actuators")}
        return RunInfo(**{**fields, **lists})
    except (OSError, ValueError, TypeError, KeyError):
        return None
