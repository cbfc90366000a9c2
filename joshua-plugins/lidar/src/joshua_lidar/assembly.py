"""Assembly of measurements into scans: one per turn, on fixed beams."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from joshua_lidar.samples import NOTHING, Floats, Offsets, Samples, joined

_NS_PER_S = 1_000_000_000
_ROUNDING = 1e-6
_FEWEST_TIMES = 3

#: Pause, in turns, after which the number of turns is unknown.
_LONGEST_GAP_TURNS = 0.4

#: How far, in turns, the line fitted to the times of a turn may extend beyond now; on a busy machine, which
#: reads a turn in two or three chunks, that is a quarter of a turn.
_LARGEST_LEAD_TURNS = 0.5


@dataclass(frozen=True)
class Beams:
    """Beam layout of all scans, as in a LaserScan.

    Attributes:
        angle_min_rad, angle_max_rad: first and last beam; increment_rad: between neighbours.
        count: of beams.
    """

    angle_min_rad: float
    angle_max_rad: float
    increment_rad: float
    count: int

    @staticmethod
    def of(angle_min_rad: float, angle_max_rad: float, beams_per_turn: int) -> Beams:
        """Return the beams from the smallest angle to the end of the window, at most one turn."""
        increment = math.tau / beams_per_turn
        width = angle_max_rad - angle_min_rad
        count = min(math.floor(width / increment + _ROUNDING) + 1, beams_per_turn)
        return Beams(angle_min_rad, angle_min_rad + (count - 1) * increment, increment, count)


@dataclass(frozen=True, eq=False)
class Scan:
    """One turn.

    Attributes:
        stamp_ns: when beam 0 was measured, ns since the epoch.
        time_increment_s: from beam to beam; negative because these scanners turn clockwise.
        turn_s: duration of the turn.
        ranges_m: shape (beams,), float32, by REP 117: -inf is nearer than range_min, +inf is farther than
            range_max, NaN was not measured.
        intensities: shape (beams,), float32, in the scanner's own scale; empty where it sends none.
        points: measurements of the turn, including those outside the window.
    """

    stamp_ns: int
    time_increment_s: float
    turn_s: float
    ranges_m: npt.NDArray[np.float32]
    intensities: npt.NDArray[np.float32]
    points: int

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scan):
            return NotImplemented
        return (
            (self.stamp_ns, self.time_increment_s, self.turn_s, self.points)
            == (other.stamp_ns, other.time_increment_s, other.turn_s, other.points)
            and np.array_equal(self.ranges_m, other.ranges_m, equal_nan=True)
            and np.array_equal(self.intensities, other.intensities)
        )

    __hash__ = None  # type: ignore[assignment]

    def not_later_than(self, now_ns: int) -> Scan | None:
        """Return this scan with a stamp that is not in the future; None if it is off by more than jitter.

        If a turn ends with a packet, its last beam was measured just now, and the line fitted to the times of
        the turn may extend slightly beyond.
        """
        lead_ns = self.stamp_ns - now_ns
        if lead_ns <= 0:
            return self
        within = lead_ns <= _LARGEST_LEAD_TURNS * self.turn_s * _NS_PER_S
        return replace(self, stamp_ns=now_ns) if within else None


class TurnAssembler:
    """Splits the measurements into turns at the end of the window, so time is continuous within a scan.

    Args:
        beams: of each scan; each takes the nearest measurement within the spacing of measurements or beams.
        range_min_m, range_max_m: valid distances.
        seam_rad: largest jitter of the angle between consecutive measurements.
    """

    def __init__(self, beams: Beams, range_min_m: float, range_max_m: float, seam_rad: float = 0.0) -> None:
        self._beams = beams
        self._range_min_m, self._range_max_m = range_min_m, range_max_m
        self._seam_rad = seam_rad
        # A turn begins at the end of the window because the scanner turns clockwise.
        self._top_rad = beams.angle_min_rad + min(math.tau, (beams.count - 0.5) * beams.increment_rad)
        self._beam_turned = self._top_rad - (
            beams.angle_min_rad + beams.increment_rad * np.arange(beams.count)
        )
        self._turn_ns = 0.0
        self.restart()

    def restart(self) -> None:
        """Discard the current turn."""
        self._samples = NOTHING
        self._times: Offsets = np.zeros(0, np.int64)
        self._turned: Floats = np.zeros(0)
        self._next_turn = 1  # the first turn is incomplete
        self._started = False

    def add(self, samples: Samples, times_ns: Offsets) -> list[Scan]:
        """Add measurements; return the scans that they complete.

        Args:
            times_ns: when the packet of each measurement was sent, ns since the epoch.
        """
        if not len(samples):
            return []
        if (
            len(self._times)
            and self._turn_ns
            and times_ns[0] - self._times[-1] > _LONGEST_GAP_TURNS * self._turn_ns
        ):
            self.restart()
        position = np.mod(self._top_rad - samples.angle_rad, math.tau)
        if self._started:
            before, turned = self._turned[-1] % math.tau, self._turned[-1]
        else:
            before, turned = position[0], position[0]
            self._started = True
        step = np.diff(position, prepend=before)
        ahead = turned + np.cumsum((step + math.pi) % math.tau - math.pi)
        self._samples = joined([self._samples, samples])
        self._times = np.concatenate([self._times, times_ns])
        self._turned = np.concatenate([self._turned, ahead])
        scans = []
        while self._turned.max() >= (self._next_turn + 1) * math.tau + self._seam_rad:
            scan = self._make(self._next_turn * math.tau)
            self._next_turn += 1
            if scan is not None:
                scans.append(scan)
        self._forget(self._next_turn * math.tau - self._seam_rad)
        return scans

    def _make(self, begin_rad: float) -> Scan | None:
        inside = (self._turned >= begin_rad) & (self._turned < begin_rad + math.tau)
        turned = self._turned[inside] - begin_rad
        slope_ns, start_ns = self._timing(inside, begin_rad)
        if not slope_ns or not len(turned):
            return None
        self._turn_ns = slope_ns * math.tau
        order = np.argsort(turned, kind="stable")
        turned = turned[order]
        nearest = _nearest(turned, self._beam_turned)
        reach = max(self._beams.increment_rad, math.tau / len(turned))
        missed = np.abs(turned[nearest] - self._beam_turned) > reach
        ranges = self._samples.range_m[inside][order][nearest]
        intensities = self._samples.intensity[inside][order][nearest]
        ranges[missed] = np.nan
        intensities[missed] = 0.0
        ranges[ranges < self._range_min_m] = -np.inf
        ranges[ranges > self._range_max_m] = np.inf
        has_intensities = not np.isnan(intensities).any()
        return Scan(
            stamp_ns=round(start_ns + slope_ns * self._beam_turned[0]),
            time_increment_s=-slope_ns * self._beams.increment_rad / _NS_PER_S,
            turn_s=self._turn_ns / _NS_PER_S,
            ranges_m=ranges.astype(np.float32),
            intensities=intensities.astype(np.float32) if has_intensities else np.zeros(0, np.float32),
            points=len(turned),
        )

    def _timing(self, inside: npt.NDArray[np.bool_], begin_rad: float) -> tuple[float, float]:
        """Fit time over angle to the last measurement of each packet; return ns per radian and the start."""
        ends = np.append(np.diff(self._samples.end) != 0, True)
        last = np.flatnonzero(inside & ends)
        if len(last) < _FEWEST_TIMES:
            return 0.0, 0.0
        turned, times = self._turned[last] - begin_rad, self._times[last]
        origin = int(times[0])
        mean = turned.mean()
        spread = turned - mean
        weight = float(spread @ spread)
        passed = (times - origin).astype(float)
        slope = float(spread @ passed) / weight if weight else 0.0
        if slope <= 0:
            return 0.0, 0.0
        return slope, origin + float(passed.mean()) - slope * float(mean)

    def _forget(self, before_rad: float) -> None:
        keep = self._turned >= before_rad
        keep[-1] = True
        if keep.all():
            return
        samples = self._samples
        self._samples = Samples(
            samples.angle_rad[keep], samples.range_m[keep], samples.intensity[keep], samples.end[keep]
        )
        self._times, self._turned = self._times[keep], self._turned[keep]


def _nearest(values: Floats, wanted: Floats) -> npt.NDArray[np.intp]:
    """Return the indices of the sorted values that are nearest to the wanted ones."""
    right = np.clip(np.searchsorted(values, wanted), 0, len(values) - 1)
    left = np.maximum(right - 1, 0)
    closer: npt.NDArray[np.intp] = np.where(
        np.abs(values[left] - wanted) <= np.abs(values[right] - wanted), left, right
    )
    return closer
