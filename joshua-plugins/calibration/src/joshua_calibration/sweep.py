"""Range measurement of one joint: ends, coverage and completeness."""

from __future__ import annotations

from joshua_calibration.target import TargetMotor

BINS_PER_TURN = 64
TURNS_BACK = 1 / 128  # of a turn: motion back from an end that confirms it
CAME_TO = 1 / 256  # of a turn: motion to an end that is near the start
NEAR_END = 1 / 256  # of a turn: distance from the outermost position within which the joint must turn back
MOVED = 1 / 64  # of a turn: motion that counts as moved
SMALLEST_RANGE = 1 / 24  # of a turn: smallest valid range
SMALLEST_SHARE = 0.25  # of the typical range: smallest valid range
SHORT_SHARE = 0.6  # of the typical range: less gives a note


class Sweep:
    """The range of one joint so far; positions are unwrapped ticks.

    An end is found once the joint has reached it and moved back, so a growing range is not complete. Coverage
    is the share of the range with continuous readings: where readings were lost, the joint must pass again.
    """

    def __init__(self, motor: TargetMotor) -> None:
        self._motor = motor
        self._turn = motor.ticks_per_turn
        self._bin = self._turn // BINS_PER_TURN or 1
        self._seen: set[int] = set()
        self._last: int | None = None
        self._direction = 0
        self._turning_point = 0  # outermost position in the present direction
        self._near_start = (0, 0, 0)  # lowest and highest start position, before it had a direction
        self._valley: int | None = None  # lowest and highest position at which the joint turned back
        self._peak: int | None = None
        self.low: int | None = None
        self.high: int | None = None

    def observe(self, position: int, *, continuous: bool = True) -> None:
        """Add a position; ``continuous`` means that no readings are missing before it."""
        if self._last is None or self.low is None or self.high is None:
            self.low = self.high = self._turning_point = position
            self._near_start = (position, position, position)
        if not continuous:  # the motion in between is unknown: a reversal in the gap is not a found end
            self._direction, self._turning_point = 0, position
            self._near_start = (position, position, position)
        self._cover(position, continuous)
        self.low, self.high = min(self.low, position), max(self.high, position)
        self._last = position
        self._turn_back(position)

    @property
    def span(self) -> int:
        """Ticks from the lowest to the highest position."""
        return 0 if self.low is None or self.high is None else self.high - self.low

    @property
    def started(self) -> bool:
        """Whether the joint is being moved."""
        return self.span >= self._turn * MOVED

    @property
    def goes_round(self) -> bool:
        """Whether a joint without stops has made a full turn."""
        return self._motor.full_turn and self.span >= self._turn

    @property
    def too_far(self) -> bool:
        """Whether a joint with stops seems to have made a full turn, which is impossible."""
        return not self._motor.full_turn and self.span >= self._turn

    @property
    def smallest_span(self) -> int:
        """Smallest valid span."""
        return round(max(self._turn * SMALLEST_RANGE, self._motor.typical_range_ticks * SMALLEST_SHARE))

    @property
    def moved(self) -> bool:
        """Whether the span is large enough."""
        return self.span >= self.smallest_span

    @property
    def is_short(self) -> bool:
        """Whether the span is small for this kind of joint."""
        return self.span < self._motor.typical_range_ticks * SHORT_SHARE

    @property
    def low_found(self) -> bool:
        """Whether the joint has turned back at the low end."""
        return self._valley is not None and self.low is not None and self._valley - self.low <= self._near

    @property
    def high_found(self) -> bool:
        """Whether the joint has turned back at the high end."""
        return self._peak is not None and self.high is not None and self.high - self._peak <= self._near

    @property
    def coverage(self) -> float:
        """Share of the range with continuous readings, 0 to 1."""
        if self.low is None or self.high is None:
            return 0.0
        bins = range(self.low // self._bin, self.high // self._bin + 1)
        return sum(number in self._seen for number in bins) / len(bins)

    @property
    def complete(self) -> bool:
        """Whether the range is complete."""
        if self.too_far or not self.moved or self.coverage < 1.0:
            return False
        return self.goes_round or (self.low_found and self.high_found)

    @property
    def _near(self) -> float:
        return self._turn * NEAR_END

    def _cover(self, position: int, continuous: bool) -> None:
        start = position if self._last is None or not continuous else self._last
        first, last = sorted((start // self._bin, position // self._bin))
        self._seen.update(range(first, last + 1))

    def _turn_back(self, position: int) -> None:
        back = self._turn * TURNS_BACK
        if self._direction == 0:
            self._find_direction(position, back)
        elif (position - self._turning_point) * self._direction >= 0:
            self._turning_point = position
        elif abs(position - self._turning_point) >= back:
            if self._direction < 0:
                self._valley = _lowest(self._valley, self._turning_point)
            else:
                self._peak = -_lowest(None if self._peak is None else -self._peak, -self._turning_point)
            self._direction = -self._direction
            self._turning_point = position

    def _find_direction(self, position: int, back: float) -> None:
        start, low, high = self._near_start
        low, high = min(low, position), max(high, position)
        self._near_start = (start, low, high)
        came = self._turn * CAME_TO
        if position - low >= back:
            self._direction = 1
            if start - low >= came:
                self._valley = _lowest(self._valley, low)
        elif high - position >= back:
            self._direction = -1
            if high - start >= came:
                self._peak = -_lowest(None if self._peak is None else -self._peak, -high)
        self._turning_point = position


def _lowest(known: int | None, new: int) -> int:
    return new if known is None else min(known, new)
