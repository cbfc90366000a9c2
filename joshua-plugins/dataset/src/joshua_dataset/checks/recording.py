"""Check what was recorded: gaps, jumps, joints out of range, actions without motion, frozen pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from joshua.features import ACTION, STATE, Feature

from joshua_dataset.as_messages import units_of
from joshua_dataset.checks.measured import Colours
from joshua_dataset.checks.problem import Kind, Problem, repairing
from joshua_dataset.metadata import ACQUISITION, STAMP
from joshua_dataset.reader import Dataset, DatasetError, Episode

#: A picture that does not change for this time counts as frozen.
FROZEN_S = 0.5

#: Share of repeated pictures from which a warning is given.
LARGEST_REPEATED = 0.02

#: Step of a joint between two frames that counts as a jump at 30 Hz, by unit.
LARGEST_STEP = {"rad": 0.5, "deg": 30.0, "lerobot": 25.0}

#: Share of its range by which a joint may exceed it because of noise.
MARGIN = 0.05

#: Values beyond these are outside the calibrated range by more than noise.
LIMITS = {"lerobot": 105.0}

#: A joint whose action moves by more than this, and its state by less than a tenth of that, does not follow.
LEAST_MOTION = {"rad": 0.1, "deg": 6.0, "lerobot": 6.0}

Columns = Mapping[str, npt.NDArray[Any]]


def of_numbers(dataset: Dataset, episode: Episode, columns: Columns) -> Iterator[Problem]:
    """Yield the problems of the numbers of an episode, which has at least one row."""
    index, length = episode.index, len(columns["episode_index"])
    if STAMP in columns:
        steps_s = np.diff(columns[STAMP]) / 1e9
        if np.any(steps_s <= 0):
            remedy = repairing(dataset.folder)
            yield Problem(Kind.STAMPS, f"{STAMP} does not increase", index, remedy=remedy)
        gaps = int(np.sum(steps_s > 1.5 / dataset.fps))
        if gaps:
            text = f"{gaps} gaps in the recording, the longest {steps_s.max():.2f} s"
            yield Problem(Kind.RECORDING_GAP, text, index, serious=False)
    for feature in dataset.features.numbers:
        values = columns[feature.key].reshape(length, -1)
        if not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
            text = f"{feature.key} has values that are not finite, first in frame {row}"
            yield Problem(Kind.ROWS_NOT_FINITE, text, index, remedy=repairing(dataset.folder))
        elif feature.unit in LARGEST_STEP:
            yield from _joints(dataset, feature, values, index)
    yield from _followed(dataset, columns, index)
    yield from _repeated(dataset, columns, index)


def _joints(dataset: Dataset, feature: Feature, values: npt.NDArray[Any], index: int) -> Iterator[Problem]:
    width = values.shape[1]
    names = feature.names if len(feature.names) == width else tuple(map(str, range(width)))
    if len(values) > 1:
        steps = np.abs(np.diff(values, axis=0)).max(axis=0)
        limit = LARGEST_STEP[feature.unit] * max(1.0, 30 / dataset.fps)
        for name, step in zip(names, steps, strict=True):
            if step > limit:
                text = f"{feature.key}: {name} jumps by {step:.2f} {feature.unit} between two frames"
                yield Problem(Kind.JUMP, text, index, serious=False)
    if feature.unit in LIMITS:
        beyond = np.abs(values).max(axis=0)
        for name, value in zip(names, beyond, strict=True):
            if value > LIMITS[feature.unit]:
                text = f"{feature.key}: {name} reaches {value:.0f}, outside its calibrated range"
                yield Problem(Kind.OUT_OF_RANGE, text, index, serious=False)
    units = units_of(dataset.identity, feature.key)
    if feature.unit not in LIMITS and units is not None and len(units.joints) == values.shape[1]:
        in_rad = np.radians(values) if feature.unit == "deg" else values
        for number, joint in enumerate(units.joints):
            margin = MARGIN * (joint.max_rad - joint.min_rad)
            low, high = float(in_rad[:, number].min()), float(in_rad[:, number].max())
            if low < joint.min_rad - margin or high > joint.max_rad + margin:
                text = (
                    f"{feature.key}: {joint.name} moves from {low:.2f} to {high:.2f} rad, outside its "
                    f"calibrated range of {joint.min_rad:.2f} to {joint.max_rad:.2f}"
                )
                yield Problem(Kind.OUT_OF_RANGE, text, index, serious=False)


def _followed(dataset: Dataset, columns: Columns, index: int) -> Iterator[Problem]:
    for key in (key for key in dataset.features if key == ACTION or key.startswith(f"{ACTION}.")):
        state = key.replace(ACTION, STATE, 1)
        action = dataset.features[key]
        if state not in dataset.features or action.unit not in LEAST_MOTION:
            continue
        states = dataset.features[state]
        if states.names != action.names or states.unit != action.unit or states.shape != action.shape:
            continue
        if (len(action.names),) != action.shape:
            continue  # info.json contradicts itself, which its own check says
        commanded, moved = (np.ptp(columns[name], axis=0) for name in (key, state))
        for name, one, two in zip(action.names, commanded, moved, strict=True):
            if one > LEAST_MOTION[action.unit] and two < 0.1 * one:
                text = f"{key}: {name} moves by {one:.2f} {action.unit}, but {state} by {two:.2f}"
                yield Problem(Kind.NOT_FOLLOWED, text, index)


def _repeated(dataset: Dataset, columns: Columns, index: int) -> Iterator[Problem]:
    """Find pictures that occur in two frames, because their camera is slower than the frame rate."""
    for number, key in enumerate(dataset.features[ACQUISITION].names if ACQUISITION in columns else ()):
        if key in dataset.features and dataset.features[key].is_picture:
            steps = np.diff(columns[ACQUISITION][:, number])
            yield from _repetitions(key, int(np.sum(steps == 0)), len(steps) + 1, index)


def _repetitions(key: str, count: int, frames: int, index: int) -> Iterator[Problem]:
    if count > LARGEST_REPEATED * frames:
        text = f"{key}: {count} of {frames} pictures repeat the previous one"
        yield Problem(Kind.REPEATED, text, index, serious=False)


@dataclass
class _Still:
    """Pictures that are the same as the one before.

    Attributes:
        count: pictures seen; repeated: how many of them are exactly the same as the one before.
        run: length of the present run; longest: of the longest one; at: where that began.
    """

    count: int = 0
    repeated: int = 0
    run: int = 0
    longest: int = 0
    at: int = 0
    began: int = 0

    def add(self, *, is_same: bool, is_repeated: bool) -> None:
        """Take the next picture."""
        self.repeated += is_repeated
        self.run = self.run + 1 if is_same else 0
        if self.run > self.longest:
            self.longest, self.at = self.run, self.began
        if not is_same:
            self.began = self.count
        self.count += 1


def of_pictures(dataset: Dataset, episode: Episode, key: str) -> tuple[list[Problem], Colours | None]:
    """Decode the pictures of a feature; return their problems, and their mean colour."""
    still = _Still()
    total: Any = 0.0
    before: Any = None
    whole: Any = None
    remedy = repairing(dataset.folder)
    try:
        for picture in dataset.decoded(episode, key):
            thinned = picture[::8, ::8]
            is_same = before is not None and np.array_equal(thinned, before)
            still.add(is_same=is_same, is_repeated=is_same and np.array_equal(picture, whole))
            before, whole = thinned.copy(), picture
            total = total + thinned.reshape(-1, 3).mean(axis=0) / 255
    except DatasetError as error:
        kind = Kind.VIDEO_TORN if episode.pictures[key].path.suffix == ".mp4" else Kind.PICTURES_TORN
        text = f"{key}: picture {still.count} cannot be decoded: {error}"
        return [Problem(kind, text, episode.index, remedy=remedy)], None
    found = list(_of_stills(dataset, episode, key, still))
    if still.count != episode.length:
        text = f"{key}: {still.count} pictures, and {episode.length} are described"
        found.insert(0, Problem(Kind.VIDEO_SHORT, text, episode.index, remedy=remedy))
    return found, Colours(still.count, total) if still.count else None


def _of_stills(dataset: Dataset, episode: Episode, key: str, still: _Still) -> Iterator[Problem]:
    count, longest, fps = still.count, still.longest, dataset.fps
    if longest / fps >= FROZEN_S and longest + 1 < max(count, 2):
        text = f"{key}: frozen for {longest / fps:.1f} s from {still.at / fps:.1f} s on"
        yield Problem(Kind.FROZEN, text, episode.index, serious=False)
    elif count > 1 and longest + 1 == count and count / fps >= FROZEN_S:
        yield Problem(Kind.FROZEN, f"{key}: every picture is the same", episode.index, serious=False)
    elif ACQUISITION not in dataset.features:  # which shows it exactly
        yield from _repetitions(key, still.repeated, count, episode.index)
