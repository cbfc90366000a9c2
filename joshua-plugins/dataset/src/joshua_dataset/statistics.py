"""Statistics of features in LeRobot's form, for an episode and for a whole data set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

#: Arrays by name: min, max, mean, std, count and the quantiles.
Statistics = dict[str, FloatArray]

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

#: Spacing of the sampled pixels of a picture, in both directions.
PIXEL_STRIDE = 4


def of_rows(rows: npt.ArrayLike) -> Statistics:
    """Compute the statistics of numbers, shape (N, D) → (D,) each; ``count`` has shape (1,)."""
    values = np.asarray(rows, dtype=np.float64)
    found: Statistics = {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
        "count": np.array([len(values)], dtype=np.float64),
    }
    quantiles = np.quantile(values, list(QUANTILES.values()), axis=0)
    return found | dict(zip(QUANTILES, quantiles, strict=True))


class PictureStatistics:
    """Statistics of pictures by channel, exact for the sampled pixels, in constant memory."""

    def __init__(self) -> None:
        self.pictures = 0
        self._histogram = np.zeros((3, 256), np.int64)

    def add(self, picture: npt.NDArray[np.uint8]) -> None:
        """Add every ``PIXEL_STRIDE``-th pixel of a picture (H, W, 3)."""
        thinned = picture[::PIXEL_STRIDE, ::PIXEL_STRIDE]
        for channel in range(3):
            self._histogram[channel] += np.bincount(thinned[..., channel].ravel(), minlength=256)
        self.pictures += 1

    def result(self) -> Statistics:
        """Return the statistics in [0, 1], shape (3, 1, 1) as in LeRobot. Requires a picture."""
        levels = np.arange(256) / 255.0
        total = self._histogram.sum(axis=1, keepdims=True)
        share = self._histogram / total
        mean = share @ levels
        variance = np.maximum(share @ levels**2 - mean**2, 0.0)
        rising = np.cumsum(self._histogram, axis=1)
        found = {
            "min": levels[(self._histogram > 0).argmax(axis=1)],
            "max": levels[255 - (self._histogram[:, ::-1] > 0).argmax(axis=1)],
            "mean": mean,
            "std": np.sqrt(variance),
        } | {name: _quantile(rising, levels, part) for name, part in QUANTILES.items()}
        shaped = {name: value.reshape(3, 1, 1) for name, value in found.items()}
        return shaped | {"count": np.array([self.pictures], dtype=np.float64)}


def _quantile(rising: npt.NDArray[np.int64], levels: FloatArray, part: float) -> FloatArray:
    """Return the quantile of each histogram, interpolated as numpy does by default."""
    found = []
    for counts in rising:
        at = part * (counts[-1] - 1)
        low, high = (
            levels[np.searchsorted(counts, rank, side="right")] for rank in (int(at), int(np.ceil(at)))
        )
        found.append(low + (high - low) * (at - int(at)))
    return np.array(found)


def merged(parts: Sequence[Statistics]) -> Statistics:
    """Merge the statistics of several parts; quantiles are weighted means, as in LeRobot."""
    counts = np.array([part["count"][0] for part in parts])
    share = counts / counts.sum()

    def weighted(values: list[FloatArray]) -> FloatArray:
        stacked = np.stack(values)
        result: FloatArray = (stacked * share.reshape((-1,) + (1,) * (stacked.ndim - 1))).sum(axis=0)
        return result

    mean = weighted([part["mean"] for part in parts])
    variance = weighted([part["std"] ** 2 + (part["mean"] - mean) ** 2 for part in parts])
    return {
        "min": np.stack([part["min"] for part in parts]).min(axis=0),
        "max": np.stack([part["max"] for part in parts]).max(axis=0),
        "mean": mean,
        "std": np.sqrt(variance),
        "count": np.array([counts.sum()]),
        **{
            name: weighted([part[name] for part in parts])
            for name in QUANTILES
            if all(name in p for p in parts)
        },
    }


def as_json(statistics: Statistics) -> dict[str, Any]:
    """Convert statistics to plain lists; the count becomes a whole number.

    A figure that is no number, because a recorded value was none, becomes ``null``: JSON has no other word.
    """
    return {name: [int(value[0])] if name == "count" else _plain(value) for name, value in statistics.items()}


def _plain(values: FloatArray) -> Any:
    if np.isfinite(values).all():
        return values.tolist()
    plain = values.astype(object)
    plain[~np.isfinite(values)] = None
    return plain.tolist()


def from_json(record: Mapping[str, Any]) -> Statistics:
    """Read what ``as_json`` wrote. Raises ValueError and TypeError."""
    return {name: np.asarray(value, np.float64) for name, value in record.items()}
