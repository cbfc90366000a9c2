"""Finds what spoils a data set for training: gaps, frozen pictures, jumps, actions without motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from joshua.features import ACTION, STATE, Feature

from joshua_dataset.from_messages import problems
from joshua_dataset.jobs import in_order
from joshua_dataset.metadata import MESSAGES, STAMP
from joshua_dataset.reader import Dataset, DatasetError, Episode

#: A picture that does not change for so long counts as frozen.
FROZEN_S = 0.5

#: Step of a joint between two frames that counts as a jump at 30 Hz, by unit.
LARGEST_STEP = {"rad": 0.5, "deg": 30.0, "lerobot": 25.0}

#: Values beyond these are outside the calibrated range by more than noise.
LIMITS = {"lerobot": 105.0}

#: An action that moves by more than this and a state that moves by a tenth of it: nothing follows.
LEAST_MOTION = {"rad": 0.1, "deg": 6.0, "lerobot": 6.0}


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong.

    Attributes:
        episode: its index, -1 for the data set as a whole; text: what was found, and where.
        serious: training or replaying would fail or learn something wrong.
    """

    episode: int
    text: str
    serious: bool = True

    def __str__(self) -> str:
        where = f"episode {self.episode}: " if self.episode >= 0 else ""
        return f"{'error' if self.serious else 'warning'}: {where}{self.text}"


def check(folder: Path, *, pictures: bool = True, workers: int | None = None) -> Iterator[Problem]:
    """Find the problems of a data set, episode by episode.

    Args:
        pictures: decode them, too; workers: processes, None for one a core.

    Raises:
        DatasetError: it cannot be read at all.
    """
    dataset = Dataset.read(folder)
    items = ((folder, episode, pictures) for episode in dataset.episode_list())
    episodes = frames = 0
    ends: dict[str, tuple[Any, Any]] = {}
    for length, found, parts in in_order(_of_episode, items, workers):
        yield from found
        episodes, frames = episodes + 1, frames + length
        for key, (low, high) in parts.items():
            before = ends.get(key, (low, high))
            ends[key] = (np.minimum(before[0], low), np.maximum(before[1], high))
    if episodes != dataset.episodes:
        yield Problem(
            -1, f"meta/info.json counts {dataset.episodes} episodes, and meta/episodes has {episodes}"
        )
    if frames != dataset.frames:
        yield Problem(-1, f"meta/info.json counts {dataset.frames} frames, and the episodes have {frames}")
    if dataset.pictures != MESSAGES:
        yield from _statistics(dataset, ends)


def _statistics(dataset: Dataset, ends: Mapping[str, tuple[Any, Any]]) -> Iterator[Problem]:
    try:
        there = dataset.statistics()
    except DatasetError as error:
        yield Problem(-1, str(error))
        return
    for key, (low, high) in ends.items():
        known = there.get(key)
        if known is None:
            yield Problem(-1, f"meta/stats.json has nothing of {key}")
            continue
        for name, expected in (("min", low), ("max", high)):
            found = np.asarray(known.get(name, np.nan), np.float64)
            if found.shape != expected.shape or not np.allclose(found, expected, rtol=1e-3, atol=1e-4):
                yield Problem(
                    -1,
                    f"the {name} of {key} in meta/stats.json is {_short(found)}, "
                    f"and the data have {_short(expected)}. "
                    f"Run `joshua dataset stats --write {dataset.folder}`",
                )


def _of_episode(
    item: tuple[Path, Episode, bool],
) -> tuple[int, list[Problem], dict[str, tuple[Any, Any]]]:
    folder, episode, pictures = item
    dataset = Dataset.read(folder)
    if dataset.pictures == MESSAGES:
        return episode.length, [Problem(episode.index, *found) for found in problems(dataset, episode)], {}
    try:
        columns = dataset.columns(episode)
    except DatasetError as error:
        return episode.length, [Problem(episode.index, str(error))], {}
    found = [Problem(episode.index, text, serious) for text, serious in _numbers(dataset, episode, columns)]
    if pictures:
        for feature in dataset.features.pictures:
            texts = _pictures(dataset, episode, feature.key)
            found += [Problem(episode.index, f"{feature.key}: {text}", serious) for text, serious in texts]
    ends = {
        feature.key: (
            columns[feature.key].reshape(len(columns[feature.key]), -1).min(axis=0).astype(np.float64),
            columns[feature.key].reshape(len(columns[feature.key]), -1).max(axis=0).astype(np.float64),
        )
        for feature in dataset.features.numbers
        if len(columns[feature.key])
    }
    return episode.length, found, ends


def _numbers(
    dataset: Dataset, episode: Episode, columns: Mapping[str, npt.NDArray[Any]]
) -> Iterator[tuple[str, bool]]:
    length = len(columns["frame_index"]) if "frame_index" in columns else 0
    if length != episode.length:
        yield f"{episode.table.name} has {length} frames, and {episode.length} are described", True
        return
    if not length:
        yield "it has no frame", True
        return
    if not np.array_equal(columns["frame_index"], np.arange(length)):
        yield "frame_index does not count from 0 without gaps", True
    expected_s = np.arange(length) / dataset.fps
    worst_s = float(np.abs(columns["timestamp"] - expected_s).max())
    if worst_s > 1e-3 + 1e-6 * length:
        yield f"timestamp is up to {worst_s:.3f} s away from frame_index / fps", True
    if STAMP in columns:
        steps_s = np.diff(columns[STAMP]) / 1e9
        if np.any(steps_s <= 0):
            yield f"{STAMP} does not rise", True
        gaps = int(np.sum(steps_s > 1.5 / dataset.fps))
        if gaps:
            yield f"{gaps} gaps in the recording, the longest {steps_s.max():.2f} s", False
    for feature in dataset.features.numbers:
        values = columns[feature.key].reshape(length, -1)
        if not np.isfinite(values).all():
            yield f"{feature.key} has values that are not finite", True
        elif feature.unit in LARGEST_STEP:
            yield from _joints(dataset, feature, values)
    yield from _followed(dataset, columns)


def _joints(dataset: Dataset, feature: Feature, values: npt.NDArray[Any]) -> Iterator[tuple[str, bool]]:
    names = feature.names or tuple(map(str, range(values.shape[1])))
    if len(values) > 1:
        steps = np.abs(np.diff(values, axis=0)).max(axis=0)
        limit = LARGEST_STEP[feature.unit] * max(1.0, 30 / dataset.fps)
        for name, step in zip(names, steps, strict=True):
            if step > limit:
                yield f"{feature.key}: {name} jumps by {step:.2f} {feature.unit} between two frames", False
    if feature.unit in LIMITS:
        beyond = np.abs(values).max(axis=0)
        for name, value in zip(names, beyond, strict=True):
            if value > LIMITS[feature.unit]:
                yield f"{feature.key}: {name} reaches {value:.0f}, outside its calibrated range", False


def _followed(dataset: Dataset, columns: Mapping[str, npt.NDArray[Any]]) -> Iterator[tuple[str, bool]]:
    for key in (key for key in dataset.features if key == ACTION or key.startswith(f"{ACTION}.")):
        state = key.replace(ACTION, STATE, 1)
        action = dataset.features[key]
        if state not in dataset.features or action.unit not in LEAST_MOTION:
            continue
        states = dataset.features[state]
        if states.names != action.names or states.unit != action.unit:
            continue
        commanded, moved = (np.ptp(columns[name], axis=0) for name in (key, state))
        for name, one, two in zip(action.names, commanded, moved, strict=True):
            if one > LEAST_MOTION[action.unit] and two < 0.1 * one:
                yield f"{key}: {name} moves by {one:.2f} {action.unit}, and {state} by {two:.2f}", True


def _pictures(dataset: Dataset, episode: Episode, key: str) -> Iterator[tuple[str, bool]]:
    count = run = longest = began = at = 0
    before: Any = None
    try:
        for picture in dataset.decoded(episode, key):
            thinned = picture[::8, ::8]
            same = before is not None and np.array_equal(thinned, before)
            run = run + 1 if same else 0
            if run > longest:
                longest, at = run, began
            began = began if same else count
            before = thinned.copy()
            count += 1
    except DatasetError as error:
        yield f"picture {count} cannot be decoded: {error}", True
        return
    if count != episode.length:
        yield f"{count} pictures, and {episode.length} are described", True
    if longest / dataset.fps >= FROZEN_S and longest + 1 < max(count, 2):
        yield f"frozen for {longest / dataset.fps:.1f} s from {at / dataset.fps:.1f} s on", False
    elif count > 1 and longest + 1 == count and count / dataset.fps >= FROZEN_S:
        yield "every picture is the same", False


def _short(values: npt.NDArray[Any]) -> str:
    flat = np.ravel(values)[:4]
    return "[" + ", ".join(f"{value:.4g}" for value in flat) + (", …]" if np.size(values) > 4 else "]")
