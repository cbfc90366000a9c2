"""Aligns streams with times of their own to frames at one rate, by the time of acquisition."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal, NamedTuple

from joshua.features.frame import Array, Frame

NS_PER_S = 1_000_000_000

#: Distance of a stamp from the next frame, beyond a period and the wait, at which its clock counts as jumped.
HORIZON_NS = 2 * NS_PER_S


@dataclass(frozen=True)
class Alignment:
    """How the aligner finds the value of a feature at the time of a frame.

    Attributes:
        tolerance_ns: largest distance of a sample from the frame.
        method: the nearest sample, or linear interpolation between the samples before and after the frame.
            The nearer of them must be within the tolerance, and they may be at most two tolerances apart.
    """

    tolerance_ns: int
    method: Literal["nearest", "interpolated"] = "nearest"


@dataclass
class FeatureCounts:
    """What happened to the samples of one feature.

    Attributes:
        received: samples; used: frames with a value; missing: frames without one.
        repeated: frames whose value is the sample of the previous frame.
        late: samples that arrived after their frame was complete.
        out_of_order: samples older than an earlier one; duplicates: samples with the stamp of an earlier one.
        jumped: samples with a stamp from another clock, see ``HORIZON_NS``.
        worst_ns: largest distance of a used sample from its frame.
    """

    received: int = 0
    used: int = 0
    missing: int = 0
    repeated: int = 0
    late: int = 0
    out_of_order: int = 0
    duplicates: int = 0
    jumped: int = 0
    worst_ns: int = 0


class _Sample(NamedTuple):
    stamp_ns: int
    value: Array


class TimeAligner:
    """Aligns streams to a rate. Transports' threads call ``push``, one other thread calls ``poll``.

    The times of the frames form a grid that begins at ``start``. A frame is complete when every feature has a
    sample at or after its time, at the latest ``wait_ns`` after that time. A feature without a sample within
    its tolerance is ``missing`` in the frame and is not filled in. For each pending frame, at most two
    samples of a stream are kept, the first and the last, which bounds the memory.

    Args:
        alignments: by feature. Every frame has these features.
        rate_hz: frames per second.
        wait_ns: how long a frame waits for its samples; None for the largest tolerance.

    Raises:
        ValueError: the rate or a tolerance is not positive.

    Attributes:
        counts: by feature, since the aligner was made.
        jumps: how often the clock of ``poll`` jumped and the grid was restarted.
        skipped: frames that were dropped for that reason.
    """

    def __init__(
        self, alignments: Mapping[str, Alignment], rate_hz: float, *, wait_ns: int | None = None
    ) -> None:
        if not (0 < rate_hz < NS_PER_S) or any(a.tolerance_ns <= 0 for a in alignments.values()):
            raise ValueError("rate and tolerances must be above zero")
        self._alignments = dict(alignments)
        self._rate = Fraction(rate_hz).limit_denominator(1_000_000)
        tolerances = [alignment.tolerance_ns for alignment in alignments.values()]
        self._wait_ns = max(tolerances, default=0) if wait_ns is None else wait_ns
        self._horizon_ns = HORIZON_NS + self._wait_ns + round(NS_PER_S / rate_hz)
        self._lock = threading.Lock()
        self._newest: dict[str, _Sample] = {}
        # samples by the number of the frame that they follow; the time of frame k is origin + k / rate
        self._cells: dict[str, dict[int, list[_Sample]]] = {key: {} for key in alignments}
        self._origin_ns: int | None = None
        self._next = 0
        self._now_ns = 0
        self._last = Frame(0)
        self.counts = {key: FeatureCounts() for key in alignments}
        self.jumps = self.skipped = 0

    def start(self, at_ns: int) -> None:
        """Restarts the grid of frames at a time. Samples from shortly before are kept."""
        with self._lock:
            self._start(at_ns)

    def stop(self) -> None:
        """Stops making frames until ``start`` or ``poll``. The newest samples are still kept."""
        with self._lock:
            self._origin_ns = None
            for cells in self._cells.values():
                cells.clear()

    def push(self, key: str, stamp_ns: int, value: Array) -> None:
        """Adds a sample, in any order. The value is not copied.

        Args:
            key: of a feature of this aligner, else KeyError; stamp_ns: time of acquisition, ns since the
            epoch.
        """
        with self._lock:
            counts, sample = self.counts[key], _Sample(stamp_ns, value)
            counts.received += 1
            if self._origin_ns is not None and abs(stamp_ns - self._time(self._next)) > self._horizon_ns:
                counts.jumped += 1
                return
            newest = self._newest.get(key)
            if newest is None or stamp_ns > newest.stamp_ns:
                self._newest[key] = sample
            elif stamp_ns == newest.stamp_ns:
                counts.duplicates += 1
                return
            elif newest.stamp_ns - stamp_ns > HORIZON_NS:
                # the stamps of the stream went back before the grid began
                counts.jumped += 1
                self._newest[key] = sample
            else:
                counts.out_of_order += 1
            if self._origin_ns is not None:
                self._keep(key, sample, counts)

    def poll(self, now_ns: int) -> list[Frame]:
        """Returns the frames that are complete or have waited long enough.

        Args:
            now_ns: on the clock of the stamps.
        """
        with self._lock:
            if self._origin_ns is None:
                self._start(now_ns)
            ahead_ns = now_ns - self._time(self._next) - self._wait_ns
            if ahead_ns > HORIZON_NS or self._now_ns - now_ns > HORIZON_NS:
                self.jumps += 1
                self.skipped += max(0, ahead_ns * self._rate // NS_PER_S)
                self._start(now_ns)
            self._now_ns = now_ns
            frames = []
            while (at_ns := self._time(self._next)) <= now_ns and (
                now_ns >= at_ns + self._wait_ns or self._is_complete()
            ):
                frames.append(self._frame(at_ns))
                self._next += 1
                for cells in self._cells.values():
                    _forget(cells, self._next)
            return frames

    def newest(self, now_ns: int) -> Frame:
        """Returns the newest sample of each feature, for a policy that acts when ready. Keeps the grid.

        A feature is missing if its sample is further from ``now_ns`` than the tolerance.
        """
        with self._lock:
            fresh = {
                key: sample
                for key, sample in self._newest.items()
                if abs(now_ns - sample.stamp_ns) <= self._alignments[key].tolerance_ns
            }
            return _frame_of(now_ns, fresh, tuple(key for key in self._alignments if key not in fresh))

    def _time(self, number: int) -> int:
        assert self._origin_ns is not None
        return self._origin_ns + number * NS_PER_S * self._rate.denominator // self._rate.numerator

    def _start(self, at_ns: int) -> None:
        self._origin_ns, self._next, self._now_ns, self._last = at_ns, 0, at_ns, Frame(at_ns)
        for key, cells in self._cells.items():
            cells.clear()
            newest = self._newest.get(key)
            if newest is not None and abs(newest.stamp_ns - at_ns) <= self._horizon_ns:
                cells[self._cell(newest.stamp_ns)] = [newest]
            else:
                self._newest.pop(key, None)

    def _cell(self, stamp_ns: int) -> int:
        """Number of the last frame at or before a time."""
        assert self._origin_ns is not None
        number = (stamp_ns - self._origin_ns) * self._rate.numerator // (NS_PER_S * self._rate.denominator)
        return number + (self._time(number + 1) <= stamp_ns)

    def _keep(self, key: str, sample: _Sample, counts: FeatureCounts) -> None:
        number, cells = self._cell(sample.stamp_ns), self._cells[key]
        kept = cells.setdefault(number, [])
        if any(other.stamp_ns == sample.stamp_ns for other in kept):
            counts.duplicates += 1
            counts.out_of_order -= 1
            return
        distance_ns = abs(sample.stamp_ns - self._last.stamp_ns)
        within = distance_ns <= self._alignments[key].tolerance_ns
        if number < self._next - 1 or (within and key in self._last.missing):
            counts.late += 1
        kept.append(sample)
        kept.sort(key=lambda other: other.stamp_ns)
        del kept[1:-1]
        _forget(cells, self._next)

    def _is_complete(self) -> bool:
        at_ns = self._time(self._next)
        return all(
            (newest := self._newest.get(key)) is not None and newest.stamp_ns >= at_ns for key in self._cells
        )

    def _frame(self, at_ns: int) -> Frame:
        chosen: dict[str, _Sample] = {}
        missing = []
        for key, alignment in self._alignments.items():
            counts = self.counts[key]
            found = _aligned(self._cells[key], self._next, at_ns, alignment)
            if found is None:
                counts.missing += 1
                missing.append(key)
                continue
            chosen[key] = found
            counts.used += 1
            counts.repeated += self._last.stamps_ns.get(key) == found.stamp_ns
            counts.worst_ns = max(counts.worst_ns, abs(found.stamp_ns - at_ns))
        self._last = _frame_of(at_ns, chosen, tuple(missing))
        return self._last


def _frame_of(at_ns: int, samples: Mapping[str, _Sample], missing: tuple[str, ...]) -> Frame:
    return Frame(
        at_ns,
        {key: sample.value for key, sample in samples.items()},
        {key: sample.stamp_ns for key, sample in samples.items()},
        missing,
    )


def _forget(cells: dict[int, list[_Sample]], upcoming: int) -> None:
    """Drops samples that no frame from ``upcoming`` on can use: all earlier ones except the newest."""
    past = sorted(number for number in cells if number < upcoming)
    for number in past[:-1]:
        del cells[number]
    if past:
        del cells[past[-1]][:-1]


def _aligned(
    cells: Mapping[int, list[_Sample]], number: int, at_ns: int, alignment: Alignment
) -> _Sample | None:
    """The value at the time of a frame; None if no sample is near enough."""
    before = max((s for n, kept in cells.items() if n < number for s in kept[-1:]), default=None)
    after_cell = min((n for n in cells if n >= number), default=None)
    after = cells[after_cell][0] if after_cell is not None else None
    around = [sample for sample in (before, after) if sample is not None]
    if not around:
        return None
    nearest = min(around, key=lambda sample: abs(sample.stamp_ns - at_ns))
    if abs(nearest.stamp_ns - at_ns) > alignment.tolerance_ns:
        return None
    if alignment.method == "nearest" or nearest.stamp_ns == at_ns:
        return nearest
    if before is None or after is None or after.stamp_ns - before.stamp_ns > 2 * alignment.tolerance_ns:
        return None
    part = (at_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
    value = before.value * (1 - part) + after.value * part
    return _Sample(nearest.stamp_ns, value.astype(before.value.dtype, copy=False))
