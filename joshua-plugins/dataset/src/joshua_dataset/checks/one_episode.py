"""Check the values of one episode, in a process of its own: its numbers, statistics and pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from joshua.features import Feature

from joshua_dataset.checks import recording
from joshua_dataset.checks.measured import Colours, Measured
from joshua_dataset.checks.problem import Kind, Problem, repairing
from joshua_dataset.checks.statistics import FloatArray, Judge, Stored
from joshua_dataset.from_messages import problems as problems_of_messages
from joshua_dataset.metadata import INDEX_COLUMNS, MESSAGES
from joshua_dataset.reader import Dataset, DatasetError, Episode


@dataclass(frozen=True)
class Job:
    """One episode to be checked.

    Attributes:
        dataset: that it belongs to; episode: of it, its pictures only if they can be decoded.
        has_statistics: the layout stores statistics by episode; remedy: the command that cures them.
        pictures: decode them.
    """

    dataset: Dataset
    episode: Episode
    has_statistics: bool
    remedy: tuple[str, ...]
    pictures: bool


@dataclass
class Found:
    """What an episode contains.

    Attributes:
        problems: of it; measured: figures of its numbers by column, without those that are not finite.
        colours: mean colours of its pictures by feature, if they were decoded.
        parts: usable statistics of its pictures by feature.
        pictures: that were decoded; is_finite: so are all its numbers.
    """

    problems: list[Problem] = field(default_factory=list)
    measured: dict[str, Measured] = field(default_factory=dict)
    colours: dict[str, Colours] = field(default_factory=dict)
    parts: dict[str, dict[str, FloatArray]] = field(default_factory=dict)
    pictures: int = 0
    is_finite: bool = True


def check_episode(job: Job) -> Found:
    """Check one episode."""
    found = Found()
    dataset, episode = job.dataset, job.episode
    if dataset.pictures == MESSAGES:
        found.problems += _of_messages(dataset, episode)
        return found
    try:
        columns = dataset.columns(episode)
    except DatasetError as error:
        remedy = repairing(dataset.folder)
        found.problems.append(Problem(Kind.ROWS_COLUMN, str(error), episode.index, remedy=remedy))
        columns = {}
    if columns and not len(columns["episode_index"]):
        text = "it has no frame"
        remedy = repairing(dataset.folder)
        found.problems.append(Problem(Kind.ROWS_MISSING, text, episode.index, remedy=remedy))
    elif columns:
        found.problems += recording.of_numbers(dataset, episode, columns)
        _measure(dataset, columns, found)
    if job.has_statistics:
        found.problems += _statistics(job, found)
    for feature in dataset.features.pictures if job.pictures else ():
        if feature.key in episode.pictures:
            problems, colours = recording.of_pictures(dataset, episode, feature.key)
            found.problems += problems
            if colours is not None:
                found.colours[feature.key] = colours
                found.pictures += colours.count
    return found


def _of_messages(dataset: Dataset, episode: Episode) -> Iterator[Problem]:
    try:
        for kind, text, is_serious in problems_of_messages(dataset, episode):
            remedy = repairing(dataset.folder) if is_serious else None
            yield Problem(kind, text, episode.index, is_serious, remedy)
    except DatasetError as error:
        yield Problem(Kind.MESSAGES_TORN, str(error), episode.index, remedy=repairing(dataset.folder))


def _measure(dataset: Dataset, columns: Mapping[str, npt.NDArray[Any]], found: Found) -> None:
    for name, values in columns.items():
        if name not in dataset.features and name not in INDEX_COLUMNS:
            continue
        if values.dtype == object or values.dtype.kind not in "biuf":
            continue
        if np.isfinite(values).all():
            found.measured[name] = Measured.of(values)
        else:
            found.is_finite = False


def stored_of(feature: Feature, values: Any, where: str, episode: int = -1) -> Stored:
    """Return stored statistics of a feature with what they must be like."""
    if feature.is_picture:
        return Stored(feature.key, where, values, (3, 1, 1), is_picture=True, episode=episode)
    shape = feature.shape if len(feature.shape) == 1 else (int(np.prod(feature.shape)),)
    return Stored(feature.key, where, values, shape, is_time=feature.unit == "ns", episode=episode)


def _statistics(job: Job, found: Found) -> Iterator[Problem]:
    """Yield the problems of the statistics of an episode; take note of those of its pictures."""
    episode, features = job.episode, job.dataset.features
    # statistics of rows that are not numbers would not be numbers, either
    remedy = job.remedy if found.is_finite else repairing(job.dataset.folder)
    judge, where = Judge(remedy), "its statistics"
    lacking = [key for key in features if not episode.statistics.get(key)]
    if lacking:
        text = f"it has no statistics of {', '.join(lacking)}"
        yield Problem(Kind.EPISODE_STATISTICS, text, episode.index, serious=False, remedy=remedy)
    for feature in features.values():
        if feature.key in lacking:
            continue
        stored = stored_of(feature, episode.statistics[feature.key], where, episode.index)
        figures, problems = judge.figures(stored)
        yield from problems
        measured = found.measured.get(feature.key)
        yield from judge.judged(stored, figures, measured)
        if feature.is_picture:
            found.parts[feature.key] = figures
    for key in INDEX_COLUMNS:
        if episode.statistics.get(key) and key in found.measured:
            stored = Stored(key, where, episode.statistics[key], (1,), episode=episode.index)
            figures, problems = judge.figures(stored)
            yield from problems
            yield from judge.judged(stored, figures, found.measured[key])
