"""A data set in the layout of LeRobot v3: what is in it, and that it is whole at any time."""

from __future__ import annotations

import contextlib
import hashlib
import json
import resource
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow.parquet as pq
import pytest
from joshua.features import Feature, FeatureSet, Frame
from joshua.features.episodes import DatasetLayout, EpisodeError
from joshua.plugins import EpisodeWriterSpec, load_registry
from joshua.plugins.targets import check_targets
from joshua_dataset import statistics
from joshua_dataset.lerobot_writer import LeRobotWriter

JOINTS = ("pan", "lift")
TOP = "observation.images.top"


def layout(folder: Path, width: int = 32) -> DatasetLayout:
    return DatasetLayout(
        folder=folder,
        robot_type="arm",
        fps=10,
        features=FeatureSet(
            [
                Feature.joints("observation.state", JOINTS),
                Feature.joints("action", JOINTS),
                Feature.picture(TOP, 24, width),
            ]
        ),
    )


def frame(number: int, stamp_ns: int = 0, changes: Mapping[str, Any] | None = None) -> Frame:
    picture = np.full((24, 32, 3), 20 * number, np.uint8)
    values: dict[str, Any] = {
        "observation.state": [number, -number],
        "action": [number + 0.5, 0.0],
        TOP: picture,
    }
    return Frame(stamp_ns, values | dict(changes or {}))


def digests(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def write(folder: Path, *, lengths: tuple[int, ...] = (3, 2)) -> LeRobotWriter:
    writer = LeRobotWriter(layout(folder))
    writer.open()
    for length in lengths:
        for number in range(length):
            writer.add_frame(frame(number, 1000 + number))
        writer.end_episode("wave" if length == 3 else "point")
    return writer


def test_the_plugin_provides_what_it_says() -> None:
    spec = load_registry().find(EpisodeWriterSpec, "data_store", "FORMAT_HUGGINGFACE")
    assert spec is not None
    assert check_targets(spec) == []


def test_tables_hold_the_frames(tmp_path: Path) -> None:
    write(tmp_path)
    tables = [pq.read_table(tmp_path / f"data/chunk-000/file-00{k}.parquet").to_pydict() for k in range(2)]
    first, second = tables
    assert first["observation.state"] == [[0, 0], [1, -1], [2, -2]]
    assert first["action"] == [[0.5, 0], [1.5, 0], [2.5, 0]]
    assert first["timestamp"] == pytest.approx([0.0, 0.1, 0.2])
    assert first["stamp_ns"] == [1000, 1001, 1002]
    assert (second["index"], second["frame_index"]) == ([3, 4], [0, 1])
    assert (second["episode_index"], second["task_index"]) == ([1, 1], [1, 1])


def test_metadata_describe_the_data_set(tmp_path: Path) -> None:
    write(tmp_path)
    info = json.loads((tmp_path / "meta/info.json").read_text())
    assert (info["codebase_version"], info["robot_type"], info["fps"]) == ("v3.0", "arm", 10)
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (2, 5, 2)
    assert info["features"]["action"] == {
        "dtype": "float32",
        "shape": [2],
        "names": ["pan", "lift"],
        "unit": "rad",
    }
    assert info["features"][TOP]["shape"] == [24, 32, 3]
    tasks = pq.read_table(tmp_path / "meta/tasks.parquet").to_pydict()
    assert tasks == {"task_index": [0, 1], "__index_level_0__": ["wave", "point"]}
    episodes = pq.read_table(tmp_path / "meta/episodes/chunk-000/file-000.parquet").to_pydict()
    assert episodes["length"] == [3, 2]
    assert (episodes["dataset_from_index"], episodes["dataset_to_index"]) == ([0, 3], [3, 5])
    assert episodes[f"videos/{TOP}/file_index"] == [0, 1]
    stats = json.loads((tmp_path / "meta/stats.json").read_text())
    assert stats["observation.state"]["max"] == [2.0, 0.0]
    assert stats["observation.state"]["mean"] == pytest.approx([0.8, -0.8])
    assert stats[TOP]["count"] == [2]  # one picture of each episode counts
    assert np.shape(stats[TOP]["mean"]) == (3, 1, 1)


def test_videos_hold_the_pictures(tmp_path: Path) -> None:
    write(tmp_path)
    with av.open(str(tmp_path / f"videos/{TOP}/chunk-000/file-000.mp4")) as video:
        stream = video.streams.video[0]
        pictures = [picture.to_ndarray(format="rgb24") for picture in video.decode(stream)]
        assert (stream.codec_context.name, stream.average_rate) == ("h264", 10)
    assert [float(picture.mean()) for picture in pictures] == pytest.approx([0, 20, 40], abs=2)


def test_same_frames_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write(tmp_path / name)
    assert len(digests(tmp_path / "a")) == 8
    assert digests(tmp_path / "a") == digests(tmp_path / "b")


def test_dropped_episode_leaves_nothing_behind(tmp_path: Path) -> None:
    writer = write(tmp_path, lengths=(2,))
    before = sorted(tmp_path.rglob("*"))
    writer.add_frame(frame(1))
    writer.close()
    writer.close()
    assert sorted(tmp_path.rglob("*")) == before
    writer.add_frame(frame(1))  # and the next one takes its place
    writer.end_episode("wave")
    info = json.loads((tmp_path / "meta/info.json").read_text())
    assert info["total_episodes"] == 2


def add_episode(writer: LeRobotWriter, task: str) -> None:
    for number in range(3):
        writer.add_frame(frame(number, 1000 + number))
    writer.end_episode(task)


@contextlib.contextmanager
def largest_file(size: int) -> Iterator[None]:
    """A disk that refuses what goes beyond a size, as a full one does."""
    former = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, former[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, former)


@pytest.mark.parametrize("size", [0, 300, 2000, 4000])
def test_full_disk_leaves_the_data_set_as_it_was(tmp_path: Path, size: int) -> None:
    writer = write(tmp_path, lengths=(2,))
    before = digests(tmp_path)
    with (
        largest_file(size),
        pytest.raises(EpisodeError, match=r"episode cannot be kept|takes no picture"),
    ):
        add_episode(writer, "point")
    with largest_file(size):
        writer.drop_episode()
    assert digests(tmp_path) == before
    add_episode(writer, "wave")  # there is room again
    writer.close()
    write(tmp_path / "other", lengths=(2, 3))
    (tmp_path / "other").rename(tmp_path.with_suffix(".other"))
    assert digests(tmp_path) == digests(tmp_path.with_suffix(".other"))


def test_folder_belongs_to_one_writer_and_goes_with_its_last_episode(tmp_path: Path) -> None:
    first = LeRobotWriter(layout(tmp_path / "set"))
    first.open()
    with pytest.raises(EpisodeError, match="is not empty, and data sets are never overwritten"):
        LeRobotWriter(layout(tmp_path / "set")).open()
    first.add_frame(frame(1))
    first.close()
    assert not (tmp_path / "set").exists()


def test_statistics_of_parts_are_those_of_the_whole() -> None:
    rows = np.random.default_rng(0).normal(size=(50, 3))
    whole = statistics.of_rows(rows)
    together = statistics.merged([statistics.of_rows(rows[:20]), statistics.of_rows(rows[20:])])
    for name in ("min", "max", "mean", "std", "count"):
        assert together[name] == pytest.approx(whole[name])
    assert together["q50"] == pytest.approx(whole["q50"], abs=0.3)


def test_what_cannot_be_kept_is_refused(tmp_path: Path) -> None:
    writer = write(tmp_path / "set")
    with pytest.raises(EpisodeError, match="is not empty, and data sets are never overwritten: name another"):
        LeRobotWriter(layout(tmp_path / "set")).open()
    with pytest.raises(EpisodeError, match="31 x 24: a video needs an even width and height"):
        LeRobotWriter(layout(tmp_path / "odd", width=31)).open()
    scans = FeatureSet([Feature("observation.scan", "float32", (0,))])
    with pytest.raises(EpisodeError, match=r"scan has the shape \(0,\), which no column can have"):
        LeRobotWriter(DatasetLayout(tmp_path / "scan", "arm", 10, scans)).open()
    with pytest.raises(EpisodeError, match=r"a frame lacks action, observation\.images\.top"):
        writer.add_frame(Frame(0, {"observation.state": np.zeros(2)}))
    with pytest.raises(EpisodeError, match="an episode without a frame cannot be kept"):
        writer.end_episode("wave")
    with pytest.raises(EpisodeError, match=r"shape \(3,\), and \(2,\) is kept \(pan, lift\)"):
        writer.add_frame(frame(1, changes={"action": [1, 2, 3]}))
    with pytest.raises(EpisodeError, match=r"top has the shape \(8, 8, 3\), and \(24, 32, 3\) is kept"):
        writer.add_frame(frame(1, changes={TOP: np.zeros((8, 8, 3), np.uint8)}))
    with pytest.raises(EpisodeError, match="has values of float64, and a picture is of uint8"):
        writer.add_frame(frame(1, changes={TOP: np.zeros((24, 32, 3))}))
    (tmp_path / "file").write_text("")
    with pytest.raises(EpisodeError, match="cannot be made: Not a directory; name another local_path"):
        LeRobotWriter(layout(tmp_path / "file" / "set")).open()
