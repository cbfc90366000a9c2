"""Compare ``meta/stats.json`` with all episodes together."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from joshua_dataset.checks import statistics
from joshua_dataset.checks.contents import Contents, shown
from joshua_dataset.checks.measured import Colours, Measured
from joshua_dataset.checks.one_episode import Found, stored_of
from joshua_dataset.checks.problem import Kind, Problem, repairing
from joshua_dataset.checks.statistics import FloatArray, Judge, Stored
from joshua_dataset.metadata import INDEX_COLUMNS, STATS


class Together:
    """Figures of all episodes.

    Args:
        contents: of the data set.
    """

    def __init__(self, contents: Contents) -> None:
        self._contents = contents
        self._measured: dict[str, Measured] = {}
        self._colours: dict[str, Colours] = {}
        self._parts: dict[str, list[dict[str, FloatArray]]] = {}
        self._is_finite = True
        self._episodes = 0

    def add(self, found: Found) -> None:
        """Take what an episode contains."""
        self._episodes += 1
        self._is_finite = self._is_finite and found.is_finite
        for key, measured in found.measured.items():
            before = self._measured.get(key)
            self._measured[key] = measured if before is None else before.joined(measured)
        for key, colours in found.colours.items():
            seen = self._colours.get(key)
            self._colours[key] = colours if seen is None else seen.joined(colours)
        for key, figures in found.parts.items():
            self._parts.setdefault(key, []).append(figures)

    def problems(self, remedy: tuple[str, ...], *, are_all_read: bool) -> Iterator[Problem]:
        """Yield the problems of the statistics of the data set.

        Args:
            remedy: the command that cures statistics; are_all_read: no row is missing in what was taken.
        """
        dataset = self._contents.dataset
        if self._contents.has_messages or self._contents.is_empty:
            return
        record, problems = statistics.read(self._contents)
        yield from problems
        if record is None or dataset is None:
            return
        if not self._is_finite:
            remedy = repairing(self._contents.folder)  # statistics of such rows would not be numbers, either
        judge = Judge(remedy)
        for feature in dataset.features.values():
            if feature.key not in record:
                text = f"{STATS} lacks {feature.key}: a training then does not normalise it"
                yield Problem(Kind.STATISTICS_MISSING, text, remedy=remedy)
                continue
            stored = stored_of(feature, record[feature.key], str(STATS))
            yield from self._of_feature(judge, stored, are_all_read=are_all_read)
        for key, values in record.items():
            if key in INDEX_COLUMNS:
                stored = Stored(key, str(STATS), values, (1,))
                yield from self._of_feature(judge, stored, are_all_read=are_all_read)
            elif key not in dataset.features:
                text = f"{STATS} describes {shown(key)}, which is no feature of the data set"
                yield Problem(Kind.STATISTICS_CONTRADICT, text, serious=False, remedy=remedy)

    def _of_feature(self, judge: Judge, stored: Stored, *, are_all_read: bool) -> Iterator[Problem]:
        figures, problems = judge.figures(stored)
        yield from problems
        if not are_all_read:
            yield from judge.judged(stored, figures)
            return
        key = stored.key
        measured = self._measured.get(key) if self._is_finite else None
        parts = self._parts.get(key, [])
        together = _merged(parts) if parts and len(parts) == self._episodes else {}
        yield from judge.judged(stored, figures, measured, self._colours.get(key), together)


def _merged(parts: list[dict[str, FloatArray]]) -> dict[str, FloatArray]:
    """Return the figures of pictures of all episodes, as far as all of them have one."""
    found: dict[str, Any] = {}
    common = set.intersection(*(set(part) for part in parts))
    if "count" not in common:
        return found
    counts = np.array([part["count"][0] for part in parts])
    if (counts <= 0).any():
        return found
    found["count"] = np.array([counts.sum()])
    share = (counts / counts.sum()).reshape(-1, 1, 1, 1)
    for name in sorted(common - {"count", "std"}):
        stacked = np.stack([part[name] for part in parts])
        if name == "min":
            found[name] = stacked.min(axis=0)
        elif name == "max":
            found[name] = stacked.max(axis=0)
        else:
            found[name] = (stacked * share).sum(axis=0)
    if {"mean", "std"} <= common:
        means = np.stack([part["mean"] for part in parts])
        stds = np.stack([part["std"] for part in parts])
        found["std"] = np.sqrt(((stds**2 + (means - found["mean"]) ** 2) * share).sum(axis=0))
    return found
