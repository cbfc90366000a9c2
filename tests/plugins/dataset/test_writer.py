"""A data set in the layout of LeRobot v3: what is in it, and that it is whole at any time."""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import hashlib
import json
import resource
import tracemalloc
from collections.abc import Iterator
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
from joshua_dataset.lock import PRIVATE
from joshua_dataset.reader import Dataset
from joshua_dataset.writer import CsvWriter, DatasetWriter, JsonlWriter, LeRobotWriter, ParquetWriter
from small_dataset import TOP, add_episode, frame, layout, write, writing


def digests(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and PRIVATE not in path.parts
    }


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
    episodes = pq.read_table(tmp_path / "meta/episodes/chunk-000").to_pydict()
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


def test_a_long_episode_keeps_no_rows_in_memory(tmp_path: Path) -> None:
    state = Feature.joints("observation.state", ("pan", "lift"))
    with contextlib.closing(LeRobotWriter(numbers_only(tmp_path, state))) as writer:
        writer.open()

        def add(count: int) -> None:
            for k in range(count):
                writer.add_frame(Frame(k, {state.key: np.array([k, -k])}))

        tracemalloc.start()
        try:
            add(100)
            before, _ = tracemalloc.get_traced_memory()
            add(1000)
            after, _ = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert after - before < 20_000  # a row of the table has 24 bytes
        writer.end_episode("wait")
    assert Dataset.read(tmp_path).frames == 1100


def numbers_only(folder: Path, *features: Feature) -> DatasetLayout:
    return dataclasses.replace(layout(folder), features=FeatureSet(features))


def test_same_frames_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write(tmp_path / name)
    assert len(digests(tmp_path / "a")) == 9
    assert digests(tmp_path / "a") == digests(tmp_path / "b")


def test_dropped_episode_leaves_nothing_behind(tmp_path: Path) -> None:
    write(tmp_path / "one", lengths=(2,))
    before = sorted((tmp_path / "one").rglob("*"))
    with contextlib.closing(LeRobotWriter(layout(tmp_path / "one", resume=True))) as writer:
        writer.open()
        writer.add_frame(frame(1))
        writer.close()
        writer.close()
        assert sorted((tmp_path / "one").rglob("*")) == before
        writer.open()
        writer.add_frame(frame(1))  # and the next one takes its place
        writer.end_episode("wave")
    assert Dataset.read(tmp_path / "one").episodes == 2


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
    here, there = tmp_path / "here", tmp_path / "there"
    with writing(here, lengths=(2,)) as writer:
        before = digests(here)
        with largest_file(size), pytest.raises(EpisodeError, match=r"episode cannot be kept|takes no frame"):
            add_episode(writer, "point")
        with largest_file(size):
            writer.drop_episode()
        assert digests(here) == before
        add_episode(writer, "wave")  # there is room again
    write(there, lengths=(2, 3))
    assert digests(here) == digests(there)


def test_folder_belongs_to_one_writer_and_goes_with_its_last_episode(tmp_path: Path) -> None:
    with writing(tmp_path / "set", lengths=()) as first:
        with pytest.raises(EpisodeError, match=r"is being written by process \d+ on .* since .*\. Stop that"):
            LeRobotWriter(layout(tmp_path / "set")).open()
        first.add_frame(frame(1))
    assert not (tmp_path / "set").exists()


def test_what_open_would_refuse_is_found_without_writing(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    LeRobotWriter(layout(folder)).check()
    assert not folder.exists()
    write(folder)
    before = digests(folder)
    with pytest.raises(EpisodeError, match="is not empty, and data sets are never overwritten"):
        LeRobotWriter(layout(folder)).check()
    LeRobotWriter(layout(folder, resume=True)).check()
    with pytest.raises(EpisodeError, match=r"cannot be appended to, because it differs: .*shape"):
        LeRobotWriter(layout(folder, 64, resume=True)).check()
    LeRobotWriter(layout(folder, 0, resume=True)).check()  # a camera that has not shown its size yet
    with contextlib.closing(LeRobotWriter(layout(folder, resume=True))) as writer:
        writer.open()
        with pytest.raises(EpisodeError, match=r"is being written by process \d+"):
            LeRobotWriter(layout(folder, resume=True)).check()
    assert digests(folder) == before
    (tmp_path / "file").write_text("")
    with pytest.raises(EpisodeError, match=r"cannot be written: .*file is not a folder\. Name another"):
        LeRobotWriter(layout(tmp_path / "file" / "set")).check()
    with pytest.raises(EpisodeError, match=r"cannot be written: .* is not writable|Read-only|No such"):
        LeRobotWriter(layout(Path("/proc/sys/set"))).check()


def test_lock_of_a_killed_owner_is_free(tmp_path: Path) -> None:
    (tmp_path / "set" / PRIVATE).mkdir(parents=True)
    (tmp_path / "set" / PRIVATE / "lock").write_text('{"process": 1, "host": "here", "since": "then"}')
    write(tmp_path / "set")
    assert Dataset.read(tmp_path / "set").episodes == 2


def test_appended_episodes_are_those_of_one_writer(tmp_path: Path) -> None:
    write(tmp_path / "whole", lengths=(3, 2, 3))
    write(tmp_path / "parts", lengths=(3,))
    for length in (2, 3):
        with contextlib.closing(LeRobotWriter(layout(tmp_path / "parts", resume=True))) as writer:
            writer.open()
            add_episode(writer, "wave" if length == 3 else "point", length)
    assert digests(tmp_path / "parts") == digests(tmp_path / "whole")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fps": 20}, "fps is 20 here and 10 there"),
        ({"robot_type": "leg"}, "robot_type is leg here and arm there"),
        ({"identity": {"calibration": "b"}}, "calibration is b here and a there"),
        (
            {"features": FeatureSet([Feature.joints("action", ("pan",), unit="deg")])},
            r"observation\.state is there and not here; .*action: shape .*unit deg here and rad there",
        ),
    ],
)
def test_a_data_set_that_differs_is_not_appended_to(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    first = layout(tmp_path, identity={"calibration": "a"})
    with contextlib.closing(LeRobotWriter(first)) as writer:
        writer.open()
        add_episode(writer, "wave")
    before = digests(tmp_path)
    with pytest.raises(EpisodeError, match=rf"cannot be appended to, because it differs: .*{message}"):
        LeRobotWriter(dataclasses.replace(first, resume=True, **changes)).open()
    assert digests(tmp_path) == before


@pytest.mark.parametrize("kind", [LeRobotWriter, ParquetWriter, CsvWriter, JsonlWriter])
@pytest.mark.parametrize("pictures", ["video", "png", "jpeg"])
def test_every_format_reads_back(tmp_path: Path, kind: type[DatasetWriter], pictures: str) -> None:
    if kind is LeRobotWriter and pictures != "video":
        with pytest.raises(EpisodeError, match="LeRobot's layout keeps pictures as videos"):
            kind(layout(tmp_path, pictures=pictures)).open()
        return
    with contextlib.closing(kind(layout(tmp_path, pictures=pictures, counters=("dropped",)))) as writer:
        writer.open()
        for number in range(3):
            writer.add_frame(frame(number, 1000 + number))
        writer.end_episode("wave", {"dropped": 4})
    found = Dataset.read(tmp_path)
    (episode,) = found.episode_list()
    columns = found.columns(episode)
    assert columns["observation.state"].tolist() == [[0, 0], [1, -1], [2, -2]]
    assert columns["action"].tolist() == [[0.5, 0], [1.5, 0], [2.5, 0]]
    assert columns["stamp_ns"].tolist() == [1000, 1001, 1002]
    assert (episode.tasks, episode.counts) == (("wave",), {"dropped": 4})
    means = [float(picture.mean()) for picture in found.decoded(episode, TOP)]
    assert means == pytest.approx([0, 20, 40], abs=0.1 if pictures == "png" else 2)


def test_tables_are_read_in_one_line(tmp_path: Path) -> None:
    for kind, name in ((CsvWriter, "csv"), (JsonlWriter, "jsonl")):
        with contextlib.closing(kind(layout(tmp_path / name))) as writer:
            writer.open()
            add_episode(writer, "wave")
    with (tmp_path / "csv/data/chunk-000/file-000.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["action.pan"] for row in rows] == ["0.5", "1.5", "2.5"]
    lines = (tmp_path / "jsonl/data/chunk-000/file-000.jsonl").read_text().splitlines()
    assert [json.loads(line)["action"] for line in lines] == [[0.5, 0.0], [1.5, 0.0], [2.5, 0.0]]
    schema = json.loads((tmp_path / "csv/schema.json").read_text())
    assert schema["columns"]["action.pan"] == {"dtype": "float32", "unit": "rad"}
    assert schema["pictures"][TOP]["path"].startswith(f"videos/{TOP}/")


@pytest.mark.parametrize("codec", ["hevc", "av1"])
def test_other_codecs(tmp_path: Path, codec: str) -> None:
    with contextlib.closing(LeRobotWriter(layout_64(tmp_path, codec))) as writer:
        writer.open()
        for number in range(4):
            writer.add_frame(Frame(number, {TOP: np.full((64, 64, 3), 40 * number, np.uint8)}))
        writer.end_episode("wave")
    found = Dataset.read(tmp_path)
    (episode,) = found.episode_list()
    with av.open(str(episode.pictures[TOP].path)) as video:
        assert video.streams.video[0].codec_context.codec.canonical_name == codec == found.codec
    means = [float(picture.mean()) for picture in found.decoded(episode, TOP)]
    assert means == pytest.approx([0, 40, 80, 120], abs=3)


def layout_64(folder: Path, codec: str) -> DatasetLayout:
    return DatasetLayout(folder, "arm", 10, FeatureSet([Feature.picture(TOP, 64, 64)]), codec=codec)


def test_statistics_of_pictures_are_exact(tmp_path: Path) -> None:
    pictures = np.random.default_rng(1).integers(0, 256, (5, 16, 16, 3), dtype=np.uint8)
    found = statistics.PictureStatistics()
    for picture in pictures:
        found.add(picture)
    pixels = pictures[:, ::4, ::4].reshape(-1, 3) / 255.0
    expected = statistics.of_rows(pixels)
    for name, values in found.result().items():
        if name != "count":
            assert values.reshape(-1) == pytest.approx(expected[name])


def test_statistics_of_parts_are_those_of_the_whole() -> None:
    rows = np.random.default_rng(0).normal(size=(50, 3))
    whole = statistics.of_rows(rows)
    together = statistics.merged([statistics.of_rows(rows[:20]), statistics.of_rows(rows[20:])])
    for name in ("min", "max", "mean", "std", "count"):
        assert together[name] == pytest.approx(whole[name])
    assert together["q50"] == pytest.approx(whole["q50"], abs=0.3)


def test_what_cannot_be_kept_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "set")
    with pytest.raises(EpisodeError, match=r"is not empty, .* never overwritten\. Name another local_path"):
        LeRobotWriter(layout(tmp_path / "set")).open()
    with pytest.raises(EpisodeError, match="31 x 24: a video needs an even width and height"):
        LeRobotWriter(layout(tmp_path / "odd", width=31)).open()
    scans = FeatureSet([Feature("observation.scan", "float32", (0,))])
    with pytest.raises(EpisodeError, match=r"scan has the shape \(0,\), which no column can hold"):
        LeRobotWriter(DatasetLayout(tmp_path / "scan", "arm", 10, scans)).open()
    with writing(tmp_path / "other") as writer:
        with pytest.raises(EpisodeError, match=r"a frame lacks action, observation\.images\.top"):
            writer.add_frame(Frame(0, {"observation.state": np.zeros(2)}))
        with pytest.raises(EpisodeError, match="an episode without a frame cannot be kept"):
            writer.end_episode("wave")
        with pytest.raises(EpisodeError, match=r"shape \(3,\), and \(2,\) is kept \(pan, lift\)"):
            writer.add_frame(frame(1, changes={"action": [1, 2, 3]}))
        with pytest.raises(EpisodeError, match=r"top has the shape \(8, 8, 3\), and \(24, 32, 3\) is kept"):
            writer.add_frame(frame(1, changes={TOP: np.zeros((8, 8, 3), np.uint8)}))
        with pytest.raises(EpisodeError, match="has values of float64, but pictures are uint8"):
            writer.add_frame(frame(1, changes={TOP: np.zeros((24, 32, 3))}))
    (tmp_path / "file").write_text("")
    with pytest.raises(EpisodeError, match=r"cannot be written: Not a directory\. Name another"):
        LeRobotWriter(layout(tmp_path / "file" / "set")).open()
