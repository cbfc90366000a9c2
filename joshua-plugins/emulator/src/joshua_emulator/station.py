"""The event loop of an emulator: bytes in, timed replies out, and the control channel."""

from __future__ import annotations

import heapq
import os
import select
import time
from collections.abc import Callable, Collection
from typing import Protocol

from joshua_emulator.control import ControlServer
from joshua_emulator.event_log import EventLog
from joshua_emulator.pacing import sharpen_timers
from joshua_emulator.pty_line import PtyLine
from joshua_emulator.timers import Timers, wait_s
from joshua_emulator.wire import TimedReply

READ_SIZE = 4096
STREAM_S = 0.004  # polling period of streaming devices
SPIN_S = 60e-6  # busy-wait time before a reply


class Bus(Protocol):
    """A bus protocol behind an emulated adapter."""

    def receive(self, data: bytes, line_speed: int, now_s: float) -> list[TimedReply]:
        """Process bytes from the host. Return the replies and their times."""

    def reset_line(self) -> None:
        """Discard a partial packet."""


class Station:
    """Runs one bus on one line.

    Args:
        burst_window_s: replies whose times lie this close together are handed over in one piece, at the time
            of the last one, as USB adapters do; 0 gives each reply its own time. Nothing is ever early.
    """

    def __init__(
        self,
        bus: Bus,
        line: PtyLine,
        log: EventLog,
        control: ControlServer,
        *,
        burst_window_s: float = 0.0005,
    ) -> None:
        self.bus = bus
        self.line = line
        self.log = log
        self.control = control
        self._burst_window_s = burst_window_s
        self._replies: list[TimedReply] = []
        self._timers = Timers()
        self._overrun = False  # bytes are being lost
        self._stopped = False
        self._away_s = 0.0
        self._away_since_s: float | None = None

    def at(self, delay_s: float, action: Callable[[], object]) -> None:
        """Call ``action`` after a delay, on the loop."""
        self._timers.at(delay_s, action)

    def stream(self, produce: Callable[[float, int], list[TimedReply]], period_s: float = STREAM_S) -> None:
        """Let a device send by itself: each period ``produce`` gets the time and the line speed."""

        def turn() -> None:
            self.at(period_s, turn)
            if self.line.plugged:
                for reply in produce(time.monotonic(), self.line.line_speed()):
                    heapq.heappush(self._replies, reply)

        self.at(0.0, turn)

    def unplug(self) -> None:
        """Unplug the adapter; pending replies are lost."""
        now_s = time.monotonic()
        self._replies.clear()
        self.line.unplug()
        self._away_since_s = self._away_since_s or now_s
        self.log.add("unplug", now_s)

    def replug(self, name: str) -> None:
        """Plug the adapter in again under a device name."""
        self.bus.reset_line()
        self.line.plug(name)
        now_s = time.monotonic()
        self._away_s, self._away_since_s = self.unplugged_s(now_s), None
        self.log.add("plug", now_s, port=str(self.line.port))

    def unplugged_s(self, now_s: float) -> float:
        """How long the adapter was away in all, up to a time of the monotonic clock."""
        return self._away_s + (0.0 if self._away_since_s is None else max(0.0, now_s - self._away_since_s))

    def stop(self) -> None:
        """End ``run`` after the present cycle."""
        self._stopped = True

    def close(self) -> None:
        """Remove the device names and the control socket."""
        self.line.unplug()
        self.control.close()

    def run(self, watched: Collection[int] = ()) -> None:
        """Run until ``stop``, or until one of the ``watched`` file descriptors reaches its end."""
        sharpen_timers()
        while not self._stopped:
            now_s = time.monotonic()
            self._timers.run_due(now_s)
            deadline_s = min(self._deliver(now_s), self._timers.next_s)
            if deadline_s - time.monotonic() <= SPIN_S:
                while time.monotonic() < deadline_s:
                    pass
                continue
            inputs = [*self.control.descriptors()]
            if self.line.plugged:
                inputs.append(self.line.master)
            inputs += watched
            ready, _, _ = select.select(inputs, [], [], wait_s(deadline_s - SPIN_S))
            if self.line.master in ready:
                self._receive()
            if any(not os.read(descriptor, READ_SIZE) for descriptor in watched if descriptor in ready):
                return
            self.control.serve(ready)

    def _receive(self) -> None:
        now_s = time.monotonic()
        try:
            data = os.read(self.line.master, READ_SIZE)
        except (BlockingIOError, InterruptedError):
            return
        for reply in self.bus.receive(data, self.line.line_speed(), now_s):
            heapq.heappush(self._replies, reply)

    def _deliver(self, now_s: float) -> float:
        """Hand over the next burst if it is due. Return when the next one is."""
        replies = self._replies
        while replies:
            limit_s = replies[0].due_s + self._burst_window_s
            burst_s = max(reply.due_s for reply in replies if reply.due_s <= limit_s)
            if burst_s > now_s:
                return burst_s
            burst = []
            while replies and replies[0].due_s <= burst_s:
                burst.append(heapq.heappop(replies))
            whole = self._send(b"".join(reply.data for reply in burst))
            now_s = time.monotonic()
            if not whole and not self._overrun:
                self.log.add("overrun", now_s)
            self._overrun = not whole
            self.log.delivered(now_s - burst_s)
        return float("inf")

    def _send(self, data: bytes) -> bool:
        """Put bytes on the line; whether it took all: a host that does not read loses some, as on a UART."""
        try:
            return os.write(self.line.master, data) == len(data)
        except BlockingIOError:
            return False
