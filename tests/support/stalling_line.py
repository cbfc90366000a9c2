"""A line in virtual time, on which the machine stalls at any point of a request."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st
from stepped_time import SteppedTime
from virtual_line import Line

#: Where it begins (number of the call of the line), how long it is, whether it delays the servos, too, and
#: whether the process waits in a run queue. The system does not tell how long a process was stopped.
STALLS = st.tuples(st.integers(0, 40), st.floats(0.1, 1.0), st.booleans(), st.booleans())


class StallingLine(Line):
    """A line whose calls may be delayed before and after.

    Attributes:
        stalls: duration, servos too, in a run queue, by the number of the call.
        waited_s: in a run queue; stalled_s: in all stalls; stopped: number of stalls outside of a run queue.
        sent_s: times of the requests, without stalls.
    """

    def __init__(self, emulated: Any, clock: SteppedTime) -> None:
        super().__init__(emulated, clock)
        self.stalls: dict[int, tuple[float, bool, bool]] = {}
        self.calls = 0
        self.waited_s = self.stalled_s = 0.0
        self.stopped = 0
        self.sent_s: list[float] = []

    def stall(self) -> None:
        """Delay this process, if it is time."""
        length_s, servos_too, in_queue = self.stalls.pop(self.calls, (0.0, False, True))
        self.calls += 1
        self.stalled_s += length_s
        self.waited_s += length_s * in_queue
        self.stopped += not in_queue
        now_s = self._clock.monotonic()
        if servos_too:
            coming = self._coming
            self._coming = [(due + length_s * (due > now_s), order, data) for due, order, data in coming]
        self._clock.sleep(length_s)

    def send(self, data: bytes) -> None:
        self.stall()
        self.sent_s.append(self._clock.monotonic() - self.stalled_s)
        super().send(data)
        self.stall()

    def receive(self, size: int, deadline_s: float) -> bytes:
        self.stall()
        return super().receive(size, deadline_s)

    def awake_s(self) -> float:
        """Time in which the process was not stalled."""
        return self._clock.monotonic() - self.stalled_s
