"""Figures of data that are compared with stored statistics, computed part by part."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from joshua_dataset.statistics import QUANTILES

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Measured:
    """Figures of the rows of a feature, each of shape (D,).

    Attributes:
        count: of rows; low, high, mean: of them; squares: sum of the squared distances from the mean.
        quantiles: between which values each one is, by name: programs interpolate in different ways, and
            LeRobot takes the mean of its episodes' quantiles.
    """

    count: int
    low: FloatArray
    high: FloatArray
    mean: FloatArray
    squares: FloatArray
    quantiles: dict[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)

    @classmethod
    def of(cls, rows: npt.NDArray[np.generic]) -> Measured:
        """Return the figures of an episode, whose rows are finite numbers, shape (N, …), N > 0."""
        values = rows.reshape(len(rows), -1).astype(np.float64)
        mean = values.mean(axis=0)
        ordered = np.sort(values, axis=0)
        last = len(values) - 1
        bounds = {}
        for name, part in QUANTILES.items():
            at = part * last
            low, high = int(np.floor(at)) - 1, int(np.ceil(at)) + 1
            bounds[name] = (ordered[max(0, low)], ordered[min(last, high)])
        squares = ((values - mean) ** 2).sum(axis=0)
        return cls(len(values), ordered[0], ordered[-1], mean, squares, bounds)

    @property
    def std(self) -> FloatArray:
        """Standard deviation, as LeRobot computes it."""
        found: FloatArray = np.sqrt(self.squares / self.count)
        return found

    @property
    def extent(self) -> FloatArray:
        """Difference of the largest and the smallest value."""
        found: FloatArray = self.high - self.low
        return found

    def joined(self, other: Measured) -> Measured:
        """Return the figures of both."""
        count = self.count + other.count
        share = other.count / count
        step = other.mean - self.mean
        bounds = {
            name: (
                (1 - share) * low + share * other.quantiles[name][0],
                (1 - share) * high + share * other.quantiles[name][1],
            )
            for name, (low, high) in self.quantiles.items()
        }
        return Measured(
            count,
            np.minimum(self.low, other.low),
            np.maximum(self.high, other.high),
            self.mean + share * step,
            self.squares + other.squares + step**2 * self.count * share,
            bounds,
        )


@dataclass(frozen=True)
class Colours:
    """Mean colour of pictures.

    Attributes:
        count: of pictures; total: sum of their mean colours, RGB in [0, 1].
    """

    count: int
    total: FloatArray

    def joined(self, other: Colours) -> Colours:
        """Return the figures of both."""
        return Colours(self.count + other.count, self.total + other.total)
