"""The values of all features at one time, each with its acquisition stamp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from joshua.plan.feature import Feature

Array = npt.NDArray[Any]


class FeatureError(ValueError):
    """A value does not match its feature. The message names both."""


@dataclass(frozen=True)
class Frame:
    """Observations and actions at one time.

    Attributes:
        stamp_ns: the time of the frame, ns since the epoch.
        values: by key of the feature. Do not modify the arrays.
        stamps_ns: acquisition stamp of each value; for an interpolated one, of the nearer of its two samples.
        missing: keys of features without a value within their tolerance. They are absent from ``values``.
    """

    stamp_ns: int
    values: Mapping[str, Array] = field(default_factory=dict)
    stamps_ns: Mapping[str, int] = field(default_factory=dict)
    missing: tuple[str, ...] = ()

    def __getitem__(self, key: str) -> Array:
        return self.values[key]

    def offset_ns(self, key: str) -> int:
        """How much later than the frame a value was acquired; negative for earlier."""
        return self.stamps_ns[key] - self.stamp_ns


def checked(feature: Feature, value: Any) -> Array:
    """Return a value as an array of the feature's type. Raises FeatureError if the shape differs.

    Numbers are converted. Pictures must already be uint8, because a float picture has another range.
    """
    try:
        array = np.asarray(value) if feature.is_picture else np.asarray(value, np.dtype(feature.dtype))
    except (TypeError, ValueError) as error:
        raise FeatureError(f"{feature.key} cannot be converted to {feature.dtype}: {error}") from error
    if feature.is_picture and array.dtype != np.uint8:
        raise FeatureError(f"{feature.key} has values of {array.dtype}, but pictures are uint8")
    fits = len(array.shape) == len(feature.shape) and all(
        wanted in (0, given) for given, wanted in zip(array.shape, feature.shape, strict=True)
    )
    if not fits:
        names = f" ({', '.join(feature.names)})" if feature.names and not feature.is_picture else ""
        raise FeatureError(f"{feature.key} has the shape {array.shape}, and {feature.shape} is kept{names}")
    return array
