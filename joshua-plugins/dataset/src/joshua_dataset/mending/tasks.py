"""Find the task of each row: in the table of tasks, and in the table of episodes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from joshua_dataset.mending.evidence import Evidence
from joshua_dataset.mending.runs import Run


@dataclass(frozen=True)
class Assigned:
    """The tasks of a data set.

    Attributes:
        texts: by index; rows: index of each row of an episode, by episode.
        unknown: episodes with a row whose task nothing says; contradictory: why, by episode.
    """

    texts: tuple[str, ...]
    rows: dict[int, npt.NDArray[np.int64]]
    unknown: tuple[int, ...]
    contradictory: dict[int, str]


def assign(evidence: Evidence, runs: Sequence[Run], given: str) -> Assigned:
    """Find the task of each row.

    Args:
        runs: the episodes; given: the task of the rows for which nothing says it, "" for none.
    """
    known = _known(evidence, runs)
    rows: dict[int, npt.NDArray[np.int64]] = {}
    texts: list[str] = [known[index] for index in sorted(known)] if _is_dense(known) else []
    unknown: list[int] = []
    contradictory: dict[int, str] = {}
    for run in runs:
        found = _texts(run, known, evidence.described.get(run.number, {}))
        if found is None:
            contradictory[run.number] = "its rows and the table of episodes name different tasks"
            continue
        if None in found and not given:
            unknown.append(run.number)
            continue
        chosen = [given if text is None else text for text in found]
        texts += [text for text in dict.fromkeys(chosen) if text not in texts]
        rows[run.number] = np.array([texts.index(text) for text in chosen], np.int64)
    return Assigned(tuple(texts), rows, tuple(unknown), contradictory)


def _is_dense(known: dict[int, str]) -> bool:
    """Return whether each task is at the row of its index, where LeRobot looks for it."""
    return sorted(known) == list(range(len(known))) and len(set(known.values())) == len(known)


def _known(evidence: Evidence, runs: Sequence[Run]) -> dict[int, str]:
    """Return the texts by the indices of the rows: as the table of episodes says where it is consistent."""
    named: dict[int, set[str]] = {}
    for run in runs:
        text = _only_text(evidence.described.get(run.number, {}))
        index = _usual(_indices(run))
        if text is not None and index is not None:
            named.setdefault(index, set()).add(text)
    there = evidence.tasks or {}
    derived = {index: next(iter(texts)) for index, texts in named.items() if len(texts) == 1}
    is_consistent = len(derived) == len(named) and len(set(derived.values())) == len(derived)
    if not is_consistent:
        return there
    others = {index: text for index, text in there.items() if index not in derived}
    return derived | {index: text for index, text in others.items() if text not in derived.values()}


def _texts(run: Run, known: dict[int, str], described: dict[str, Any]) -> list[str | None] | None:
    """Return the text of each row, None where nothing says it; None if the tables contradict each other."""
    found = [known.get(index) if index is not None else None for index in _indices(run)]
    texts = _described_texts(described)
    if texts:
        only = texts[0] if len(texts) == 1 else None
        usual = _usual_text(found)
        if usual is not None and usual not in texts:
            witness = _witness(described)
            if witness is None:
                return None
            if known.get(witness) == usual:
                return [text or usual for text in found]
            if only is None or known.get(witness) != only:
                return None
        return [text if text in texts else only for text in found]
    return found


def _witness(described: dict[str, Any]) -> int | None:
    """Return the task index that the statistics of an episode name; None unless it is one."""
    figures = [described.get(f"stats/task_index/{name}") for name in ("min", "max")]
    values = {float(value) for figure in figures if isinstance(figure, list) for value in figure[:1]}
    if len(values) != 1 or None in figures:
        return None
    value = values.pop()
    return int(value) if value.is_integer() else None


def _indices(run: Run) -> list[int | None]:
    values = run.rows.index.get("task_index")
    if values is None:
        return [None] * run.whole
    part = values[run.first : run.first + run.whole]
    return [int(value) if np.isfinite(value) and value >= 0 else None for value in part]


def _usual(indices: Sequence[int | None]) -> int | None:
    counts = Counter(index for index in indices if index is not None)
    return counts.most_common(1)[0][0] if counts else None


def _usual_text(texts: Sequence[str | None]) -> str | None:
    counts = Counter(text for text in texts if text is not None)
    return counts.most_common(1)[0][0] if counts else None


def _described_texts(described: dict[str, Any]) -> list[str]:
    texts = described.get("tasks")
    if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
        return []
    return texts


def _only_text(described: dict[str, Any]) -> str | None:
    texts = _described_texts(described)
    return texts[0] if len(texts) == 1 else None
