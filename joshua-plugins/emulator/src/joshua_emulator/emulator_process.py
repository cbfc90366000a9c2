"""Handle to an emulator process: start, query, stop."""

from __future__ import annotations

import contextlib
import json
import selectors
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from typing_extensions import Self

START_TIMEOUT_S = 60.0  # beside a dozen others, on a machine that does something else
ANSWER_TIMEOUT_S = 60.0
STOP_TIMEOUT_S = 10.0

#: Exit code of the program for an unknown fault.
FAULT_REFUSED = 3


class EmulatorError(Exception):
    """The emulator did not start, refused a request or ended. The message says which and why."""


class FaultRefused(EmulatorError):
    """The fault is unknown or its value is invalid. The message lists what is allowed."""


class EmulatorProcess:
    """An emulator process; a context manager. The process ends with the one that started it.

    Args:
        command: subcommand and its positional arguments, such as ``("feetech", "--ids", "1,2")``.
        options: further options of the command line by name, such as ``calibrated=True`` or
            ``fault=["drop=0.01"]``.
    """

    def __init__(self, command: Sequence[str], options: Mapping[str, Any]) -> None:
        self._command = [*command, *_arguments(options)]
        self._has_root = "root" in options
        self._process: subprocess.Popen[bytes] | None = None
        self._socket: socket.socket | None = None
        self._buffer = b""
        self.ready: dict[str, Any] = {}

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def root(self) -> Path:
        """Folder that holds ``dev/`` and ``sys/``."""
        return Path(self.ready["root"])

    @property
    def pid(self) -> int:
        """Process id."""
        return int(self.ready["pid"])

    def start(self) -> None:
        """Start the process and wait until it is ready. Raises EmulatorError."""
        command = [sys.executable, "-m", "joshua_emulator", *self._command, "--until-stdin-closes"]
        # In a session of its own: Ctrl-C is for the drivers, which stop before their devices vanish.
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        line = self._first_line()
        if not line:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(STOP_TIMEOUT_S)  # it is about to end and to report the reason
            self._process.kill()
            _, errors = self._process.communicate()
            refused = self._process.returncode == FAULT_REFUSED
            self.close()
            said = errors.decode(errors="replace").strip()
            if refused:
                raise FaultRefused(said.partition(": ")[2])
            raise EmulatorError(f"the emulator did not start: {said}")
        self.ready = json.loads(line)

    def close(self) -> None:
        """Stop the process and remove its folder. Idempotent."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        process, self._process = self._process, None
        if process is not None:
            process.terminate()
            try:
                process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            for stream in (process.stdin, process.stdout, process.stderr):
                if stream is not None:
                    with contextlib.suppress(BrokenPipeError):
                        stream.close()
        if self.ready and not self._has_root:  # still exists only if the process had to be killed
            shutil.rmtree(self.root, ignore_errors=True)

    def ask(self, operation: str, **values: Any) -> dict[str, Any]:
        """Send one request over the control channel. Raises EmulatorError with the emulator's reason."""
        connection = self._connect()
        try:
            connection.sendall(json.dumps({"op": operation, **values}).encode() + b"\n")
            while b"\n" not in self._buffer:
                data = connection.recv(65536)
                if not data:
                    raise EmulatorError(f"{operation}: the emulator closed the control channel")
                self._buffer += data
        except OSError as error:
            raise EmulatorError(f"{operation}: the emulator does not answer ({error})") from error
        line, _, self._buffer = self._buffer.partition(b"\n")
        answer: dict[str, Any] = json.loads(line)
        if not answer.pop("ok"):
            raise EmulatorError(str(answer["error"]))
        return answer

    def log(self, *events: str, since: int = 0) -> list[dict[str, Any]]:
        """Return log entries after a sequence number, optionally only of the named events."""
        return list(self.ask("log", since=since, events=events)["entries"])

    def fault(self, kind: str, value: float | None = None, **settings: Any) -> None:
        """Inject a fault, such as ``fault("silent", 3)`` or ``fault("drop", 0.01)``."""
        self.ask("fault", kind=kind, **({} if value is None else {"value": value}), **settings)

    def wait_for(self, events: Iterable[str], *, since: int = 0, timeout_s: float = 60.0) -> dict[str, Any]:
        """Wait for the first log entry of the given events after a sequence number."""
        deadline_s = time.monotonic() + timeout_s
        wanted = list(events)
        while time.monotonic() < deadline_s:
            entries = self.log(*wanted, since=since)
            if entries:
                return entries[0]
            time.sleep(0.005)
        raise EmulatorError(f"none of {', '.join(wanted)} was logged within {timeout_s} s")

    def _connect(self) -> socket.socket:
        if self._socket is None:
            if not self.ready:
                raise EmulatorError("the emulator is not running; start it first")
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            self._socket.settimeout(ANSWER_TIMEOUT_S)
            try:
                self._socket.connect(str(self.ready["control"]))
            except OSError as error:
                self._socket.close()
                self._socket = None
                raise EmulatorError(f"the emulator does not answer ({error})") from error
        return self._socket

    def _first_line(self) -> bytes:
        assert self._process is not None
        assert self._process.stdout is not None
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            if not selector.select(START_TIMEOUT_S):
                return b""
        return self._process.stdout.readline()


def _arguments(options: Mapping[str, Any]) -> list[str]:
    arguments: list[str] = []
    for name, value in options.items():
        flag = "--" + name.replace("_", "-")
        if value is True:
            arguments.append(flag)
        elif isinstance(value, (list, tuple)) and name == "fault":
            for item in value:
                arguments += [flag, str(item)]
        elif isinstance(value, (list, tuple)):
            arguments.append(f"{flag}={','.join(str(item) for item in value)}")  # it may begin with a minus
        elif value is not None and value is not False:
            arguments += [flag, str(value)]
    return arguments
