"""A model that waves, after a while."""

from __future__ import annotations

import os
import threading
import time

import numpy as np
from joshua.api import FloatArray, Model, ModelError, Observation

_HZ = 0.2
_SIZE = 200


class ToyPolicy(Model):
    """Waves by the time of the observation, so that every chunk continues every other one."""

    def load(self) -> None:
        """Begins."""
        if self.settings.fault == "loading":
            raise ModelError("the toy policy has no weights: train it first")
        self._chunks = 0

    def reset(self) -> None:
        """Forgets nothing."""

    def act(self, observation: Observation) -> FloatArray:
        """Returns a chunk of a sine, a little later."""
        self._chunks += 1
        self._work()
        fault = self.settings.fault if self._chunks > 2 else ""
        if fault == "die":
            os._exit(9)
        if fault == "hang":
            time.sleep(3600)
        steps = np.arange(self.settings.chunk_steps or 50) / (self.settings.rate_hz or 30.0)
        began = 0.0 if self.settings.fault == "restart" else observation.stamp_ns / 1e9 % (1 / _HZ)
        wave = 0.4 * np.sin(2 * np.pi * _HZ * (began + steps))
        chunk = np.repeat(wave[:, None], len(self.joints.names) + (fault == "shape"), axis=1)
        if fault == "nan":
            chunk[0] = np.nan
        return chunk

    def close(self) -> None:
        """Nothing to free."""

    def _work(self) -> None:
        end_s = time.monotonic() + self.settings.latency_s
        if self.settings.work != "compute":
            time.sleep(self.settings.latency_s)
            return
        count = os.cpu_count() or 1
        threads = [threading.Thread(target=_compute, args=(end_s,)) for _ in range(count)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()


def _compute(end_s: float) -> None:
    matrix = np.random.default_rng(0).normal(size=(_SIZE, _SIZE))
    while time.monotonic() < end_s:
        matrix = matrix @ matrix
        matrix /= np.abs(matrix).max()
