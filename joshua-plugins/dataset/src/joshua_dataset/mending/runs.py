"""Find the episodes in tables of rows, and how much of each is whole.

Four columns count the same frames: ``frame_index``, ``timestamp``, ``episode_index`` and ``index``. Where one
of them contradicts the others, the others decide; where they do not agree, the episode ends before.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import av
import numpy as np
import numpy.typing as npt
import pyarrow as pa
from joshua.features import Feature, FeatureSet

from joshua_dataset.decoding import DatasetError, picture_of
from joshua_dataset.mending.evidence import Evidence, Rows
from joshua_dataset.metadata import STAMP, array_of

_Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Run:
    """Rows that follow each other in a table, as the frames of one episode do.

    Attributes:
        rows: their table; first: row in it; found: how many there are.
        whole: how many of them, from the first on, are whole; why: what ends them, "" if all are whole.
        number: of the episode.
    """

    rows: Rows
    first: int
    found: int
    whole: int
    why: str
    number: int

    @property
    def label(self) -> str:
        """The rows in words."""
        last = self.first + self.found - 1
        return f"episode {self.number} (rows {self.first} to {last} of {self.rows.path.name})"


def rate_hz(evidence: Evidence) -> int | None:
    """Return the rate at which the timestamps of the rows count; None if they do not agree on one."""
    steps_s = [np.diff(rows.index["timestamp"]) for rows in evidence.rows if "timestamp" in rows.index]
    forward_s = np.concatenate(steps_s) if steps_s else np.zeros(0)
    forward_s = forward_s[np.isfinite(forward_s) & (forward_s > 0)]
    if not len(forward_s):
        return None
    step_s = float(np.median(forward_s))
    rate = round(1 / step_s) if step_s else 0
    is_even = np.abs(forward_s - step_s) < 0.1 * step_s
    if rate < 1 or abs(1 / step_s - rate) > 0.02 * rate or is_even.mean() < 0.9:
        return None
    return rate


def find(evidence: Evidence, features: FeatureSet, fps: int) -> list[Run]:
    """Return the episodes in the tables, in the order of their rows.

    Args:
        features: of the data set; fps: frames per second.
    """
    found: list[Run] = []
    for rows in evidence.rows:
        values, why = _whole_values(rows, features)
        starts = _starts(rows, fps)
        for first, end in zip(starts, [*starts[1:], len(rows.table)], strict=True):
            if end > first:
                found.append(_run(rows, first, end, fps, values, why))
    if not evidence.is_v3:
        return [replace(run, number=run.rows.number) for run in found]
    return _numbered(found, evidence)


def _starts(rows: Rows, fps: int) -> list[int]:
    """Return the rows at which an episode begins, by what most of the columns say."""
    count = len(rows.table)
    votes: list[_Mask] = []
    with np.errstate(invalid="ignore"):
        if "frame_index" in rows.index:
            votes.append(~(np.diff(rows.index["frame_index"]) == 1))
        if "timestamp" in rows.index:
            votes.append(~(np.abs(np.diff(rows.index["timestamp"]) * fps - 1) < 0.5))
        if "episode_index" in rows.index:
            votes.append(~(np.diff(rows.index["episode_index"]) == 0))
    if not count or not votes:
        return [0]
    is_start = np.sum(votes, axis=0) * 2 > len(votes)
    return [0, *(int(row) + 1 for row in np.flatnonzero(is_start))]


def _run(rows: Rows, first: int, end: int, fps: int, values: _Mask, why_values: Mapping[int, str]) -> Run:
    count = end - first
    frames = np.arange(count)
    index = {name: column[first:end] for name, column in rows.index.items()}
    votes: list[_Mask] = []
    with np.errstate(invalid="ignore"):
        if "frame_index" in index:
            votes.append(index["frame_index"] == frames)
        if "timestamp" in index:
            votes.append(np.abs(index["timestamp"] * fps - frames) < 0.5)
        if "index" in index:
            votes.append(index["index"] - index["index"][0] == frames)
    agree = np.sum(votes, axis=0) * 2 > len(votes) if votes else np.zeros(count, bool)
    episodes = index.get("episode_index", np.zeros(0))
    numbers = Counter(episodes[np.isfinite(episodes)].astype(int).tolist())
    is_whole = agree & values[first:end]
    if STAMP in index:
        rising = np.ones(count, bool)
        rising[1:] = np.diff(index[STAMP]) > 0
        is_whole &= rising
    whole = int(np.argmin(is_whole)) if not is_whole.all() else count
    why = ""
    if whole < count and not values[first + whole]:
        why = why_values[first + whole]
    elif whole < count and not agree[whole]:
        why = "frame_index, timestamp and index do not count its frames"
    elif whole < count:
        why = f"{STAMP} does not increase"
    number = numbers.most_common(1)[0][0] if numbers else -1
    return Run(rows, first, count, whole, why, number)


def _numbered(found: list[Run], evidence: Evidence) -> list[Run]:
    """Number the runs by their order, where the table of episodes confirms it, or no column has a number."""
    described = [evidence.described[number].get("length") for number in sorted(evidence.described)]
    if [run.found for run in found] == described:
        ordered = zip(found, sorted(evidence.described), strict=True)
        return [replace(run, number=number) for run, number in ordered]
    if all(run.number < 0 for run in found):
        return [replace(run, number=number) for number, run in enumerate(found)]
    return found


def _whole_values(rows: Rows, features: FeatureSet) -> tuple[_Mask, dict[int, str]]:
    """Return which rows have all their values, and what is wrong with the first of the others."""
    whole = np.ones(len(rows.table), bool)
    why: dict[int, str] = {}
    for feature in features.values():
        for name in columns_of(feature, rows.table):
            column = rows.table.column(name)
            size = int(np.prod(feature.shape)) if name == feature.key else 1
            is_whole = _pictures(column, feature, rows) if feature.is_picture else _finite(column, size)
            for row in np.flatnonzero(whole & ~is_whole):
                what = "picture that cannot be decoded" if feature.is_picture else "value that is no number"
                why[int(row)] = f"{feature.key} has a {what}"
            whole &= is_whole
    return whole, why


def columns_of(feature: Feature, table: pa.Table) -> list[str]:
    """Return the columns that hold a feature: one, or one for each of its numbers in a CSV table."""
    if feature.key in table.column_names:
        return [feature.key]
    return [name for name in table.column_names if name.startswith(f"{feature.key}.")]


def _finite(column: pa.ChunkedArray, size: int) -> _Mask:
    """Return which rows of a column have as many numbers as they should, and no other values."""
    if not len(column):
        return np.zeros(0, bool)
    values = array_of(column)
    if values.dtype != object:
        rows = values.reshape(len(values), -1)
        if rows.dtype.kind not in "iufb" or rows.shape[1] != size:
            return np.zeros(len(values), bool)
        found: _Mask = np.isfinite(rows).all(axis=1) & np.asarray(column.is_valid())
        return found
    return np.array([_is_finite(value, size) for value in column.to_pylist()], bool)


def _is_finite(value: Any, size: int) -> bool:
    try:
        numbers = np.asarray(value, np.float64)
        return numbers.size == size and bool(np.isfinite(numbers).all())
    except (TypeError, ValueError):
        return False


def _pictures(column: pa.ChunkedArray, feature: Feature, rows: Rows) -> _Mask:
    height, width, _ = feature.shape
    found = np.zeros(len(column), bool)
    for row, value in enumerate(column):
        try:
            picture_of(value.as_py()["bytes"], rows.path, height, width)
        except (DatasetError, av.FFmpegError, OSError, IndexError, TypeError, KeyError, ValueError):
            continue
        found[row] = True
    return found
