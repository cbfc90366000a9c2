"""A repair mends what can be mended with nothing invented, and calls only what is complete complete."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import damaged_sets
import lerobot_sets
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from damaged_sets import CASES
from data_operations import killed, recording
from eventually import eventually
from joshua.features import EpisodeError
from joshua_dataset import mp4
from joshua_dataset.checking import check
from joshua_dataset.commands import dataset as command
from joshua_dataset.lock import PRIVATE
from joshua_dataset.mending import footage
from joshua_dataset.open_episode import open_folder
from joshua_dataset.reader import Dataset
from joshua_dataset.recomputing import recompute
from joshua_dataset.repair import Report, repair
from joshua_dataset.writer import CsvWriter, DatasetWriter, JsonlWriter, LeRobotWriter, ParquetWriter
from lerobot_sets import FPS, LENGTHS, V21, V30
from small_dataset import TOP, add_episode, frame, layout

FRAMES = sum(LENGTHS)

#: Frames that are left where not all of them can be; None where nothing can be mended. Where the layouts
#: differ, that of v3.0 and that of v2.1.
LEFT: dict[str, Any] = {
    "rows torn": (None, FRAMES - 5),
    "rows empty": (None, FRAMES - 5),
    "rows missing": (None, FRAMES - 5),
    "rows lost at the end": FRAMES - 2,
    "rows lost in the middle": FRAMES - 3,
    "rows lost at the begin": FRAMES - 5,
    "rows repeated": FRAMES - 2,
    "rows exchanged": FRAMES - 4,
    "state not a number": FRAMES - 3,
    "action infinite": FRAMES - 2,
    "state not a number at first": FRAMES - 5,
    "state dropped": (None, FRAMES - 5),
    "feature without a column": None,
    "info torn": None,
    "video torn": (11, FRAMES - 4),
    "video empty": (None, FRAMES - 5),
    "video missing": (None, FRAMES - 5),
    "video short": FRAMES - 3,
    "video of another size": (FRAMES, FRAMES - 5),
}


def left(version: str, name: str) -> int | None:
    value = LEFT.get(name, FRAMES)
    if isinstance(value, tuple):
        value = value[0] if version == V30 else value[1]
    return None if value is None else int(value)


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("originals")
    for version in (V30, V21):
        lerobot_sets.make(folder / version, version)
    return {version: folder / version for version in (V30, V21)}


def digests(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


Frame = tuple[Any, ...]


def content(folder: Path) -> list[list[Frame]]:
    """Return the values, the task and the mean colour of the picture of each frame, by episode."""
    found = Dataset.read(folder)
    first = 0
    result = []
    for number, episode in enumerate(found.episode_list()):
        columns = found.columns(episode)
        frames = np.arange(episode.length)
        assert columns["index"].tolist() == (first + frames).tolist()
        assert columns["frame_index"].tolist() == frames.tolist()
        assert set(columns["episode_index"].tolist()) == {number} == {episode.index}
        assert columns["timestamp"] == pytest.approx(frames / found.fps, abs=1e-4)
        first += episode.length
        texts = [found.tasks[index] for index in columns["task_index"]]
        assert set(texts) == set(episode.tasks)
        means = [round(float(picture.mean()), 2) for picture in found.decoded(episode, TOP)]
        values = np.concatenate([columns["observation.state"], columns["action"]], axis=1).tolist()
        assert len(means) == episode.length
        result.append([(*row, text, mean) for row, text, mean in zip(values, texts, means, strict=True)])
    assert found.frames == first
    return result


@pytest.mark.parametrize(("version", "name"), CASES)
def test_no_damage_is_called_complete(
    originals: dict[str, Path], tmp_path: Path, version: str, name: str
) -> None:
    folder = damaged_sets.damaged(originals[version], tmp_path / "set", version, name)
    before = digests(folder)
    expected = left(version, name)
    if expected is None:
        with pytest.raises(EpisodeError, match=r"Nothing was changed|nothing was changed") as caught:
            repair(folder)
        assert "is complete" not in str(caught.value)
        assert {name: found for name, found in digests(folder).items() if PRIVATE not in name} == before
        return
    report = repair(folder)
    assert report.is_complete, report
    problems = list(check(folder, workers=1))
    assert not [str(problem) for problem in problems if problem.serious or problem.remedy is not None]
    assert str(report).startswith("check found "), report
    _is_prefix(originals[version], folder, expected, colours="video" not in name)
    kept = set(digests(folder).values())
    assert set(before.values()) <= kept, "a file of the damaged data set is lost"
    again = digests(folder)
    assert len(repair(folder).lines) == 1
    assert digests(folder) == again


def _is_prefix(original: Path, folder: Path, frames: int, *, colours: bool) -> None:
    """Assert that each episode begins as one of the original, in order, and that nothing else is there."""
    end = None if colours else -1
    waiting = [[row[:end] for row in episode] for episode in content(original)]
    total = 0
    for episode in content(folder):
        rows = [row[:end] for row in episode]
        while waiting[0][: len(rows)] != rows:
            waiting.pop(0)
            assert waiting, "an episode that was never recorded"
        waiting.pop(0)
        total += len(rows)
    assert total == frames


@pytest.mark.parametrize("version", [V30, V21])
def test_a_data_set_without_damage_stays_byte_for_byte(
    originals: dict[str, Path], tmp_path: Path, version: str
) -> None:
    before = digests(originals[version])
    videos = "1 video" if version == V30 else "4 videos"
    report = repair(originals[version])
    assert report.lines == (
        f"{originals[version]} is complete: 4 episodes. `joshua dataset check` finds nothing serious: "
        f"4 episodes, 22 rows, the headers of {videos} and 22 pictures were read",
    )
    assert digests(originals[version]) == before


def test_files_that_are_whole_stay_where_they_are(originals: dict[str, Path], tmp_path: Path) -> None:
    folder = damaged_sets.damaged(originals[V21], tmp_path / "set", V21, "state not a number")
    before = digests(folder)
    said = str(repair(folder))
    after = digests(folder)
    changed = {name for name, found in before.items() if after.get(name) != found}
    assert not {name for name in changed if name.startswith("videos/")} - {lerobot_sets.video_path(V21)}
    assert lerobot_sets.rows_path(V21, 0) not in changed  # the others count on from fewer rows
    assert lerobot_sets.rows_path(V21) in changed
    (aside,) = (folder / PRIVATE / "aside").iterdir()
    assert f"the files as they were are in {aside}" in said
    assert {name: digests(aside)[name] for name in changed} == {name: before[name] for name in changed}


def test_a_report_says_what_was_kept_cut_and_moved_aside(
    originals: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = damaged_sets.damaged(originals[V21], tmp_path / "set", V21, "state not a number")
    (folder / lerobot_sets.video_path(V21, 3)).unlink()
    assert run("repair", str(folder), "--workers", "1") == 0
    said = capsys.readouterr().out
    assert "kept: 3 episodes, 15 frames\n" in said
    assert (
        "cut: episode 1: 2 of its 5 frames are kept: observation.state has a value that is no number\n"
        in said
    )
    assert "moved aside: episode 3 (rows 0 to 3 of episode_000003.parquet): nothing says where its " in said
    assert said.endswith("pictures were read\n")


def run(*words: str) -> int:
    import argparse

    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return int(command.run(parser.parse_args(words)))


def test_a_task_that_nothing_says_is_asked_for(
    originals: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = damaged_sets.damaged(originals[V30], tmp_path / "set", V30, "tasks missing")
    damaged_sets.damage(folder, V30, "episodes missing")
    assert run("repair", str(folder), "--workers", "1") == 1
    said = capsys.readouterr().err
    assert f"{folder}: nothing says the task of episode 0, 1, 2, 3. Nothing was changed. " in said
    assert said.endswith(
        f'Run `joshua dataset repair {folder} --task "TEXT"` with what the robot does there\n'
    )
    assert run("repair", str(folder), "--workers", "1", "--task", "Pick.") == 0
    assert Dataset.read(folder).tasks == ("Pick.",)
    assert len(content(folder)) == 4


def test_fps_is_corrected_by_the_rows_and_the_videos(originals: dict[str, Path], tmp_path: Path) -> None:
    folder = damaged_sets.damaged(originals[V30], tmp_path / "set", V30, "fps")
    assert "corrected: fps is 10 by the rows and the videos, and was 25" in str(repair(folder))
    assert Dataset.read(folder).fps == FPS


def test_a_video_at_another_rate_keeps_its_pictures_as_they_are_encoded(
    originals: dict[str, Path], tmp_path: Path
) -> None:
    folder = damaged_sets.damaged(originals[V30], tmp_path / "set", V30, "video at another rate")
    path = folder / lerobot_sets.video_path(V30)
    before = footage.look(path, 0, 24, 32)
    size = path.stat().st_size
    repair(folder)
    after = footage.look(path, 0, 24, 32)
    assert (before.rate_hz, after.rate_hz) == (11, FPS)
    assert after.is_as_described(FPS)
    assert after.whole == FRAMES
    assert path.stat().st_size == pytest.approx(size, rel=0.05)


@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        (ParquetWriter, {"pictures": "png"}),
        (CsvWriter, {"pictures": "jpeg"}),
        (JsonlWriter, {}),
    ],
)
def test_tables_of_our_own(kind: type[DatasetWriter], changes: dict[str, Any], tmp_path: Path) -> None:
    folder = tmp_path / "set"
    writer = kind(layout(folder, **changes))
    writer.open()
    for length in (3, 4, 2):
        add_episode(writer, "wave", length)
    writer.close()
    (path,) = folder.glob("data/chunk-000/file-001*")
    if kind is ParquetWriter:
        (folder / f"images/{TOP}/chunk-000/episode-001/frame-000002.png").write_bytes(b"torn")
    else:
        path.write_bytes(path.read_bytes()[: -len(path.read_bytes().splitlines()[-1]) // 2 - 1])
    report = repair(folder)
    assert report.is_complete, report
    found = Dataset.read(folder)
    lengths = [episode.length for episode in found.episode_list()]
    assert lengths == [3, 2 if kind is ParquetWriter else 3, 2]
    with_more = kind(layout(folder, resume=True, **changes))
    with_more.open()
    add_episode(with_more, "wave", 2)
    with_more.close()
    assert [problem for problem in check(folder, workers=1) if problem.serious] == []


def test_an_error_of_the_system_is_no_damage(
    originals: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = damaged_sets.damaged(originals[V21], tmp_path / "set", V21, "state not a number")
    before = digests(folder)
    opened = Path.open

    def refused(path: Path, *arguments: object, **options: object) -> object:
        if path.name == "episode_000003.mp4":
            raise OSError(5, "Input/output error", str(path))
        return opened(path, *arguments, **options)  # type: ignore[call-overload]

    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", refused)
        with pytest.raises(
            EpisodeError, match=r"Input/output error\. .*Check the disk and its cable, then run"
        ):
            repair(folder)
    assert {name: found for name, found in digests(folder).items() if PRIVATE not in name} == before
    assert repair(folder).is_complete


def test_pointers_are_not_taken_for_damage(originals: dict[str, Path], tmp_path: Path) -> None:
    folder = damaged_sets.damaged(originals[V21], tmp_path / "set", V21, "state not a number")
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"
    for number in (2, 3):
        (folder / lerobot_sets.video_path(V21, number)).write_text(pointer)
    before = digests(folder)
    with pytest.raises(
        EpisodeError, match=r"2 files of .* are Git LFS pointers, .*Nothing was changed\. Run git"
    ):
        repair(folder)
    assert {name: found for name, found in digests(folder).items() if PRIVATE not in name} == before


def test_what_was_recorded_is_not_mended(tmp_path: Path) -> None:
    """An arm that did not follow is no damage of a file: it is said, and nothing is moved aside."""
    folder = tmp_path / "set"
    lerobot_sets.make(folder, V30)
    path = folder / lerobot_sets.rows_path(V30)
    table = pq.read_table(path)
    kind = pa.list_(pa.float32(), 2)
    still = pa.FixedSizeListArray.from_arrays(pa.array(np.zeros(2 * len(table), np.float32)), type=kind)
    pq.write_table(table.set_column(0, "observation.state", still), path)
    recompute(folder, workers=1)
    report: Report = repair(folder)
    assert not report.is_complete
    assert "finds what no repair mends: " in report.lines[-1]
    assert report.lines[-1].endswith("--episodes 0,1,2,3` to remove it")
    assert not (folder / PRIVATE / "aside").exists()


def test_an_unfinished_episode_in_av1_is_completed(tmp_path: Path) -> None:
    folder = tmp_path / "set"

    def record() -> None:
        writer = LeRobotWriter(layout(folder, codec="av1"))
        writer.task = "wave"
        writer.open()
        for number in range(200):
            writer.add_frame(frame(number % 12, 1_000_000_000 + number * 100_000_000))
        video = open_folder(folder) / f"{TOP}.mp4"
        eventually(lambda: mp4.fragments(video).end > 0, "pictures have reached the file")

    killed(record)
    assert "episode 0 is completed with" in str(repair(folder))
    (episode,) = Dataset.read(folder).episode_list()
    assert episode.length > 10


def test_an_unfinished_episode_is_kept_in_a_damaged_data_set(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    writer = LeRobotWriter(layout(folder))
    writer.open()
    for length in (3, 2):
        add_episode(writer, "wave", length)
    writer.close()
    killed(lambda: recording(folder, LeRobotWriter))
    (folder / "meta/stats.json").unlink()
    table = folder / "data/chunk-000/file-000.parquet"
    table.write_bytes(table.read_bytes()[:500])
    report = repair(folder)
    assert report.is_complete, report
    lengths = [episode.length for episode in Dataset.read(folder).episode_list()]
    assert lengths[0] == 2
    assert lengths[1] >= 10
    assert len(lengths) == 2
    assert Dataset.read(folder).tasks == ("wave",)
