"""Check the stored statistics: by themselves, against the data, and against those of the episodes.

Statistics of pictures are those of samples, and videos change colours a little, so they are compared loosely.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from joshua_dataset.checks.contents import Contents, shown
from joshua_dataset.checks.measured import Colours, Measured
from joshua_dataset.checks.problem import Kind, Problem, computing
from joshua_dataset.meta_files import read_json
from joshua_dataset.metadata import INDEX_COLUMNS, STATS
from joshua_dataset.reader import DatasetError
from joshua_dataset.statistics import QUANTILES

FloatArray = npt.NDArray[np.float64]

#: Figures that LeRobot reads, beside the quantiles, which older data sets lack.
NEEDED = ("min", "max", "mean", "std", "count")

#: Largest difference between the mean of all pictures and that of the statistics, which sample them.
PICTURE_MEAN = 0.1

#: Numbers of a figure that are shown as a whole.
_SHOWN = 4

#: Rounding of programs that compute in float32, relative to the extent of a feature.
_ROUNDING = 1e-3

#: Rounding of a value that is stored in float32, relative to it.
_EXACT = 1e-5

#: Excess of a quantile beyond the values, from interpolation in a histogram, relative to the extent.
_OF_HISTOGRAM = 5e-3


@dataclass(frozen=True)
class Stored:
    """Statistics of a feature as they are stored.

    Attributes:
        key: of the feature; where: they are, for messages; values: figures by name, anything at all.
        shape: that each figure must have; is_picture: of pictures; episode: -1 for the whole data set.
        is_time: of times in ns, whose mean is lost in rounding.
    """

    key: str
    where: str
    values: Any
    shape: tuple[int, ...]
    is_picture: bool = False
    is_time: bool = False
    episode: int = -1


@dataclass(frozen=True)
class _Fault:
    """What is wrong with a figure.

    Attributes:
        kind: of it; name: of the figure; text: what was found, and what is right.
    """

    kind: Kind
    name: str
    text: str


class Judge:
    """Compares stored statistics with data.

    Args:
        remedy: the command that cures the statistics of this data set.
    """

    def __init__(self, remedy: tuple[str, ...]) -> None:
        self._remedy = remedy

    def figures(self, stored: Stored) -> tuple[dict[str, FloatArray], list[Problem]]:
        """Return the figures that are usable, and the problems of the others."""
        values = stored.values
        if not isinstance(values, Mapping):
            text = f"{stored.where}: {stored.key} is {shown(values)}; it must be an object"
            return {}, [self._problem(stored, Kind.STATISTICS_TORN, text)]
        found: dict[str, FloatArray] = {}
        faults = []
        has_quantiles = any(values.get(name) is not None for name in QUANTILES)
        for name in (*NEEDED, *QUANTILES):
            if values.get(name) is None:
                if name in NEEDED or has_quantiles:
                    faults.append(_Fault(Kind.STATISTICS_MISSING, name, "is missing"))
                continue
            figure = _array(values[name])
            shape = (1,) if name == "count" else stored.shape
            if figure is None or figure.shape != shape:
                there = "no numbers" if figure is None else f"the shape {list(figure.shape)}"
                text = f"has {there}, and {list(shape)} is right"
                faults.append(_Fault(Kind.STATISTICS_TORN, name, text))
            elif not np.isfinite(figure).all():
                faults.append(_Fault(Kind.STATISTICS_NOT_FINITE, name, f"is not finite: {_short(figure)}"))
            else:
                found[name] = figure
        return found, list(self._together(stored, faults))

    def judged(
        self,
        stored: Stored,
        figures: Mapping[str, FloatArray],
        measured: Measured | None = None,
        colours: Colours | None = None,
        parts: Mapping[str, FloatArray] | None = None,
    ) -> Iterator[Problem]:
        """Yield where figures contradict the data, each other, or the statistics of the episodes.

        Args:
            stored: what is judged; figures: its usable figures; measured: of the rows, None where they are
                pictures or are not known; colours: of decoded pictures; parts: of the episodes together.
        """
        faults: list[_Fault] = []
        if measured is not None:
            faults += _against(stored, figures, measured)
        faults += _alone(stored, figures)
        if colours is not None:
            faults += _colours(figures, colours)
        for name, right in (parts or {}).items():
            value = figures.get(name)
            room = 0.5 if name == "count" else PICTURE_MEAN
            if value is not None and (np.abs(value - right) > room).any():
                faults.append(
                    _Fault(Kind.STATISTICS_CONTRADICT, name, _but(value, "the episodes have", right))
                )
        yield from self._together(stored, faults)

    def _together(self, stored: Stored, faults: list[_Fault]) -> Iterator[Problem]:
        """Yield one problem for the faults of each kind."""
        for kind in dict.fromkeys(fault.kind for fault in faults):
            first, *others = (fault for fault in faults if fault.kind is kind)
            is_needed = kind is not Kind.STATISTICS_MISSING or first.name in NEEDED  # which come first
            text = f"the {first.name} of {stored.key} in {stored.where} {first.text}"
            names = [name for name in dict.fromkeys(fault.name for fault in others) if name != first.name]
            if names:
                text += f"; wrong, too: {', '.join(names)}"
            yield self._problem(stored, kind, text, is_needed=is_needed)

    def _problem(self, stored: Stored, kind: Kind, text: str, *, is_needed: bool = True) -> Problem:
        if stored.episode >= 0:
            return Problem(Kind.EPISODE_STATISTICS, text, stored.episode, False, self._remedy)
        is_used = stored.key not in INDEX_COLUMNS and not stored.is_picture
        is_broken = kind is not Kind.STATISTICS_CONTRADICT  # stops LeRobot, whatever it is the figure of
        return Problem(kind, text, -1, is_needed and (is_used or is_broken), self._remedy)


def _alone(stored: Stored, figures: Mapping[str, FloatArray]) -> Iterator[_Fault]:
    """Yield where the figures contradict each other."""
    kind = Kind.STATISTICS_CONTRADICT
    if "std" in figures and (figures["std"] < 0).any():
        yield _Fault(kind, "std", f"is {_short(figures['std'])}, and it must not be negative")
    if "count" in figures and (figures["count"] <= 0).any():
        yield _Fault(kind, "count", f"is {_short(figures['count'])}, and it must be above 0")
    low, high = figures.get("min"), figures.get("max")
    if low is None or high is None or stored.is_time:
        return
    room = _OF_HISTOGRAM * np.abs(high - low) + 1e-6
    if (low > high).any():
        yield _Fault(kind, "min", _but(low, "the max is", high))
    if stored.is_picture and ((low < -1e-6).any() or (high > 1 + 1e-6).any()):
        yield _Fault(kind, "max", f"is {_short(high)}, and colours are between 0 and 1")
    for name in ("mean", *QUANTILES):
        value = figures.get(name)
        if value is not None and ((value < low - room).any() or (value > high + room).any()):
            text = f"is {_short(value)}, and the values are between {_short(low)} and {_short(high)}"
            yield _Fault(kind, name, text)
    if "std" in figures and (figures["std"] > np.abs(high - low) + room).any():
        yield _Fault(kind, "std", f"is {_short(figures['std'])}, above the extent of the values")
    rising = [(name, figures[name]) for name in QUANTILES if name in figures]
    for (one, before), (two, after) in pairwise(rising):
        if (before > after + room).any():
            yield _Fault(kind, two, _but(after, f"{one} is", before))


def _against(stored: Stored, figures: Mapping[str, FloatArray], data: Measured) -> Iterator[_Fault]:
    """Yield where the figures contradict the data."""
    kind, extent = Kind.STATISTICS_CONTRADICT, data.extent
    exact = 1e-4 + _EXACT * np.maximum(np.abs(data.low), np.abs(data.high))
    near = 1e-4 + _ROUNDING * extent
    expected = {"min": (data.low, exact), "max": (data.high, exact)}
    if not stored.is_time:
        expected |= {"mean": (data.mean, near), "std": (data.std, near)}
    expected["count"] = (np.array([float(data.count)]), np.array([0.5]))
    for name, (right, tolerance) in expected.items():
        value = figures.get(name)
        if value is not None and (np.abs(value - right) > tolerance).any():
            yield _Fault(kind, name, _but(value, "the data have", right))
    if stored.is_time:
        return
    room = _OF_HISTOGRAM * extent + 1e-4
    for name, (low, high) in data.quantiles.items():
        value = figures.get(name)
        if value is not None and ((value < low - room).any() or (value > high + room).any()):
            text = f"is {_short(value)}, and in the data between {_short(low)} and {_short(high)}"
            yield _Fault(kind, name, text)


def _colours(figures: Mapping[str, FloatArray], data: Colours) -> Iterator[_Fault]:
    """Yield where the mean contradicts that of the decoded pictures."""
    mean, right = figures.get("mean"), data.total / data.count
    if mean is not None and (np.abs(mean.ravel() - right) > PICTURE_MEAN).any():
        yield _Fault(Kind.STATISTICS_CONTRADICT, "mean", _but(mean, "the data have", right))


def _but(value: FloatArray, what: str, right: FloatArray) -> str:
    if np.size(value) <= _SHOWN or np.shape(value) != np.shape(right):
        return f"is {_short(value)}, and {what} {_short(right)}"
    worst = int(np.argmax(np.abs(value - right)))
    return f"is {value.ravel()[worst]:.4g} at number {worst}, and {what} {right.ravel()[worst]:.4g}"


def _array(value: Any) -> FloatArray | None:
    """Return a stored figure as an array; None if it is none."""
    try:
        found = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    return found


def read(contents: Contents) -> tuple[dict[str, Any] | None, list[Problem]]:
    """Return ``meta/stats.json``, None if it cannot be used, and what is wrong with it as a whole."""
    path = contents.folder / STATS
    if not path.exists() and not path.is_symlink():
        if contents.version == "v2.1":
            return None, []  # this layout stores them by episode
        text = f"{STATS} is missing: a training then normalises nothing"
        return None, [Problem(Kind.STATISTICS_MISSING, text, remedy=computing(contents.folder))]
    try:
        record = read_json(contents.folder, STATS)
    except DatasetError as error:
        problem = contents.refused(path, error, Kind.STATISTICS_TORN)
        is_torn = problem.kind is Kind.STATISTICS_TORN
        text = problem.text
        return None, [
            Problem(problem.kind, text, remedy=computing(contents.folder) if is_torn else None),
        ]
    if not isinstance(record, dict):
        text = f"{STATS} is {shown(record)}; it must be an object"
        return None, [Problem(Kind.STATISTICS_TORN, text, remedy=computing(contents.folder))]
    return record, []


def _short(values: FloatArray) -> str:
    flat = np.ravel(values)[:_SHOWN]
    return "[" + ", ".join(f"{value:.4g}" for value in flat) + (", …]" if np.size(values) > _SHOWN else "]")
