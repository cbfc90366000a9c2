"""Data sets of ours in the real LeRobot, and LeRobot's in our tools."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset

pytest.importorskip("lerobot", reason="needs the environment of the session learn")

from hub_server import TOKEN, HubServer
from joshua.features import DatasetLayout, Feature, FeatureSet, Frame
from joshua_dataset.checking import check
from joshua_dataset.commands.dataset import description
from joshua_dataset.reader import Dataset
from joshua_dataset.writer import LeRobotWriter
from serving import serving

JOINTS = ("shoulder_pan.pos", "gripper.pos")
TOP = "observation.images.top"
FPS = 20
LENGTHS = (30, 12, 20)


def picture(number: int) -> Any:
    ramp = np.linspace(0, 200, 96, dtype=np.uint8)
    return np.stack([np.roll(np.tile(ramp, (64, 1)), number, axis=1)] * 3, axis=2)


def ours(folder: Path) -> Dataset:
    features = FeatureSet(
        [
            Feature.joints("observation.state", JOINTS, unit="lerobot"),
            Feature.joints("action", JOINTS, unit="lerobot"),
            Feature.picture(TOP, 64, 96),
        ]
    )
    layout = DatasetLayout(folder, "so101_follower", FPS, features)
    with contextlib.closing(LeRobotWriter(layout)) as writer:
        writer.open()
        for episode, length in enumerate(LENGTHS):
            for number in range(length):
                values = {
                    "observation.state": [number, episode],
                    "action": [number + 0.5, -episode],
                    TOP: picture(number),
                }
                writer.add_frame(Frame(1_000_000_000 + number * 50_000_000, values))
            writer.end_episode("stack" if episode else "sort")
    return Dataset.read(folder)


def test_lerobot_loads_ours_with_every_value_equal(tmp_path: Path) -> None:
    there = ours(tmp_path / "set")
    loaded = LeRobotDataset("me/set", root=tmp_path / "set")
    assert (len(loaded), loaded.num_episodes, loaded.fps) == (sum(LENGTHS), 3, FPS)
    index = 0
    for episode in there.episode_list():
        columns, pictures = there.columns(episode), list(there.decoded(episode, TOP))
        for number in range(episode.length):
            item = loaded[index]
            for key in ("observation.state", "action"):
                assert np.array_equal(item[key].numpy(), columns[key][number])
            assert item["timestamp"].item() == pytest.approx(number / FPS)
            assert (item["task"], item["episode_index"].item()) == (episode.tasks[0], episode.index)
            seen = np.rint(item[TOP].permute(1, 2, 0).numpy() * 255)
            assert np.abs(seen - pictures[number]).max() <= 1
            assert np.abs(seen - picture(number)).mean() < 4
            index += 1
    stats = loaded.meta.stats
    assert stats["action"]["max"].tolist() == [29.5, 0.0]
    assert stats[TOP]["mean"].shape == (3, 1, 1)


def by_datasets(folder: Path) -> Any:
    """The table of a data set as the library ``datasets`` reads it."""
    import datasets

    files = [str(path) for path in sorted((folder / "data").rglob("*.parquet"))]
    return datasets.load_dataset(
        "parquet", data_files=files, split="train", cache_dir=str(folder.with_name("cache"))
    )


def test_datasets_library_reads_ours(tmp_path: Path) -> None:
    ours(tmp_path / "set")
    table = by_datasets(tmp_path / "set")
    assert len(table) == sum(LENGTHS)
    assert table[3]["action"] == [3.5, 0.0]


SINGLE = FeatureSet(
    [
        Feature.joints("observation.state", ("motor",)),
        Feature.joints("action", ("motor",)),
        Feature("next.reward", "float32", (1,)),
        Feature("intervention", "bool", (1,)),
    ]
)


def single(number: int) -> dict[str, Any]:
    """A frame of features of one number each."""
    return {
        "observation.state": np.array([number], np.float32),
        "action": np.array([number + 0.5], np.float32),
        "next.reward": np.array([-number], np.float32),
        "intervention": np.array([number % 3 == 0]),
    }


def test_features_of_one_number_are_as_lerobot_writes_them(tmp_path: Path) -> None:
    described = {key: item | {"shape": (1,)} for key, item in SINGLE.as_lerobot().items()}
    theirs = LeRobotDataset.create("me/theirs", FPS, described, root=tmp_path / "theirs", use_videos=False)
    with contextlib.closing(LeRobotWriter(DatasetLayout(tmp_path / "ours", "", FPS, SINGLE))) as writer:
        writer.open()
        for length in LENGTHS:
            for number in range(length):
                writer.add_frame(Frame(1_000_000_000 + number * 50_000_000, single(number)))
                theirs.add_frame(single(number) | {"task": "turn"})
            writer.end_episode("turn")
            theirs.save_episode()
        theirs.finalize()
    names = ("theirs", "ours")
    one, two = (LeRobotDataset("me/set", root=tmp_path / name) for name in names)
    assert len(one) == len(two) == sum(LENGTHS)
    for key in SINGLE:
        for index in (0, 35, 61):
            expected, found = one[index][key], two[index][key]
            assert (found.dtype, found.shape, found.item()) == (
                expected.dtype,
                expected.shape,
                expected.item(),
            )
        assert one.hf_dataset.features[key] == two.hf_dataset.features[key]
        assert {name: value.shape for name, value in two.meta.stats[key].items()} == {
            name: value.shape for name, value in one.meta.stats[key].items()
        }
        for name in ("min", "max", "mean"):
            assert two.meta.stats[key][name] == pytest.approx(one.meta.stats[key][name].astype(float))
    assert by_datasets(tmp_path / "ours")[35]["action"] == 5.5
    expected_rows = [single(number) for number in range(LENGTHS[1])]
    for name in names:
        there = Dataset.read(tmp_path / name)
        (episode,) = there.episode_list({1})
        columns = there.columns(episode)
        for key in SINGLE:
            assert columns[key].tolist() == [row[key].tolist() for row in expected_rows]
            stored = episode.statistics[key]
            assert (stored["max"], stored["count"]) == ([columns[key].max()], [LENGTHS[1]])
        assert [str(problem) for problem in check(tmp_path / name, workers=1) if problem.serious] == []


def test_lerobot_loads_a_demonstration(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="records in a simulation")
    from joshua.cli.main import main

    assert main(["demonstrate", "SoArm100Reach-v0", str(tmp_path / "reach"), "--episodes", "1"]) == 0
    loaded = LeRobotDataset("me/reach", root=tmp_path / "reach")
    columns = (there := Dataset.read(tmp_path / "reach")).columns(next(there.episode_list()))
    assert len(loaded) == len(columns["action"])
    last = loaded[len(loaded) - 1]
    for key in there.features:
        assert last[key].reshape(-1).tolist() == columns[key][-1].tolist()
    assert {last[key].shape for key in last if key.startswith("next.")} == {()}


def test_our_tools_read_lerobots(tmp_path: Path) -> None:
    described = {
        "observation.state": {"dtype": "float32", "shape": (2,), "names": list(JOINTS)},
        "action": {"dtype": "float32", "shape": (2,), "names": list(JOINTS)},
        TOP: {"dtype": "video", "shape": (64, 96, 3), "names": ["height", "width", "channels"]},
    }
    made = LeRobotDataset.create(
        "me/theirs", FPS, described, root=tmp_path / "theirs", robot_type="so101_follower"
    )
    for length in LENGTHS:
        for number in range(length):
            made.add_frame(
                {
                    "observation.state": np.array([number, length], np.float32),
                    "action": np.array([number, -length], np.float32),
                    TOP: picture(number),
                    "task": "stack",
                }
            )
        made.save_episode()
    made.finalize()
    found = Dataset.read(tmp_path / "theirs")
    assert (found.episodes, found.frames, found.tasks) == (3, sum(LENGTHS), ("stack",))
    assert found.features["action"].unit == "lerobot"
    for episode in found.episode_list():
        assert episode.length == LENGTHS[episode.index]
        columns = found.columns(episode)
        assert columns["action"].tolist() == [[number, -episode.length] for number in range(episode.length)]
        pictures = list(found.decoded(episode, TOP))
        assert len(pictures) == episode.length
        assert max(np.abs(seen.astype(int) - picture(i)).mean() for i, seen in enumerate(pictures)) < 6
    assert f"3 episodes, {sum(LENGTHS)} frames" in description(tmp_path / "theirs")
    assert [str(problem) for problem in check(tmp_path / "theirs", workers=1) if problem.serious] == []


def test_lerobots_tools_split_and_merge_ours(tmp_path: Path) -> None:
    from lerobot.datasets.dataset_tools import delete_episodes, merge_datasets, split_dataset

    ours(tmp_path / "set")
    loaded = LeRobotDataset("me/set", root=tmp_path / "set")
    parts = split_dataset(loaded, {"some": [0, 1], "rest": [2]}, tmp_path / "parts")
    assert [len(parts[name]) for name in ("some", "rest")] == [42, 20]
    whole = merge_datasets(list(parts.values()), "me/whole", tmp_path / "whole")
    assert whole[41]["action"].tolist() == [11.5, -1.0]
    left = delete_episodes(loaded, [0], tmp_path / "left", "me/left")
    assert left[0]["action"].tolist() == [0.5, -1.0]
    assert [str(problem) for problem in check(tmp_path / "left", workers=1) if problem.serious] == []


def test_act_trains_a_step_on_ours(tmp_path: Path) -> None:
    import torch
    from lerobot.configs.types import FeatureType
    from lerobot.datasets.utils import dataset_to_policy_features
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.policies.act.modeling_act import ACTPolicy
    from lerobot.policies.factory import make_pre_post_processors

    torch.manual_seed(0)
    torch.set_num_threads(1)
    ours(tmp_path / "set")
    deltas = {"action": [i / FPS for i in range(8)]}
    loaded = LeRobotDataset("me/set", root=tmp_path / "set", delta_timestamps=deltas)
    features = dataset_to_policy_features(loaded.meta.features)
    config = ACTConfig(
        input_features={k: f for k, f in features.items() if f.type is not FeatureType.ACTION},
        output_features={k: f for k, f in features.items() if f.type is FeatureType.ACTION},
        chunk_size=8,
        n_action_steps=8,
        dim_model=64,
        n_heads=4,
        dim_feedforward=128,
        n_encoder_layers=1,
        pretrained_backbone_weights=None,
        device="cpu",
    )
    assert set(config.input_features) == {"observation.state", TOP}
    policy = ACTPolicy(config)
    before, _ = make_pre_post_processors(config, dataset_stats=loaded.meta.stats)
    batch = before(next(iter(torch.utils.data.DataLoader(loaded, batch_size=4))))
    optimizer = torch.optim.Adam(policy.parameters(), 1e-4)
    losses = []
    for _ in range(3):
        loss, _ = policy.forward(batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert all(np.isfinite(losses))
    assert losses[-1] < losses[0]


FETCH = """
import json, sys

from lerobot.datasets.lerobot_dataset import LeRobotDataset

loaded = LeRobotDataset("me/set")
item = loaded[31]
print(json.dumps([len(loaded), loaded.num_episodes, str(loaded.root), item["task"], item["action"].tolist()]))
"""


def test_lerobot_fetches_ours_from_the_hub(tmp_path: Path) -> None:
    ours(tmp_path / "set")
    server = HubServer()
    home = {"HF_HOME": str(tmp_path / "home"), "HF_LEROBOT_HOME": str(tmp_path / "home/lerobot")}
    with serving(server):
        endpoint = {"HF_ENDPOINT": f"http://127.0.0.1:{server.port}", "HF_TOKEN": TOKEN}
        chosen = {**endpoint, **home, "HF_HUB_OFFLINE": "0", "HF_HUB_DISABLE_XET": "1"}

        def run(*words: str) -> str:
            done = subprocess.run(
                [sys.executable, *words], capture_output=True, text=True, timeout=120, env=os.environ | chosen
            )
            assert done.returncode == 0, done.stderr
            return done.stdout

        run("-m", "joshua", "dataset", "upload", str(tmp_path / "set"), "hf://datasets/me/set")
        found = json.loads(run("-c", FETCH).splitlines()[-1])
    assert found == [sum(LENGTHS), 3, str(tmp_path / "home/lerobot/me/set"), "stack", [1.5, -1.0]]
