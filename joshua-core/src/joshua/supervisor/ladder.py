"""The stop ladder: stop request, SIGTERM, SIGKILL, with logged times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from joshua.supervisor.reactor import Reactor, ReactorTimer


class Rung(Enum):
    """One step of the ladder."""

    REQUEST = "stop request"
    TERMINATE = "SIGTERM"
    KILL = "SIGKILL"


@dataclass(frozen=True)
class LadderTimes:
    """How long each rung may take.

    Attributes:
        request_s: from the stop request to SIGTERM; terminate_s: from SIGTERM to SIGKILL.
    """

    request_s: float = 3.0
    terminate_s: float = 1.0


#: For a process that has hung: it is asked, but not waited for.
HANG_TIMES = LadderTimes(request_s=0.3, terminate_s=0.2)


class StopLadder:
    """Climbs the rungs for one process until it is told that the process has ended.

    Args:
        reactor: for the times.
        times: how long each rung may take.
        act: performs a rung; gets the rung and the seconds since the first one.
    """

    def __init__(self, reactor: Reactor, times: LadderTimes, act: Callable[[Rung, float], None]) -> None:
        self._reactor = reactor
        self._times = times
        self._act = act
        self._timer: ReactorTimer | None = None
        self._began_s = 0.0
        self.rung: Rung | None = None

    @property
    def begun(self) -> bool:
        """Whether the first rung has been taken."""
        return self.rung is not None

    def begin(self, times: LadderTimes | None = None) -> None:
        """Takes the first rung; a second call does nothing."""
        if self.begun:
            return
        self._times = times or self._times
        self._began_s = self._reactor.now_s()
        self._take(Rung.REQUEST, self._times.request_s, self._terminate)

    def kill(self) -> None:
        """Jumps to the last rung."""
        if self.rung is Rung.KILL:
            return
        if not self.begun:
            self._began_s = self._reactor.now_s()
        self._take(Rung.KILL, None, None)

    def ended(self) -> None:
        """The process has ended: no further rung."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _terminate(self) -> None:
        self._take(Rung.TERMINATE, self._times.terminate_s, self.kill)

    def _take(self, rung: Rung, patience_s: float | None, then: Callable[[], None] | None) -> None:
        self.ended()
        self.rung = rung
        if patience_s is not None and then is not None:
            self._timer = self._reactor.call_later(patience_s, then)
        self._act(rung, self._reactor.now_s() - self._began_s)
