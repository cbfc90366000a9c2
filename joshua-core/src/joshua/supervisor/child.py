"""One child process as the supervisor sees it: control socket, lines of its streams, process id, end."""

from __future__ import annotations

import contextlib
import os
import socket
from collections import deque
from collections.abc import Callable
from typing import Protocol

from joshua.ipc.frames import EndOfStreamError, FrameError, FrameSocket
from joshua.ipc.line_budget import LineBudget
from joshua.ipc.messages import Message, ToSupervisor, decode_for_supervisor, encode
from joshua.supervisor.launcher import Launcher, child_arguments
from joshua.supervisor.reactor import Reactor

#: Bytes kept of one line.
MAX_LINE_BYTES = 4096

READ_BYTES = 65536


class LinePipe:
    """The reading end of one standard stream; never blocks.

    Args:
        descriptor: reading end of a pipe; this object owns it from now on.
        budget: lines that may pass; shared by the streams of a process.
        on_line: called with each line, without its end.
        on_dropped: called with the number of lines that were dropped before the next one.
        on_flood: called whenever lines are dropped.
    """

    def __init__(
        self,
        descriptor: int,
        budget: LineBudget,
        on_line: Callable[[str], None],
        on_dropped: Callable[[int], None],
        on_flood: Callable[[], None],
    ) -> None:
        os.set_blocking(descriptor, False)
        self.descriptor = descriptor
        self._budget = budget
        self._on_line = on_line
        self._on_dropped = on_dropped
        self._on_flood = on_flood
        self._partial = b""
        self._cut_bytes = 0

    def read(self) -> bool:
        """Reads once, a bounded amount; returns False at the end of the stream."""
        try:
            data = os.read(self.descriptor, READ_BYTES)
        except BlockingIOError:
            return True
        except OSError:
            data = b""
        if not data:
            self._finish_line()
            return False
        self._split(data)
        return True

    def drain(self) -> None:
        """Reads what is there, at the end of the child; a grandchild that writes on is not waited for."""
        for _ in range(64):
            try:
                data = os.read(self.descriptor, READ_BYTES)
            except OSError:
                break
            if not data:
                break
            self._split(data)
        self._finish_line()

    def close(self) -> None:
        """Closes the pipe; a second call does nothing."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1

    def _split(self, data: bytes) -> None:
        if self._budget.exhausted:
            # Only the line ends matter, and counting them is fast.
            lines = data.count(b"\n")
            self._budget.drop(lines)
            self._on_flood()
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
        if not line and not always:
            return
        allowed, dropped = self._budget.take()
        if dropped:
            self._on_dropped(dropped)
        if allowed:
            text = line.decode("utf-8", "backslashreplace").rstrip("\r")
            self._on_line(text + (f" … ({cut_bytes} more bytes)" if cut_bytes else ""))


#: Last lines of standard error that are kept to explain a crash.
KEPT_ERROR_LINES = 12

#: After this time a flood is reported even if no further line comes.
SETTLE_S = 1.1


class ChildListener(Protocol):
    """Who hears of a child."""

    def on_message(self, message: ToSupervisor) -> None:
        """A message of the child."""

    def on_output(self, stream: str, line: str) -> None:
        """A line that the child wrote to ``stdout`` or ``stderr``."""

    def on_output_dropped(self, lines: int) -> None:
        """Lines that the flood limit dropped."""

    def on_running(self, process_id: int) -> None:
        """The process exists."""

    def on_end(self, status: int | None, refusal: str) -> None:
        """The process has ended and everything it said has been heard.

        Args:
            status: wait status, None if unknown.
            refusal: why it never ran; "" if it did.
        """


class Child:
    """Starts a process and listens to it until its end.

    Args:
        reactor: the supervisor's loop.
        launcher: starts the process.
        title: name of the process.
        interpreter: Python that runs it; "" forks the server.
        listener: who hears of it.
    """

    def __init__(
        self, reactor: Reactor, launcher: Launcher, title: str, interpreter: str, listener: ChildListener
    ) -> None:
        self.process_id = 0
        self.ended = False
        self.last_errors: deque[str] = deque(maxlen=KEPT_ERROR_LINES)
        self._reactor = reactor
        self._launcher = launcher
        self._listener = listener
        self._interpreter = interpreter
        ours, theirs = socket.socketpair()
        self._frames = FrameSocket(ours)
        self._budget = LineBudget()
        self._settling = False
        output = self._pipe("stdout")
        error = self._pipe("stderr")
        self._streams = (output[0], error[0])
        inherited = (theirs.fileno(), output[1], error[1])
        reactor.watch(self._frames.fileno(), self._receive)
        if interpreter:
            launcher.execute(self, child_arguments(interpreter), os.environ, inherited)
        else:
            launcher.fork(self, title, inherited)
        theirs.close()
        os.close(output[1])
        os.close(error[1])

    def send(self, message: Message) -> None:
        """Sends a message or queues it; a child that has gone is heard of elsewhere."""
        with contextlib.suppress(EndOfStreamError):
            if not self._frames.closed and not self._frames.send(encode(message)):
                self._reactor.watch(self._frames.fileno(), self._receive, self._flush)

    def signal(self, number: int) -> None:
        """Sends a signal if the process exists."""
        if self.process_id and not self.ended:
            self._launcher.signal(self.process_id, number)

    def on_started(self, process_id: int) -> None:
        """The launcher has started the process."""
        self.process_id = process_id
        self._listener.on_running(process_id)

    def on_refused(self, text: str) -> None:
        """The process could not be started."""
        self._finish(None, text)

    def on_exited(self, status: int | None) -> None:
        """The process has ended: hear the rest of what it said, then tell."""
        for _ in range(1000):
            if self._frames.closed or not self._receive():
                break
        for stream in self._streams:
            stream.drain()
        self._finish(status, "")

    def _pipe(self, stream: str) -> tuple[LinePipe, int]:
        reading, writing = os.pipe()

        def on_line(line: str) -> None:
            if stream == "stderr":
                self.last_errors.append(line)
            self._listener.on_output(stream, line)

        pipe = LinePipe(reading, self._budget, on_line, self._listener.on_output_dropped, self._on_flood)

        def on_readable() -> None:
            if not pipe.read():
                self._reactor.forget(pipe.descriptor)

        self._reactor.watch(reading, on_readable)
        return pipe, writing

    def _receive(self) -> bool:
        """Takes messages; returns whether more may come."""
        try:
            payloads = self._frames.receive()
        except (EndOfStreamError, FrameError):
            self._close_control()
            return False
        for payload in payloads:
            try:
                self._listener.on_message(decode_for_supervisor(payload))
            except FrameError as error:
                self._listener.on_output("stderr", f"its control channel: {error}")
        return bool(payloads)

    def _flush(self) -> None:
        try:
            done = self._frames.flush()
        except EndOfStreamError:
            self._close_control()
            return
        if done:
            self._reactor.watch(self._frames.fileno(), self._receive)

    def _on_flood(self) -> None:
        """Makes sure that a flood which ends without another line is still reported."""
        if not self._settling:
            self._settling = True
            self._reactor.call_later(SETTLE_S, self._settle)

    def _settle(self) -> None:
        self._settling = False
        if not self.ended:
            self._report_dropped(self._budget.settle())

    def _report_dropped(self, lines: int) -> None:
        if lines:
            self._listener.on_output_dropped(lines)

    def _close_control(self) -> None:
        if not self._frames.closed:
            self._reactor.forget(self._frames.fileno())
            self._frames.close()

    def _finish(self, status: int | None, refusal: str) -> None:
        if self.ended:
            return
        self.ended = True
        self._close_control()
        for stream in self._streams:
            self._reactor.forget(stream.descriptor)
            stream.close()
        self._report_dropped(self._budget.close())
        self._listener.on_end(status, refusal)
