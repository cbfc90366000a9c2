"""RPLIDAR's standard scan: nodes of 5 bytes with two check bits and no checksum.

Node boundaries can be found only from many nodes: at the right offset the check bits of each node match, its
    angle
is within a turn, and the angle advances in small steps.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from joshua_lidar.samples import MM, NOTHING, Samples, samples_of

LENGTH = 5

#: Nodes in a row that establish the node boundaries.
SYNC_RUN = 32

_UNITS = 360 * 64  # of an angle in a turn
_BACKWARDS, _FORWARDS = 3 * 64, 20 * 64  # steps of the angle from node to node that are possible


class StandardParser:
    """Parser of the RPLIDAR's standard scan (answer type 0x81)."""

    def __init__(self, sync_run: int = SYNC_RUN) -> None:
        self.packets = 0
        self.damaged = 0
        self._sync_run = sync_run
        self._buffer = b""
        self._offset = 0
        self._in_step = False

    def feed(self, data: bytes) -> Samples:
        """Add bytes; return the measurements that they complete."""
        self._buffer += data
        nodes: list[npt.NDArray[np.uint8]] = []
        starts: list[npt.NDArray[np.int64]] = []
        while self._in_step or self._find_step():
            count = len(self._buffer) // LENGTH
            rows = np.frombuffer(self._buffer, np.uint8, count * LENGTH).reshape(count, LENGTH)
            good = _good(rows[:, 0], rows[:, 1], rows[:, 2])
            whole = count if good.all() else int(np.argmin(good))
            if whole:
                nodes.append(rows[:whole])
                starts.append(self._offset + LENGTH * np.arange(whole))
            self._drop(whole * LENGTH)
            if whole == count:
                break
            self._in_step = False
            self.damaged += 1
            self._drop(1)
        if not nodes:
            return NOTHING
        table, start = np.concatenate(nodes), np.concatenate(starts)
        self.packets += len(table)
        angle = np.radians(_angle(table[:, 1], table[:, 2]) / 64)
        quarters = table[:, 3].astype(np.int64) | table[:, 4].astype(np.int64) << 8
        return samples_of(angle, quarters * (MM / 4), (table[:, 0] >> 2).astype(float), start + LENGTH)

    def _find_step(self) -> bool:
        """Drop bytes up to the first node of a good run; return False if there is none yet."""
        need = self._sync_run * LENGTH
        size = len(self._buffer)
        if size < need:
            return False
        line = np.frombuffer(self._buffer, np.uint8)
        good = _good(line[:-2], line[1:-1], line[2:])
        angle = _angle(line[1:-1], line[2:])
        step = (angle[LENGTH:] - angle[:-LENGTH] + _BACKWARDS) % _UNITS
        linked = good[:-LENGTH] & good[LENGTH:] & (step <= _BACKWARDS + _FORWARDS)
        # an offset fits if it and the following nodes are linked: count them in steps of one node
        places = size - need + 1
        fits = np.ones(places, bool)
        for number in range(self._sync_run - 1):
            fits &= linked[number * LENGTH : number * LENGTH + places]
        if not fits.any():
            self._drop(places)
            return False
        self._drop(int(np.argmax(fits)))
        self._in_step = True
        return True

    def _drop(self, count: int) -> None:
        self._buffer = self._buffer[count:]
        self._offset += count


def _good(
    first: npt.NDArray[np.uint8], second: npt.NDArray[np.uint8], third: npt.NDArray[np.uint8]
) -> npt.NDArray[np.bool_]:
    check = ((first ^ first >> 1) & second & 1).astype(bool)
    inside: npt.NDArray[np.bool_] = check & (_angle(second, third) < _UNITS)
    return inside


def _angle(second: npt.NDArray[np.uint8], third: npt.NDArray[np.uint8]) -> npt.NDArray[np.int64]:
    return second.astype(np.int64) >> 1 | third.astype(np.int64) << 7
