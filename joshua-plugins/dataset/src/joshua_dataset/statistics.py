"""What LeRobot keeps about the values of each feature: extremes, mean, spread and quantiles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Statistics = dict[str, FloatArray]

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

#: Distance of the pixels of a picture that count, in both directions.
PIXEL_STRIDE = 4


def of_rows(rows: npt.ArrayLike) -> Statistics:
    """Statistics of numbers, shape (N, D) → (D,) each; ``count`` has shape (1,)."""
    values = np.asarray(rows, dtype=np.float64)
    found: Statistics = {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
        "count": np.array([len(values)], dtype=np.float64),
    }
    for name, part in QUANTILES.items():
        found[name] = np.quantile(values, part, axis=0)
    return found


def thinned(picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """The pixels of a picture (H, W, 3) that count, as a copy."""
    return picture[::PIXEL_STRIDE, ::PIXEL_STRIDE].copy()


def of_pictures(pictures: Sequence[npt.NDArray[np.uint8]]) -> Statistics:
    """Statistics of thinned pictures by channel, in [0, 1], shape (3, 1, 1) as LeRobot wants it."""
    found = of_rows(np.stack(pictures).reshape(-1, 3) / 255.0)
    found = {name: value.reshape(3, 1, 1) for name, value in found.items() if name != "count"}
    found["count"] = np.array([len(pictures)], dtype=np.float64)
    return found


def merged(parts: Sequence[Statistics]) -> Statistics:
    """Statistics of all rows of several parts; quantiles are the weighted means of the parts'."""
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
        **{name: weighted([part[name] for part in parts]) for name in QUANTILES},
    }


def as_json(statistics: Statistics) -> dict[str, Any]:
    """Plain lists; the count is a whole number."""
    return {
        name: [int(value[0])] if name == "count" else value.tolist() for name, value in statistics.items()
    }
