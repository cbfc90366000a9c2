"""Find what makes a data set unfit for training: gaps, frozen pictures, jumps, actions without motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from joshua.features import ACTION, STATE, Feature
from joshua_jobs.executor import Executor
from joshua_jobs.processes import in_order

from joshua_dataset.as_messages import units_of
from joshua_dataset.checks.problem import Kind, Problem, computing, converting
from joshua_dataset.from_messages import problems
from joshua_dataset.metadata import ACQUISITION, MESSAGES, STAMP
from joshua_dataset.reader import Dataset, DatasetError, Episode

#: A picture that does not change for this time counts as frozen.
FROZEN_S = 0.5

#: Share of repeated pictures from which a warning is given.
LARGEST_REPEATED = 0.02

#: Largest difference between the mean of all pictures and that of the statistics, which sample them.
PICTURE_MEAN = 0.1

#: Step of a joint between two frames that counts as a jump at 30 Hz, by unit.
LARGEST_STEP = {"rad": 0.5, "deg": 30.0, "lerobot": 25.0}

#: Share of its range by which a joint may exceed it because of noise.
MARGIN = 0.05

#: Values beyond these are outside the calibrated range by more than noise.
LIMITS = {"lerobot": 105.0}

#: A joint whose action moves by more than this, and its state by less than a tenth of that, does not follow.
LEAST_MOTION = {"rad": 0.1, "deg": 6.0, "lerobot": 6.0}


@dataclass(frozen=True)
class Extent:
    """Range, sum and count of some values of a feature.

    Attributes:
        low, high: of each of its numbers, None for pictures; total: their sum; count: how many.
    """

    low: Any
    high: Any
    total: Any
    count: int

    @classmethod
    def of(cls, rows: npt.NDArray[Any]) -> Extent:
        """Return the extent of the rows of a table, (N, D)."""
        values = rows.reshape(len(rows), -1).astype(np.float64)
        return cls(values.min(axis=0), values.max(axis=0), values.sum(axis=0), len(values))

    def joined(self, other: Extent) -> Extent:
        """Return the extent of both."""
        total, count = self.total + other.total, self.count + other.count
        if self.low is None:
            return Extent(None, None, total, count)
        return Extent(np.minimum(self.low, other.low), np.maximum(self.high, other.high), total, count)


def check(folder: Path, *, pictures: bool = True, workers: Executor | int | None = None) -> Iterator[Problem]:
    """Find the problems of a data set, episode by episode.

    Args:
        pictures: decode them, too; workers: an executor, or processes; None for one per core.

    Raises:
        DatasetError: it cannot be read at all.
    """
    dataset = Dataset.read(folder)
    items = ((folder, episode, pictures) for episode in dataset.episode_list())
    episodes = frames = 0
    ends: dict[str, Extent] = {}
    for length, found, parts in in_order(_of_episode, items, workers):
        yield from found
        episodes, frames = episodes + 1, frames + length
        for key, part in parts.items():
            ends[key] = ends[key].joined(part) if key in ends else part
    if episodes != dataset.episodes:
        text = f"meta/info.json counts {dataset.episodes} episodes, and meta/episodes has {episodes}"
        yield Problem(Kind.EPISODES_LOST, text)
    if frames != dataset.frames:
        text = f"meta/info.json counts {dataset.frames} frames, and the episodes have {frames}"
        yield Problem(Kind.INFO_TOTALS, text)
    if dataset.pictures != MESSAGES:
        yield from _lists(dataset)
        yield from _statistics(dataset, ends)


def _lists(dataset: Dataset) -> Iterator[Problem]:
    if dataset.format != "lerobot":
        return
    try:
        has_lists = dataset.has_lists_of_one()
    except DatasetError:
        return  # its episode has reported that its table cannot be read
    if has_lists:
        yield Problem(
            Kind.LISTS_OF_ONE,
            "features of one number are stored as lists of length 1, which LeRobot does not load",
            serious=False,
            remedy=converting(dataset.folder),
        )


def _statistics(dataset: Dataset, ends: Mapping[str, Extent]) -> Iterator[Problem]:
    try:
        there = dataset.statistics()
    except DatasetError as error:
        yield Problem(Kind.STATISTICS_TORN, str(error))
        return
    for key, extent in ends.items():
        known = there.get(key)
        if known is None:
            yield Problem(
                Kind.STATISTICS_MISSING, f"meta/stats.json lacks {key}", remedy=computing(dataset.folder)
            )
            continue
        near = {"min": 1e-4, "max": 1e-4, "mean": PICTURE_MEAN}
        expected_by_name = {"min": extent.low, "max": extent.high, "mean": extent.total / extent.count}
        if extent.low is None:
            del expected_by_name["min"], expected_by_name["max"]
        elif dataset.features[key].unit == "ns":
            del expected_by_name["mean"]  # the mean of times is lost in rounding
        else:
            near["mean"] = 1e-4 + 1e-3 * float(np.max(extent.high - extent.low))
        for name, expected in expected_by_name.items():
            found = np.asarray(known.get(name, np.nan), np.float64)
            found = found.ravel() if extent.low is None else found
            if found.shape != expected.shape or not np.allclose(found, expected, rtol=1e-3, atol=near[name]):
                yield Problem(
                    Kind.STATISTICS_CONTRADICT,
                    f"the {name} of {key} in meta/stats.json is {_short(found)}, "
                    f"and the data have {_short(expected)}",
                    serious=extent.low is not None,
                    remedy=computing(dataset.folder),
                )


def _of_episode(
    item: tuple[Path, Episode, bool],
) -> tuple[int, list[Problem], dict[str, Extent]]:
    folder, episode, pictures = item
    dataset = Dataset.read(folder)
    if dataset.pictures == MESSAGES:
        of_messages = [
            Problem(Kind.MESSAGES_TORN, text, episode.index, serious)
            for text, serious in problems(dataset, episode)
        ]
        return episode.length, of_messages, {}
    try:
        columns = dataset.columns(episode)
    except DatasetError as error:
        return episode.length, [Problem(Kind.ROWS_TORN, str(error), episode.index)], {}
    found = [
        Problem(kind, words, episode.index, is_serious)
        for kind, words, is_serious in _numbers(dataset, episode, columns)
    ]
    extents = {
        feature.key: Extent.of(columns[feature.key])
        for feature in dataset.features.numbers
        if len(columns[feature.key])
    }
    for feature in dataset.features.pictures if pictures else ():
        seen = _Seen()
        texts = _pictures(dataset, episode, feature.key, seen)
        found += [
            Problem(kind, f"{feature.key}: {text}", episode.index, serious) for kind, text, serious in texts
        ]
        if seen.count:
            extents[feature.key] = Extent(None, None, seen.total / 255, seen.count)
    return episode.length, found, extents


class _Seen:
    """Sum of the mean colours of some pictures."""

    count = 0
    total: Any = 0.0


def _numbers(
    dataset: Dataset, episode: Episode, columns: Mapping[str, npt.NDArray[Any]]
) -> Iterator[tuple[Kind, str, bool]]:
    length = len(columns["frame_index"]) if "frame_index" in columns else 0
    if length != episode.length:
        yield (
            Kind.EPISODE_LENGTH,
            f"{episode.table.name} has {length} frames, and {episode.length} are described",
            True,
        )
        return
    if not length:
        yield Kind.EPISODE_LENGTH, "it has no frame", True
        return
    if not np.array_equal(columns["frame_index"], np.arange(length)):
        yield Kind.FRAME_INDEX, "frame_index does not count from 0 without gaps", True
    expected_s = np.arange(length) / dataset.fps
    worst_s = float(np.abs(columns["timestamp"] - expected_s).max())
    if worst_s > 1e-3 + 1e-6 * length:
        yield Kind.TIMESTAMP, f"timestamp is up to {worst_s:.3f} s away from frame_index / fps", True
    if STAMP in columns:
        steps_s = np.diff(columns[STAMP]) / 1e9
        if np.any(steps_s <= 0):
            yield Kind.STAMPS, f"{STAMP} does not increase", True
        gaps = int(np.sum(steps_s > 1.5 / dataset.fps))
        if gaps:
            yield (
                Kind.RECORDING_GAP,
                f"{gaps} gaps in the recording, the longest {steps_s.max():.2f} s",
                False,
            )
    for feature in dataset.features.numbers:
        values = columns[feature.key].reshape(length, -1)
        if not np.isfinite(values).all():
            yield Kind.ROWS_NOT_FINITE, f"{feature.key} has values that are not finite", True
        elif feature.unit in LARGEST_STEP:
            yield from _joints(dataset, feature, values)
    yield from _followed(dataset, columns)
    yield from _repeated(dataset, columns)


def _joints(dataset: Dataset, feature: Feature, values: npt.NDArray[Any]) -> Iterator[tuple[Kind, str, bool]]:
    names = feature.names or tuple(map(str, range(values.shape[1])))
    if len(values) > 1:
        steps = np.abs(np.diff(values, axis=0)).max(axis=0)
        limit = LARGEST_STEP[feature.unit] * max(1.0, 30 / dataset.fps)
        for name, step in zip(names, steps, strict=True):
            if step > limit:
                yield (
                    Kind.JUMP,
                    f"{feature.key}: {name} jumps by {step:.2f} {feature.unit} between two frames",
                    False,
                )
    if feature.unit in LIMITS:
        beyond = np.abs(values).max(axis=0)
        for name, value in zip(names, beyond, strict=True):
            if value > LIMITS[feature.unit]:
                yield (
                    Kind.OUT_OF_RANGE,
                    f"{feature.key}: {name} reaches {value:.0f}, outside its calibrated range",
                    False,
                )
    units = units_of(dataset.identity, feature.key)
    if feature.unit not in LIMITS and units is not None and len(units.joints) == values.shape[1]:
        in_rad = np.radians(values) if feature.unit == "deg" else values
        for number, joint in enumerate(units.joints):
            margin = MARGIN * (joint.max_rad - joint.min_rad)
            low, high = float(in_rad[:, number].min()), float(in_rad[:, number].max())
            if low < joint.min_rad - margin or high > joint.max_rad + margin:
                yield (
                    Kind.OUT_OF_RANGE,
                    (
                        f"{feature.key}: {joint.name} moves from {low:.2f} to {high:.2f} rad, outside its "
                        f"calibrated range of {joint.min_rad:.2f} to {joint.max_rad:.2f}"
                    ),
                    False,
                )


def _followed(dataset: Dataset, columns: Mapping[str, npt.NDArray[Any]]) -> Iterator[tuple[Kind, str, bool]]:
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
                yield (
                    Kind.NOT_FOLLOWED,
                    f"{key}: {name} moves by {one:.2f} {action.unit}, but {state} by {two:.2f}",
                    True,
                )


def _repeated(dataset: Dataset, columns: Mapping[str, npt.NDArray[Any]]) -> Iterator[tuple[Kind, str, bool]]:
    """Find pictures that occur in two frames, because their camera is slower than the frame rate."""
    for number, key in enumerate(dataset.features[ACQUISITION].names if ACQUISITION in columns else ()):
        if key in dataset.features and dataset.features[key].is_picture:
            steps = np.diff(columns[ACQUISITION][:, number])
            yield from _repetitions(key, int(np.sum(steps == 0)), len(steps) + 1)


def _repetitions(what: str, count: int, frames: int) -> Iterator[tuple[Kind, str, bool]]:
    if count > LARGEST_REPEATED * frames:
        yield Kind.REPEATED, f"{what}: {count} of {frames} pictures repeat the previous one", False


def _pictures(dataset: Dataset, episode: Episode, key: str, seen: _Seen) -> Iterator[tuple[Kind, str, bool]]:
    count = run = longest = began = at = repeated = 0
    before: Any = None
    whole: Any = None
    try:
        for picture in dataset.decoded(episode, key):
            thinned = picture[::8, ::8]
            same = before is not None and np.array_equal(thinned, before)
            repeated += same and np.array_equal(picture, whole)
            run = run + 1 if same else 0
            if run > longest:
                longest, at = run, began
            began = began if same else count
            before, whole = thinned.copy(), picture
            seen.total = seen.total + thinned.reshape(-1, 3).mean(axis=0)
            count += 1
            seen.count = count
    except DatasetError as error:
        yield Kind.VIDEO_TORN, f"picture {count} cannot be decoded: {error}", True
        return
    if count != episode.length:
        yield Kind.VIDEO_SHORT, f"{count} pictures, and {episode.length} are described", True
    if longest / dataset.fps >= FROZEN_S and longest + 1 < max(count, 2):
        yield Kind.FROZEN, f"frozen for {longest / dataset.fps:.1f} s from {at / dataset.fps:.1f} s on", False
    elif count > 1 and longest + 1 == count and count / dataset.fps >= FROZEN_S:
        yield Kind.FROZEN, "every picture is the same", False
    elif ACQUISITION not in dataset.features:  # which shows it exactly
        yield from (
            (kind, text.partition(": ")[2], serious)
            for kind, text, serious in _repetitions(key, repeated, count)
        )


def _short(values: npt.NDArray[Any]) -> str:
    flat = np.ravel(values)[:4]
    return "[" + ", ".join(f"{value:.4g}" for value in flat) + (", …]" if np.size(values) > 4 else "]")
