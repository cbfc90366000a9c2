"""One child process: control socket, lines of its standard streams, process id, end."""

from __future__ import annotations

import contextlib
import os
import socket
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from joshua.ipc.frames import EndOfStreamError, FrameError, FrameSocket
from joshua.ipc.line_budget import LineBudget
from joshua.ipc.messages import Message, ToSupervisor, decode_for_supervisor, encode
from joshua.supervisor.fork_server import ForkServerEvent
from joshua.supervisor.launcher import Launcher, child_arguments
from joshua.supervisor.reactor import Reactor

#: Bytes kept of one line.
MAX_LINE_BYTES = 4096

READ_BYTES = 65536

#: Last lines of standard error that are kept to explain a crash.
KEPT_ERROR_LINES = 12


class LinePipe:
    """The reading end of one standard stream. It never blocks.

    Args:
        descriptor: reading end of a pipe. This object owns it.
        budget: lines allowed, shared by the streams of a process.
        on_line: called with each line, without its end.
    """

    def __init__(self, descriptor: int, budget: LineBudget, on_line: Callable[[str], None]) -> None:
        os.set_blocking(descriptor, False)
        self.descriptor = descriptor
        self._budget = budget
        self._on_line = on_line
        self._partial = b""
        self._cut_bytes = 0

    def read(self) -> bool:
        """Reads once, a bounded amount. Returns False at the end of the stream."""
        try:
            data = os.read(self.descriptor, READ_BYTES)
        except BlockingIOError:
            return True
        except OSError:
            data = b""
        if data:
            self._split(data)
        else:
            self._finish_line()
        return bool(data)

    def drain(self) -> None:
        """Reads what is left at the end of the child, without waiting for a grandchild that still writes."""
        for _ in range(64):
            with contextlib.suppress(OSError):
                if data := os.read(self.descriptor, READ_BYTES):
                    self._split(data)
                    continue
            break
        self._finish_line()

    def close(self) -> None:
        """Closes the pipe. Idempotent."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1

    def _split(self, data: bytes) -> None:
        lines = data.count(b"\n")
        if self._budget.drop_if_exhausted(lines):  # in a flood only line ends are counted, which is fast
            if lines:
                self._partial, self._cut_bytes = data[data.rfind(b"\n") + 1 :][:MAX_LINE_BYTES], 0
            return
        *complete, rest = data.split(b"\n")
        for part in complete:
            self._extend(part)
            self._finish_line(always=True)
        self._extend(rest)

    def _extend(self, part: bytes) -> None:
        room = MAX_LINE_BYTES - len(self._partial)
        self._partial += part[:room]
        self._cut_bytes += max(0, len(part) - room)

    def _finish_line(self, *, always: bool = False) -> None:
        line, cut_bytes = self._partial, self._cut_bytes
        self._partial, self._cut_bytes = b"", 0
        if (line or always) and self._budget.take():
            text = line.decode("utf-8", "backslashreplace").rstrip("\r")
            self._on_line(text + (f" … ({cut_bytes} more bytes)" if cut_bytes else ""))


@dataclass(frozen=True)
class Output:
    """A line of ``stdout`` or ``stderr``, or a count of ``dropped`` ones."""

    stream: str
    text: str


#: A message, a line, or a change of the process: ``started``, and at last ``refused`` or ``exited``.
ChildEvent = ToSupervisor | Output | ForkServerEvent


class Child:
    """Starts a process and reports its events until its end.

    Args:
        reactor: the supervisor's loop.
        launcher: starts the process.
        title: name of the process.
        modules: what the fork server imports before it forks, once for all children.
        interpreter: Python that runs it, "" to fork the server.
        tell: called with each event. The end comes after everything that the process wrote.
    """

    def __init__(
        self,
        reactor: Reactor,
        launcher: Launcher,
        title: str,
        modules: tuple[str, ...],
        interpreter: str,
        tell: Callable[[ChildEvent], None],
    ) -> None:
        self.process_id = self._early_signal = 0
        self.ended = False
        self.last_errors: deque[str] = deque(maxlen=KEPT_ERROR_LINES)
        self._reactor = reactor
        self._launcher = launcher
        self._tell = tell
        ours, theirs = socket.socketpair()
        self._frames = FrameSocket(ours)
        self._budget = LineBudget()
        output, output_writer = self._pipe("stdout")
        errors, errors_writer = self._pipe("stderr")
        self._streams = (output, errors)
        inherited = (theirs.fileno(), output_writer, errors_writer)
        reactor.watch(self._frames.fileno(), self._receive)
        if interpreter:
            values = {"arguments": child_arguments(interpreter), "environment": dict(os.environ)}
            launcher.start(self._on_process, inherited, "execute", **values)
        else:
            launcher.start(self._on_process, inherited, "fork", title=title, modules=modules)
        theirs.close()
        os.close(output_writer)
        os.close(errors_writer)

    def send(self, message: Message) -> None:
        """Sends or queues a message. The end of the child is reported elsewhere."""
        with contextlib.suppress(EndOfStreamError):
            if not self._frames.closed and not self._frames.send(encode(message)):
                self._reactor.watch(self._frames.fileno(), self._receive, self._flush)

    def signal(self, number: int) -> None:
        """Sends a signal if the process exists; one that is starting gets it as soon as its id is known."""
        if not self.process_id:
            self._early_signal = number
        elif not self.ended:
            self._launcher.signal(self.process_id, number)

    def report_dropped(self, *, ended: bool = False) -> None:
        """Reports dropped lines, once lines are allowed again or at the end."""
        if lines := self._budget.settle(ended=ended):
            self._tell(Output("dropped", f"{lines} lines of its output dropped: too many in a second"))

    def _on_process(self, event: ForkServerEvent) -> None:
        if event.event == "started":
            self.process_id = event.process_id
            self._tell(event)
            if self._early_signal:
                self.signal(self._early_signal)
            return
        if event.event == "exited":
            for _ in range(1000):
                if self._frames.closed or not self._receive():
                    break
            for stream in self._streams:
                stream.drain()
        if self.ended:
            return
        self.ended = True
        self._close_control()
        for stream in self._streams:
            self._reactor.forget(stream.descriptor)
            stream.close()
        self.report_dropped(ended=True)
        self._tell(event)

    def _pipe(self, name: str) -> tuple[LinePipe, int]:
        reading, writing = os.pipe()
        pipe = LinePipe(reading, self._budget, partial(self._on_line, name))

        def on_readable() -> None:
            if not pipe.read():
                self._reactor.forget(pipe.descriptor)

        self._reactor.watch(reading, on_readable)
        return pipe, writing

    def _on_line(self, stream: str, line: str) -> None:
        if stream == "stderr":
            self.last_errors.append(line)
        self._tell(Output(stream, line))

    def _receive(self) -> bool:
        """Receives messages and returns whether more may follow."""
        try:
            payloads = self._frames.receive()
        except (EndOfStreamError, FrameError):
            self._close_control()
            return False
        for payload in payloads:
            try:
                self._tell(decode_for_supervisor(payload))
            except FrameError as error:
                self._tell(Output("stderr", f"its control channel: {error}"))
        return bool(payloads)

    def _flush(self) -> None:
        try:
            done = self._frames.flush()
        except EndOfStreamError:
            self._close_control()
            return
        if done:
            self._reactor.watch(self._frames.fileno(), self._receive)

    def _close_control(self) -> None:
        if not self._frames.closed:
            self._reactor.forget(self._frames.fileno())
            self._frames.close()
