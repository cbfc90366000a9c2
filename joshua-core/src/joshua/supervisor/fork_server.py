"""Client of the fork server: a small process that loads heavy modules once and forks children.

Start it before anything else heavy is imported and before any thread or transport exists.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from joshua.ipc.frames import EndOfStreamError, FrameError, FrameSocket
from joshua.ipc.process_attributes import IGNORED_SIGNALS
from joshua.plan.lazy import without_pydantic_plugins

if TYPE_CHECKING:
    import subprocess

#: Time for the server to kill its children and end after its socket was closed.
CLOSE_TIMEOUT_S = 2.0


@dataclass(frozen=True)
class ForkServerEvent:
    """A report of the server.

    Attributes:
        event: ``preloaded``, ``started``, ``exited`` or ``refused``.
        request: number of the request, for ``started`` and ``refused``.
        process_id: of the child.
        status: wait status of ``exited``, as ``os.waitpid`` returns it; None if unknown.
        text: reason of ``refused``; missing modules of ``preloaded``.
        threads: threads of the server after ``preloaded``. A fork needs 1.
    """

    event: str
    request: int = 0
    process_id: int = 0
    status: int | None = 0
    text: str = ""
    threads: int = 0


class ForkServer:
    """Client of the server, made by ``start``. It blocks only in ``close``."""

    def __init__(self, sock: socket.socket, process_id: int, process: subprocess.Popen[bytes] | None) -> None:
        self.process_id = process_id
        self._frames = FrameSocket(sock)
        self._process = process
        self._requests = 0
        self._reaped = False

    def fileno(self) -> int:
        """Descriptor for a selector."""
        return self._frames.fileno()

    def ask(self, operation: str, descriptors: Sequence[int] = (), **values: object) -> int:
        """Sends a request and returns its number.

        Args:
            operation: ``fork`` (values ``title`` and ``modules``, which the server imports first) or
                ``execute`` (values ``arguments`` and ``environment``).
            descriptors: control socket, standard output and standard error of the child. An executed program
                gets the control socket as its descriptor 3.

        Raises:
            EndOfStreamError: the server is gone.
        """
        self._requests += 1
        request = {"operation": operation, "request": self._requests, **values}
        payload = json.dumps({**request, "descriptors": len(descriptors)}).encode()
        if not self._frames.send(payload, descriptors):
            # The server is loading modules. Requests are small, and it reads them soon.
            select.select([], [self._frames.fileno()], [], 1.0)
            self._frames.flush()
        return self._requests

    def receive(self) -> list[ForkServerEvent]:
        """Reports of the server. Raises EndOfStreamError when it is gone."""
        try:
            return [ForkServerEvent(**json.loads(payload)) for payload in self._frames.receive()]
        except (FrameError, ValueError, TypeError) as error:
            raise EndOfStreamError(f"the fork server sent an invalid message: {error}") from error

    def close(self) -> None:
        """Stops the server, which kills its children, and waits for its end. Idempotent."""
        self._frames.close()
        if self._reaped:
            return
        if not self._requests:  # it has no children, and may still load modules for a while
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.process_id, signal.SIGKILL)
        deadline_s = time.monotonic() + CLOSE_TIMEOUT_S
        while not self._reap():
            if time.monotonic() > deadline_s:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(self.process_id, 9)
                deadline_s = time.monotonic() + CLOSE_TIMEOUT_S
            time.sleep(0.002)

    def _reap(self) -> bool:
        if not self._reaped:
            if self._process is not None:
                self._reaped = self._process.poll() is not None
            else:
                try:
                    self._reaped = os.waitpid(self.process_id, os.WNOHANG)[0] != 0
                except ChildProcessError:
                    self._reaped = True
        return self._reaped


def start(*, preload: bool = True) -> ForkServer:
    """Starts the server and returns at once. It loads modules while the caller continues.

    A caller without threads is forked, which takes milliseconds. A fork of one with threads could copy a
    held lock, so the server then runs in a fresh interpreter.

    Args:
        preload: import the heavy modules.
    """
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # for programs that nodes and this start
    without_pydantic_plugins()
    ours, theirs = socket.socketpair()
    # Pending until the server ignores them.
    former = signal.pthread_sigmask(signal.SIG_BLOCK, IGNORED_SIGNALS)
    try:
        if not _single_threaded():
            process = _execute_server(theirs, preload)
            return ForkServer(ours, process.pid, process)
        if preload:
            import joshua.ipc.messages  # noqa: F401 (both processes need it and what it imports: loaded once)
        parent_id = os.getpid()
        process_id = os.fork()
        if process_id == 0:
            _serve_forked(ours, theirs, parent_id, preload)
        return ForkServer(ours, process_id, None)
    finally:
        theirs.close()
        signal.pthread_sigmask(signal.SIG_SETMASK, former)


def _single_threaded() -> bool:
    try:
        return len(os.listdir("/proc/self/task")) == 1  # noqa: PTH208 (nothing heavier than os is loaded)
    except OSError:
        import threading

        return threading.active_count() == 1


def _serve_forked(ours: socket.socket, theirs: socket.socket, parent_id: int, preload: bool) -> None:
    """Turns the fork into the server; never returns."""
    code = 70
    try:
        ours.close()
        from joshua.supervisor.fork_server_process import serve

        code = serve(theirs, parent_id, preload=preload)
    except BaseException as error:  # noqa: BLE001 (the process ends here, whatever it was)
        os.write(2, f"the fork server failed: {error!r}\n".encode())
    finally:
        os._exit(code)


def _execute_server(theirs: socket.socket, preload: bool) -> subprocess.Popen[bytes]:
    import subprocess  # the fork, which is the usual way, has no use for it

    arguments = [str(theirs.fileno()), str(os.getpid()), str(preload), *sys.path]
    return subprocess.Popen(
        [sys.executable, "-m", "joshua.supervisor.fork_server_process", *arguments],
        pass_fds=[theirs.fileno()],
        stdin=subprocess.DEVNULL,
    )
