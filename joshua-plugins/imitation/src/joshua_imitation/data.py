"""A data set in memory: the joints of all frames, and the windows that a policy learns from."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from joshua.features import ACTION, STATE
from joshua.tools import parse_json
from joshua_dataset.decoding import DatasetError
from joshua_dataset.fitness import UnfitError, require_fit
from joshua_dataset.reader import Dataset, Episode
from joshua_training.run_folder import RunError, unusable

from joshua_imitation.joined import with_joined_arms
from joshua_imitation.stream import Stream

Array = npt.NDArray[Any]

_log = logging.getLogger(__name__)

PICTURES = "observation.images."

#: State of the environment, which LeRobot's policies accept beside or instead of pictures.
SURROUNDINGS = "observation.environment_state"


@dataclass(frozen=True)
class Windows:
    """Frames around one that a policy sees and predicts, as offsets; () for the frame itself."""

    seen: tuple[int, ...] = ()
    done: tuple[int, ...] = ()


class Recording:
    """The numbers of a data set, all frames one after the other.

    Args:
        dataset: its metadata; cameras: to learn from, () for all.
        stream: that the data set comes from, None for a folder.

    Attributes:
        episodes: in their order; numbers: by key, (N, D) float32; pictures: keys of cameras.
        first, last: of the episode of each frame, (N,); tasks: text of each frame.

    Raises:
        RunError: it cannot be read, or is empty.
    """

    def __init__(self, dataset: Dataset, cameras: Sequence[str] = (), stream: Stream | None = None) -> None:
        self.dataset, self.stream = dataset, stream
        keys = [key for key in (STATE, SURROUNDINGS, ACTION) if key in dataset.features]
        parts: dict[str, list[Array]] = {key: [] for key in keys}
        self.tasks: list[str] = []
        try:
            self.episodes: list[Episode] = list(dataset.episode_list())
            for episode in self.episodes:
                columns = dataset.columns(episode)
                for key in keys:
                    parts[key].append(np.asarray(columns[key], np.float32))
                which = columns.get("task_index")
                self.tasks += (
                    [dataset.tasks[int(index)] for index in which]
                    if which is not None and dataset.tasks
                    else [" ".join(episode.tasks)] * episode.length
                )
        except (DatasetError, IndexError) as error:
            raise RunError(f"{error}: run `joshua dataset check {dataset.folder}`") from error
        if len(self.episodes) != dataset.episodes:
            raise RunError(
                f"{dataset.folder} says that it has {dataset.episodes} episodes, but describes "
                f"{len(self.episodes)}: run `joshua dataset check {dataset.folder}`"
            )
        if not self.episodes or not self.tasks:
            raise RunError(f"{dataset.folder} has no episode to learn from: record some")
        self.numbers = {key: np.concatenate(values) for key, values in parts.items()}
        lengths = [len(values) for values in parts[ACTION]]
        ends = np.cumsum(lengths)
        self.first = np.repeat(ends - lengths, lengths)
        self.last = np.repeat(ends - 1, lengths)
        wanted = {f"{PICTURES}{name}" for name in cameras}
        self.pictures = [
            feature.key for feature in dataset.features.pictures if not wanted or feature.key in wanted
        ]

    def __len__(self) -> int:
        return len(self.first)

    def frames(self, episodes: Sequence[int], drop_last: int = 0) -> Array:
        """Return the numbers of the frames of some episodes, without the last ones of each."""
        starts = np.unique(self.first)
        ends = np.append(starts[1:], len(self))
        found = [np.arange(starts[i], max(starts[i], ends[i] - drop_last)) for i in episodes]
        return np.concatenate(found) if found else np.zeros(0, np.int64)

    def split(self, share: float, seed: int) -> tuple[list[int], list[int]]:
        """Return the episodes to learn from and those kept back, drawn by the seed."""
        count = len(self.episodes)
        kept = min(count - 1, max(1, round(share * count))) if share > 0 else 0
        back = set(np.random.default_rng([seed, 1]).permutation(count)[:kept].tolist())
        return [i for i in range(count) if i not in back], sorted(back)

    def window(self, frames: Array, distances: tuple[int, ...]) -> tuple[Array, Array]:
        """Return the frames at some offsets, (B, K), clipped to their episode, and which are outside it."""
        wanted = frames[:, None] + np.asarray(distances)
        held = np.clip(wanted, self.first[frames, None], self.last[frames, None])
        return held, held != wanted


def refuse_other_data(before: Path, dataset: Dataset) -> None:
    """Refuse to continue a run with the data set of another robot, or with other episodes.

    Args:
        before: description of the data set so far, in a checkpoint.

    Raises:
        RunError: rate, robot, inputs, joints or episodes differ; names the first.
    """
    try:
        info = parse_json(before.read_text(encoding="utf-8"))
        old, new = _identity(info), _identity(dataset.info)
        counts = [f"{each['total_episodes']} episodes of {each['total_frames']} frames in all"
                  for each in (info, dataset.info)]  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        reason = f"{before.name} does not describe a data set ({type(error).__name__}: {error})"
        raise unusable(before.parent.parent, reason) from error
    for what in {**old, **new}:
        if old.get(what) != new.get(what):
            raise RunError(
                f"the run was started with a data set whose {what} is {old.get(what, 'absent')}, but in "
                f"{dataset.folder} it is {new.get(what, 'absent')}: continue with the data set of the run, "
                "or start a new run"
            )
    if counts[0] != counts[1]:
        raise RunError(
            f"the run was started with {counts[0]}, but {dataset.folder} has {counts[1]}: other episodes "
            "change the order of the batches, the normalisation, and which episodes are for validation. "
            f'Remove resume_run, and write pretrained: "{before.parent}" to start a new run from its weights'
        )


def _identity(info: Mapping[str, Any]) -> dict[str, Any]:
    """Return what makes a data set that of a robot; the sizes of pictures are compared elsewhere."""
    found = {"fps": info["fps"], "robot_type": info.get("robot_type")}
    for key, feature in info["features"].items():
        if key.startswith(PICTURES):
            found[key] = "a camera"
        elif key in (STATE, SURROUNDINGS, ACTION):
            found[key] = feature.get("names") or feature["shape"]
    return found


def open_dataset(
    place: str, videos: Path | None = None, *, checks: bool = True
) -> tuple[Dataset, Stream | None]:
    """Read the metadata of a data set: in a folder, on the hub by its id, or at an address that is streamed.

    LeRobot's loader fetches a data set that is named by its id.

    Args:
        videos: folder of the blocks of a stream that another process opened, None for one of its own.
        checks: refuse errors in the tables, the statistics and the headers of the videos. The videos of a
            stream are not there yet, and are checked when they are decoded.

    Raises:
        RunError: it does not exist, cannot be read, or has errors.
    """
    if "://" not in place:
        folder = Path(place)
        found = _read(folder if folder.is_dir() else _fetched(place))
        if checks:
            _refuse_errors(found.folder, "")
        return with_joined_arms(found), None
    stream = Stream(place, videos)
    try:
        found = _read(stream.folder)
        if checks:
            _refuse_errors(found.folder, place)
        return with_joined_arms(found), stream
    except RunError:
        stream.close()
        raise


def _read(folder: Path) -> Dataset:
    try:
        found = Dataset.read(folder)
    except DatasetError as error:
        raise RunError(f"{error}: run `joshua dataset check {folder}`") from error
    if found.version != "v3.0" or found.format != "lerobot":
        raise RunError(
            f"{folder} has the layout {found.version}, {found.format}: run `joshua dataset convert {folder} "
            "TARGET`, and train on TARGET"
        )
    return found


def _refuse_errors(folder: Path, address: str) -> None:
    """Refuse a data set in which a check finds errors, and log its warnings. Raises RunError.

    Args:
        address: of a stream, whose copy here is temporary; "" for a folder.
    """
    try:
        for problem in require_fit(folder, "learned from", videos=not address):
            _log.warning("%s: %s", address or folder, problem.sentence)
    except UnfitError as error:
        if not address:
            raise RunError(str(error)) from error
        raise RunError(
            f"{address} cannot be learned from: {error.problems[0].sentence}: run `joshua dataset download "
            f"{address} FOLDER`, then `joshua dataset repair FOLDER`"
        ) from error
    except DatasetError as error:
        raise RunError(f"{error}: run `joshua dataset check {folder}`") from error


def _fetched(name: str) -> Path:
    if Path(name).is_absolute():
        raise RunError(
            f"{name} does not exist: correct dataset_name, or give the data set the same path on every "
            "machine, for example on a network file system"
        )
    from huggingface_hub.utils.tqdm import disable_progress_bars
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    disable_progress_bars()  # they would fill the log
    try:
        return Path(LeRobotDataset(name).root)
    except Exception as error:
        said = str(error).strip().partition("\n")[0]
        raise RunError(
            f"{name} is not a folder here, and LeRobot cannot load it from the hub: {type(error).__name__}: "
            f"{said}: correct dataset_name, or connect this machine"
        ) from error
