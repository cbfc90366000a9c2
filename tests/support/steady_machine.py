"""Whether the machine gave programs their time while something ran that is judged by its rate."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import TypeVar

#: Who wakes up this much late was held up by the machine.
STOOD_STILL_S = 0.05

#: As often a run is begun again that the machine has held up.
ATTEMPTS = 4

Result = TypeVar("Result")


class SteadyMachine:
    """Wakes up every few milliseconds inside its context, and notes how late that was at most."""

    def __init__(self) -> None:
        self.latest_s = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> SteadyMachine:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()

    def _watch(self) -> None:
        before_s = time.monotonic()
        while not self._ended.wait(0.01):
            now_s = time.monotonic()
            self.latest_s = max(self.latest_s, now_s - before_s - 0.01)
            before_s = now_s


def while_steady(run: Callable[[], Result], good: Callable[[Result], bool]) -> Result:
    """Does something whose outcome judges rates; what is bad counts only if the machine went on steadily.

    Returns:
        The first good outcome, or a bad one during which nothing held the machine up.
    """
    for _ in range(ATTEMPTS):
        with SteadyMachine() as machine:
            result = run()
        if good(result) or machine.latest_s < STOOD_STILL_S:
            break
    return result
