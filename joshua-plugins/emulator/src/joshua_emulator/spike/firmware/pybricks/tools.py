"""Time."""

import time

from pybricks.wire import look


def ticks_ms():
    """Milliseconds of a clock that only goes forward."""
    return time.ticks_ms()


class StopWatch:
    """A clock that starts at zero."""

    def __init__(self):
        self._start = time.ticks_ms()

    def time(self):
        """Milliseconds since the start."""
        look()
        return time.ticks_diff(time.ticks_ms(), self._start)


def wait(time_ms):
    """Waits."""
    look()
    time.sleep_ms(time_ms)
