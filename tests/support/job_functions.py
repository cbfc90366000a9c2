"""Functions that worker processes import by name."""

from __future__ import annotations

import os
import signal


def squared(number: int) -> int:
    if number == 3:
        raise ValueError("three")
    return number * number


def process_of(_: int) -> int:
    return os.getpid()


class Counter:
    def __init__(self, start: int) -> None:
        self.value = start

    def add(self, number: int) -> int:
        self.value += number
        return self.value


def killed(number: int) -> int:
    """The number; 3 ends the process as a machine without memory does."""
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number
