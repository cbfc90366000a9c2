"""The real LeRobot as the oracle of `joshua dataset check`.

Each column, field and file of a data set is damaged. What makes LeRobot raise, or return something else than
the undamaged data set, is named by the check; so is what contradicts anything else. What cannot be seen is
listed in ``damaging.UNSEEN`` and in the guide.
"""

from __future__ import annotations

import gc
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("lerobot", reason="needs the environment of the session learn")

import torch
from damaging import FPS, LENGTHS, TASKS, TOP, Damage, damages, is_unseen, picture_of, value_of, write_sound
from joshua_dataset.checking import check
from joshua_dataset.reader import DatasetError
from lerobot.datasets import video_utils
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.datasets.sampler import EpisodeAwareSampler
from lerobot.datasets.utils import dataset_to_policy_features

#: Of so many damages one is tried; each takes LeRobot and the check about a second. 1 tries all of them.
STRIDE = int(os.environ.get("DAMAGE_STRIDE", "17"))

FIGURES = ("min", "max", "mean", "std", "count")


def write_theirs(folder: Path) -> None:
    """The same frames, written by LeRobot itself."""
    joints = {"dtype": "float32", "shape": (2,), "names": ["pan.pos", "lift.pos"]}
    camera = {"dtype": "video", "shape": (48, 64, 3), "names": ["height", "width", "channels"]}
    features = {"observation.state": joints, "action": joints, TOP: camera}
    made = LeRobotDataset.create("me/theirs", FPS, features, root=folder, robot_type="arm", vcodec="h264")
    for episode, (length, task) in enumerate(zip(LENGTHS, TASKS, strict=True)):
        for number in range(length):
            made.add_frame(
                {
                    "observation.state": np.array(value_of(episode, number), np.float32),
                    "action": np.array(value_of(episode, number + 1), np.float32),
                    TOP: picture_of(episode, number),
                    "task": task,
                }
            )
        made.save_episode()
    made.finalize()


WRITERS = {"ours": write_sound, "theirs": write_theirs}


def flat(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every value in nested objects, arrays as lists."""
    if isinstance(value, dict):
        for key in sorted(value):
            yield from flat(value[key], f"{path}/{key}")
    elif isinstance(value, torch.Tensor | np.ndarray):
        yield path, (tuple(value.shape), value.tolist())
    else:
        yield path, value


def seen_by_lerobot(folder: Path) -> dict[str, Any]:
    """Everything that a training takes from a data set: items, a batch, statistics, sampler and features."""
    deltas = {"action": [0.0, 1 / FPS], "observation.state": [-1 / FPS, 0.0]}
    try:
        loaded = LeRobotDataset("me/set", root=folder, delta_timestamps=deltas)
        found: dict[str, Any] = {}
        for number in range(len(loaded)):
            found |= {f"{number}{path}": value for path, value in flat(loaded[number])}
        batch = next(iter(torch.utils.data.DataLoader(loaded, batch_size=len(loaded))))
        found |= {f"batch{path}": value for path, value in flat(batch)}
        episodes = loaded.meta.episodes
        sampler = EpisodeAwareSampler(episodes["dataset_from_index"], episodes["dataset_to_index"])
        found["sampler"] = list(sampler)
        used = dataset_to_policy_features(loaded.meta.features)
        found["features"] = {key: (feature.type, feature.shape) for key, feature in used.items()}
        for key in used:
            found |= {f"{key}/{name}": loaded.meta.stats[key][name].tolist() for name in FIGURES}
        found["counts"] = (len(loaded), loaded.num_episodes, loaded.fps, loaded.meta.total_tasks)
        return found
    finally:
        video_utils._default_decoder_cache.clear()  # it would hold the files of the copy before


@pytest.fixture(scope="module", params=sorted(WRITERS))
def sound(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a sound data set, named like who wrote it."""
    folder = tmp_path_factory.mktemp("sound") / str(request.param)
    WRITERS[request.param](folder)
    assert [str(problem) for problem in check(folder, workers=1)] == []
    return folder


@pytest.fixture(autouse=True)
def no_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep what `datasets` caches of each copy out of the user's folder."""
    import datasets

    monkeypatch.setattr(datasets.config, "HF_DATASETS_CACHE", tmp_path / "cache")


def named(folder: Path) -> list[bool]:
    """Return for each problem that a check names whether it is serious."""
    try:
        return [problem.serious for problem in check(folder, workers=1)]
    except DatasetError:
        return [True]  # it is no data set at all, and the command says so


def judged(sound: Path, damage: Damage, copy: Path, expected: dict[str, Any]) -> str:
    """Return what is wrong with the check of a damage; "" if nothing is."""
    shutil.copytree(sound, copy)
    damage.apply(copy)
    problems = named(copy)
    try:
        found = seen_by_lerobot(copy)
        said = "" if found == expected else "returns something else"
    except Exception as error:  # noqa: BLE001 - whatever stops it
        said = f"raises {type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}"
    shutil.rmtree(copy)
    gc.collect()
    if not problems and not is_unseen(damage.name):
        return f"{damage.name}: not named; LeRobot {said or 'returns the same'}"
    if said.startswith("raises") and not any(problems):
        return f"{damage.name}: no error is named, but LeRobot {said}"
    return ""


def test_what_stops_lerobot_or_contradicts_something_is_named(sound: Path, tmp_path: Path) -> None:
    expected = seen_by_lerobot(sound)
    assert len(expected) > 100
    wrong = []
    chosen = list(damages(sound))[::STRIDE]
    for number, damage in enumerate(chosen):
        wrong.append(judged(sound, damage, tmp_path / f"{number:04d}", expected))
    assert [text for text in wrong if text] == []
    assert len(chosen) * STRIDE > 1_300
