"""Costs of messages on a Ray cluster of this machine, and jobs a second from 1 to N workers."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from joshua_jobs.choice import opened
from joshua_jobs.executor import Executor


def nothing(_: int) -> None:
    """Do nothing."""


def asleep(_: int) -> None:
    """Wait, as for a simulator elsewhere."""
    time.sleep(0.05)


def busy(_: int) -> float:
    """Compute for about 50 ms."""
    return float(sum(np.sin(np.arange(20_000.0)).sum() for _ in range(200)))


class Echo:
    """An object that gives back what it gets."""

    def back(self, value: Any) -> Any:
        """Return a value."""
        return value


def rate(executor: Executor, function: Callable[[int], Any], count: int) -> float:
    """Return jobs per second."""
    list(executor.in_order(function, range(4 * executor.workers)))
    began_s = time.perf_counter()
    list(executor.in_order(function, range(count)))
    return count / (time.perf_counter() - began_s)


def main() -> None:
    """Run all measurements."""
    cores = len(os.sched_getaffinity(0))
    print(f"load {os.getloadavg()[0]:.1f}, {cores} cores", flush=True)
    for workers in (None, *range(1, cores + 1)):
        with opened(("ray", "local"), workers) as executor:
            if workers is None:
                crew = executor.crew(Echo, [()])
                for size in (0, 100_000, 1_000_000, 10_000_000):
                    value, count = np.zeros(size, np.uint8), 200 if size < 1_000_000 else 20
                    crew.each("back", [(value,)])
                    began_s = time.perf_counter()
                    for _ in range(count):
                        crew.each("back", [(value,)])
                    took_ms = 1e3 * (time.perf_counter() - began_s) / count
                    print(f"call there and back, {size} bytes: {took_ms:.2f} ms", flush=True)
                crew.close()
            rates = [f"{name} {rate(executor, job, n):.1f}/s" for name, job, n in JOBS]
            print(f"{workers or 'all'} workers: {', '.join(rates)}", flush=True)


JOBS = (("empty", nothing, 500), ("sleep of 50 ms", asleep, 80), ("computing", busy, 80))

if __name__ == "__main__":
    main()
