"""Checks find what is wrong, and data sets made of others hold the same episodes."""

from __future__ import annotations

import contextlib
import hashlib
import json
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from joshua.features import DatasetLayout, EpisodeError, Feature, FeatureSet, Frame
from joshua_dataset import statistics
from joshua_dataset.checking import check
from joshua_dataset.commands import dataset as command
from joshua_dataset.commands import options
from joshua_dataset.metadata import INFO, STATS
from joshua_dataset.reader import Dataset, DatasetError
from joshua_dataset.recomputing import recomputed
from joshua_dataset.transform import Source, build, delete
from joshua_dataset.writer import LeRobotWriter
from small_dataset import TOP, as_v21, write

FPS = 20
JOINTS = ("pan", "lift")


def swing(
    folder: Path, *, follows: bool = True, edit: Callable[[int, dict[str, Any]], None] | None = None
) -> None:
    """One episode of 60 frames in which two joints swing, and a picture that changes."""
    features = FeatureSet(
        [
            Feature.joints("observation.state", JOINTS),
            Feature.joints("action", JOINTS),
            Feature.picture(TOP, 32, 32),
        ]
    )
    with contextlib.closing(LeRobotWriter(DatasetLayout(folder, "arm", FPS, features))) as writer:
        writer.open()
        for number in range(60):
            goal = [0.4 * np.sin(number / 8), 0.3 * np.cos(number / 8)]
            values: dict[str, Any] = {
                "observation.state": goal if follows else [0.0, 0.0],
                "action": goal,
                TOP: np.full((32, 32, 3), 4 * number, np.uint8),
            }
            if edit is not None:
                edit(number, values)
            writer.add_frame(Frame(1_000_000_000 + number * 50_000_000, values))
        writer.end_episode("swing")


def problems(folder: Path) -> list[str]:
    return [str(problem) for problem in check(folder, workers=1)]


def rewrite(path: Path, change: Callable[[Any], Any]) -> None:
    path.write_text(json.dumps(change(json.loads(path.read_text()))))


def table_path(folder: Path) -> Path:
    return folder / "data/chunk-000/file-000.parquet"


def change_column(folder: Path, name: str, change: Callable[[Any], Any]) -> None:
    table = pq.read_table(table_path(folder))
    at = table.column_names.index(name)
    values = change(table.column(name).to_numpy().copy())
    pq.write_table(
        table.set_column(at, name, pa.array(values, table.schema.field(name).type)), table_path(folder)
    )


def test_a_good_data_set_has_no_problem(tmp_path: Path) -> None:
    swing(tmp_path)
    assert problems(tmp_path) == []


def frozen(number: int, values: dict[str, Any]) -> None:
    if 20 <= number < 40:
        values[TOP] = np.full((32, 32, 3), 80, np.uint8)


def jump(number: int, values: dict[str, Any]) -> None:
    if number == 30:
        values["observation.state"] = [3.0, 0.0]


def slow_camera(number: int, values: dict[str, Any]) -> None:
    values[TOP] = np.full((32, 32, 3), 4 * (number // 2 * 2), np.uint8)


@pytest.mark.parametrize(
    ("edit", "expected"),
    [
        (slow_camera, f"warning: episode 0: {TOP}: 30 of 60 pictures repeat the previous one"),
        (frozen, f"warning: episode 0: {TOP}: frozen for 0.9 s from 1.0 s on"),
        (jump, "warning: episode 0: observation.state: pan jumps by 3.27 rad between two frames"),
    ],
)
def test_what_was_recorded_wrong_is_found(tmp_path: Path, edit: Any, expected: str) -> None:
    swing(tmp_path, edit=edit)
    assert expected in problems(tmp_path)


def test_an_action_that_no_state_follows_is_found(tmp_path: Path) -> None:
    swing(tmp_path, follows=False)
    found = problems(tmp_path)
    assert "error: episode 0: action: pan moves by 0.80 rad, but observation.state by 0.00" in found


@pytest.mark.parametrize(
    ("column", "change", "expected"),
    [
        ("frame_index", lambda values: values + 1, "frame_index does not count from 0 without gaps"),
        ("timestamp", lambda values: values * 2, "timestamp is up to 2.950 s away from frame_index / fps"),
        ("stamp_ns", lambda values: values[::-1], "stamp_ns does not increase"),
        (
            "stamp_ns",
            lambda values: np.where(values > 2e9, values + 10**9, values),
            "1 gaps in the recording, the longest 1.05 s",
        ),
    ],
)
def test_damaged_columns_are_found(tmp_path: Path, column: str, change: Any, expected: str) -> None:
    swing(tmp_path)
    change_column(tmp_path, column, change)
    assert any(expected in problem for problem in problems(tmp_path))


def test_metadata_that_disagree_are_found(tmp_path: Path) -> None:
    swing(tmp_path)
    rewrite(tmp_path / INFO, lambda info: info | {"total_frames": 61})
    assert any(
        text.startswith("error: meta/info.json counts 61 frames, and the episodes have 60")
        for text in problems(tmp_path)
    )
    rewrite(tmp_path / STATS, lambda stats: stats | {"action": stats["action"] | {"max": [9.0, 9.0]}})
    (found,) = [problem for problem in problems(tmp_path) if "stats.json" in problem]
    assert found.startswith("error: the max of action in meta/stats.json is [9, 9], and the data have [0.399")
    assert f"Run `joshua dataset stats --write {tmp_path}`" in found
    rewrite(tmp_path / STATS, lambda stats: stats | {"action": stats["action"] | {"mean": [0.9, 0.0]}})
    assert any("the max of action in" in text and "wrong, too: mean" in text for text in problems(tmp_path))
    bytes_mean = {"mean": [[[118.0]]] * 3}  # of pictures from 0 to 255
    rewrite(tmp_path / STATS, lambda stats: stats | {TOP: stats[TOP] | bytes_mean})
    assert any(
        f"the mean of {TOP} in meta/stats.json is [118, 118, 118]" in text for text in problems(tmp_path)
    )


def test_joints_beyond_their_calibrated_range_are_found(tmp_path: Path) -> None:
    swing(tmp_path)
    identity = {"calibration of observation.state": "pan:-0.3000:0.5000 lift:-0.3000:0.3000"}
    rewrite(tmp_path / INFO, lambda info: info | {"joshua": info["joshua"] | {"identity": identity}})
    (found,) = problems(tmp_path)
    assert found == (
        "warning: episode 0: observation.state: pan moves from -0.40 to 0.40 rad, outside its calibrated "
        "range of -0.30 to 0.50"
    )


def test_a_camera_slower_than_the_frames_is_found(tmp_path: Path) -> None:
    described = Feature("acquisition_ns", "int64", (1,), (TOP,), "ns")
    features = FeatureSet([Feature.picture(TOP, 32, 32), described])
    with contextlib.closing(LeRobotWriter(DatasetLayout(tmp_path, "arm", FPS, features))) as writer:
        writer.open()
        for number in range(40):  # the same picture of a scene at rest is no repetition
            at_ns = 1_000_000_000 + 50_000_000 * number
            acquired_ns = at_ns if number < 30 else at_ns // 100_000_000 * 100_000_000
            values: dict[str, Any] = {TOP: np.full((32, 32, 3), number // 4, np.uint8)}
            values["acquisition_ns"] = [acquired_ns]
            writer.add_frame(Frame(at_ns, values))
        writer.end_episode("rest")
    assert problems(tmp_path) == [f"warning: episode 0: {TOP}: 5 of 40 pictures repeat the previous one"]


def test_missing_and_torn_videos_are_found(tmp_path: Path) -> None:
    swing(tmp_path)
    video = tmp_path / f"videos/{TOP}/chunk-000/file-000.mp4"
    video.write_bytes(video.read_bytes()[:500])
    name = video.relative_to(tmp_path)
    assert any(f"error: episode 0: {name} cannot be read" in problem for problem in problems(tmp_path))
    video.unlink()
    assert any(f"error: episode 0: {name} is missing" in problem for problem in problems(tmp_path))


def test_statistics_are_computed_from_the_data(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path)
    stored = Dataset.read(tmp_path).statistics()
    found = recomputed(tmp_path, workers=1)
    for key, values in found.items():
        for name in ("min", "max", "mean", "std"):
            assert values[name] == pytest.approx(stored[key][name], abs=0.03), (key, name)
    rewrite(tmp_path / STATS, lambda stats: stats | {"action": stats["action"] | {"max": [9.0, 9.0]}})
    arguments = ["stats", str(tmp_path), "--write", "--workers", "1"]
    assert run(*arguments) == 0
    assert f"the statistics of 2 episodes are replaced: {tmp_path / STATS}\n" in capsys.readouterr().out
    assert problems(tmp_path) == []


def run(*words: str) -> int:
    import argparse

    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return int(command.run(parser.parse_args(words)))


def digests(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


def values_of(folder: Path) -> list[Any]:
    found = Dataset.read(folder)
    return [
        (episode.tasks, {key: found.columns(episode)[key].tolist() for key in found.features if key != TOP})
        for episode in found.episode_list()
    ]


def test_merge_and_split_keep_every_value(tmp_path: Path) -> None:
    write(tmp_path / "a", lengths=(3, 2))
    write(tmp_path / "b", lengths=(4,))
    assert build([Source(tmp_path / "a"), Source(tmp_path / "b")], tmp_path / "both", workers=1) == 3
    assert values_of(tmp_path / "both") == values_of(tmp_path / "a") + values_of(tmp_path / "b")
    assert problems(tmp_path / "both") == problems(tmp_path / "a")
    build([Source(tmp_path / "both", (2,))], tmp_path / "last", workers=1)
    assert values_of(tmp_path / "last") == values_of(tmp_path / "b")
    write(tmp_path / "whole", lengths=(3, 2))  # a copy is byte for byte what the recorder would have written
    build([Source(tmp_path / "whole")], tmp_path / "copy", workers=1)
    assert digests(tmp_path / "copy") == digests(tmp_path / "whole")


def test_the_number_of_workers_changes_no_byte(tmp_path: Path) -> None:
    write(tmp_path / "a", lengths=(3, 2, 4, 2))
    for workers in (1, 2):
        build([Source(tmp_path / "a")], tmp_path / str(workers), codec="hevc", workers=workers)
    assert digests(tmp_path / "1") == digests(tmp_path / "2")


@pytest.mark.parametrize("pictures", ["video", "png"])
@pytest.mark.parametrize("kind", ["csv", "jsonl", "parquet"])
def test_conversion_there_and_back(tmp_path: Path, kind: str, pictures: str) -> None:
    write(tmp_path / "a")
    build([Source(tmp_path / "a")], tmp_path / "there", table_format=kind, pictures=pictures, workers=1)
    build([Source(tmp_path / "there")], tmp_path / "back", workers=1)
    assert values_of(tmp_path / "back") == values_of(tmp_path / "a")
    (first, _) = Dataset.read(tmp_path / "back").episode_list()
    means = [float(p.mean()) for p in Dataset.read(tmp_path / "back").decoded(first, TOP)]
    assert means == pytest.approx([0, 20, 40], abs=3)


def test_delete_counts_the_others_anew(tmp_path: Path) -> None:
    write(tmp_path / "a", lengths=(3, 2, 4))
    before = values_of(tmp_path / "a")
    with pytest.raises(EpisodeError, match="has no episode 3; allowed: 0 to 2"):
        delete(tmp_path / "a", [3], workers=1)
    assert delete(tmp_path / "a", [0], workers=1) == 2
    assert values_of(tmp_path / "a") == before[1:]
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_data_sets_that_do_not_match_are_not_merged(tmp_path: Path) -> None:
    write(tmp_path / "a")
    swing(tmp_path / "b")
    with pytest.raises(EpisodeError, match=r"cannot be merged: .*top: shape .*fps is 10 in .* and 20 in"):
        build([Source(tmp_path / "a"), Source(tmp_path / "b")], tmp_path / "both", workers=1)
    assert not (tmp_path / "both").exists()
    with pytest.raises(EpisodeError, match="is not empty"):
        build([Source(tmp_path / "a")], tmp_path / "b", workers=1)


def test_v21_is_read_and_converted(tmp_path: Path) -> None:
    write(tmp_path / "a")
    before = values_of(tmp_path / "a")
    as_v21(tmp_path / "a")
    assert Dataset.read(tmp_path / "a").version == "v2.1"
    assert values_of(tmp_path / "a") == before
    (tmp_path / "a" / STATS).unlink()  # this layout keeps statistics by episode
    assert problems(tmp_path / "a") == []
    build([Source(tmp_path / "a")], tmp_path / "new", workers=1)
    assert Dataset.read(tmp_path / "new").version == "v3.0"
    assert values_of(tmp_path / "new") == before
    assert problems(tmp_path / "new") == []


def test_a_path_out_of_the_data_set_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "a")
    rewrite(tmp_path / "a" / INFO, lambda info: info | {"data_path": "../../{chunk_index}{file_index}"})
    with pytest.raises(DatasetError, match=r"is outside .*: it contains \.\."):
        list(Dataset.read(tmp_path / "a").episode_list())


def test_a_picture_of_another_size_is_not_decoded(tmp_path: Path) -> None:
    write(tmp_path / "a")
    rewrite(
        tmp_path / "a" / INFO,
        lambda info: (
            info | {"features": info["features"] | {TOP: info["features"][TOP] | {"shape": [8, 8, 3]}}}
        ),
    )
    found = Dataset.read(tmp_path / "a")
    with pytest.raises(DatasetError, match="has pictures of 32 x 24, and 8 x 8 is described"):
        list(found.decoded(next(found.episode_list()), TOP))


@pytest.mark.parametrize("seed", range(40))
def test_malformed_files_give_an_error_and_nothing_else(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    write(tmp_path / "a")
    files = sorted(path for path in (tmp_path / "a").rglob("*") if path.is_file())
    path = chance.choice(files)
    data = bytearray(path.read_bytes())
    for _ in range(chance.randrange(1, 30)):
        data[chance.randrange(len(data))] = chance.randrange(256)
    path.write_bytes(bytes(data[: chance.randrange(len(data) // 2, len(data) + 1)]))
    with contextlib.suppress(DatasetError):
        found = Dataset.read(tmp_path / "a")
        found.statistics()
        for episode in found.episode_list():
            found.columns(episode)
            for key in (feature.key for feature in found.features.pictures):
                list(found.decoded(episode, key))
    with contextlib.suppress(DatasetError):
        list(check(tmp_path / "a", workers=1))


@pytest.mark.parametrize(("text", "expected"), [("3", (3,)), ("0-2,5", (0, 1, 2, 5))])
def test_lists_of_episodes(text: str, expected: tuple[int, ...]) -> None:
    assert options.numbers(text) == expected


def test_statistics_without_quantiles_are_merged() -> None:
    parts = [
        {"min": np.zeros(1), "max": np.ones(1), "mean": np.ones(1), "std": np.zeros(1), "count": np.ones(1)}
    ] * 2
    assert set(statistics.merged(parts)) == {"min", "max", "mean", "std", "count"}


def test_the_page_needs_nothing_else(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "a<b", lengths=(3, 2))
    page = tmp_path / "page.html"
    arguments = ["view", str(tmp_path / "a<b"), "--no-open", "--output", str(page), "--episodes", "1"]
    assert run(*arguments) == 0
    assert capsys.readouterr().out == f"{page}: episodes 1\n"
    text = page.read_text()
    assert "<h1>a&lt;b</h1>" in text
    assert text.count("<section data-episode=") == 1
    assert text.count("<tr>") == 3
    assert "data:video/mp4;base64," in text
    assert not re.findall(r"(?:src|href)=.https?:", text)
    curves = json.loads(text.partition("<script type=application/json>")[2].partition("</script>")[0])
    assert curves[1]["values"] == [[0.5, 0.0], [1.5, 0.0]]
    assert (
        run("view", str(tmp_path / "a<b"), "--no-open", "--output", str(tmp_path / "no" / "page.html")) == 1
    )
    assert "page.html cannot be written: No such file or directory" in capsys.readouterr().err
