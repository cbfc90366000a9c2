"""What `joshua dataset check` names, for damages of each kind; `tests/learn` has LeRobot as the oracle."""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from damaging import LENGTHS, TOP, damages, is_unseen, write_sound
from joshua.features import EpisodeError
from joshua_dataset.checking import Looked, check
from joshua_dataset.checks.problem import Kind, spelled
from joshua_dataset.fitness import UnfitError, require_fit
from joshua_dataset.reader import DatasetError
from small_dataset import as_v21

ROWS = "data/chunk-000/file-002.parquet"
EPISODES = "meta/episodes/chunk-000/file-002.parquet"
TASKS = "meta/tasks.parquet"
VIDEO = f"videos/{TOP}/chunk-000/file-002.mp4"
STATE = "meta/stats.json: observation.state"

#: What is named for some damages of the layout v3.0, which has them all.
EXPECTED = {
    f"{ROWS}: file: removed": Kind.ROWS_MISSING,
    f"{ROWS}: file: emptied": Kind.ROWS_TORN,
    f"{ROWS}: file: cut": Kind.ROWS_TORN,
    f"{ROWS}: file: pointer": Kind.POINTER,
    f"{ROWS}: file: noise": Kind.ROWS_TORN,
    f"{ROWS}: rows: last lost": Kind.EPISODE_LENGTH,
    f"{ROWS}: rows: first lost": Kind.INDEX_GAP,
    f"{ROWS}: rows: last twice": Kind.INDEX_REPEATED,
    f"{ROWS}: rows: turned round": Kind.FRAME_INDEX,
    f"{ROWS}: columns: one more": Kind.ROWS_COLUMN,
    f"{ROWS}: index: shifted": Kind.INDEX_GAP,
    f"{ROWS}: index: repeated": Kind.INDEX_REPEATED,
    f"{ROWS}: index: swapped": Kind.INDEX_REPEATED,
    f"{ROWS}: index: dropped": Kind.ROWS_COLUMN,
    f"{ROWS}: index: text": Kind.ROWS_COLUMN,
    f"{ROWS}: index: null": Kind.ROWS_COLUMN,
    f"{ROWS}: episode_index: one off": Kind.EPISODE_INDEX,
    f"{ROWS}: episode_index: shifted": Kind.ROWS_UNCOUNTED,
    f"{ROWS}: frame_index: repeated": Kind.FRAME_INDEX,
    f"{ROWS}: timestamp: shifted": Kind.TIMESTAMP,
    f"{ROWS}: timestamp: NaN": Kind.ROWS_COLUMN,
    f"{ROWS}: task_index: huge": Kind.TASK_UNKNOWN,
    f"{ROWS}: task_index: one off": Kind.TASKS_CONTRADICT,
    f"{ROWS}: action: dropped": Kind.ROWS_COLUMN,
    f"{ROWS}: action: NaN": Kind.ROWS_NOT_FINITE,
    f"{ROWS}: action: infinite": Kind.ROWS_NOT_FINITE,
    f"{ROWS}: action: huge": Kind.STATISTICS_CONTRADICT,
    f"{ROWS}: stamp_ns: swapped": Kind.STAMPS,
    f"{TASKS}: file: removed": Kind.TASKS_MISSING,
    f"{TASKS}: file: cut": Kind.TASKS_TORN,
    f"{TASKS}: rows: last lost": Kind.INFO_TOTALS,
    f"{TASKS}: rows: turned round": Kind.TASKS_UNORDERED,
    f"{TASKS}: task_index: repeated": Kind.TASKS_REPEATED,
    f"{TASKS}: task_index: dropped": Kind.TASKS_TORN,
    f"{TASKS}: __index_level_0__: other text": Kind.TASK_UNKNOWN,
    f"{EPISODES}: file: removed": Kind.EPISODES_LOST,
    f"{EPISODES}: file: cut": Kind.EPISODES_TORN,
    f"{EPISODES}: episode_index: shifted": Kind.EPISODES_UNORDERED,
    f"{EPISODES}: length: shifted": Kind.EPISODE_LENGTH,
    f"{EPISODES}: length: text": Kind.EPISODES_COLUMN,
    f"{EPISODES}: tasks: other text": Kind.TASK_UNKNOWN,
    f"{EPISODES}: dataset_from_index: shifted": Kind.EPISODE_RANGE,
    f"{EPISODES}: dataset_to_index: dropped": Kind.EPISODES_COLUMN,
    f"{EPISODES}: data/file_index: shifted": Kind.EPISODE_FILE,
    f"{EPISODES}: videos/{TOP}/file_index: shifted": Kind.VIDEO_MISSING,
    f"{EPISODES}: videos/{TOP}/from_timestamp: shifted": Kind.VIDEO_SHORT,
    f"{EPISODES}: videos/{TOP}/to_timestamp: shifted": Kind.EPISODE_VIDEO,
    f"{EPISODES}: videos/{TOP}/to_timestamp: NaN": Kind.EPISODE_VIDEO,
    f"{EPISODES}: meta/episodes/file_index: shifted": Kind.EPISODE_FILE,
    f"{EPISODES}: stats/action/max: one off": Kind.EPISODE_STATISTICS,
    f"{EPISODES}: stats/action/mean: NaN": Kind.EPISODE_STATISTICS,
    f"{VIDEO}: file: removed": Kind.VIDEO_MISSING,
    f"{VIDEO}: file: cut": Kind.VIDEO_TORN,
    f"{VIDEO}: file: pointer": Kind.POINTER,
    "meta/stats.json: file: removed": Kind.STATISTICS_MISSING,
    "meta/stats.json: file: cut": Kind.STATISTICS_TORN,
    f"{STATE}: dropped": Kind.STATISTICS_MISSING,
    f"{STATE}.std: dropped": Kind.STATISTICS_MISSING,
    f"{STATE}.mean: NaN": Kind.STATISTICS_NOT_FINITE,
    f"{STATE}.min: one more": Kind.STATISTICS_CONTRADICT,
    f"{STATE}.q50: one more": Kind.STATISTICS_CONTRADICT,
    f"{STATE}.max: short": Kind.STATISTICS_TORN,
    "meta/info.json: file: cut": Kind.INFO_TORN,
    "meta/info.json: codebase_version: dropped": Kind.INFO_VERSION,
    "meta/info.json: fps: one more": Kind.INFO_FPS,
    "meta/info.json: fps: half": Kind.INFO_FIELD,
    "meta/info.json: total_episodes: one more": Kind.EPISODES_LOST,
    "meta/info.json: total_frames: one more": Kind.INFO_TOTALS,
    "meta/info.json: total_tasks: one more": Kind.INFO_TOTALS,
    "meta/info.json: splits.train: other": Kind.INFO_SPLITS,
    "meta/info.json: data_path: other": Kind.INFO_PATH,
    "meta/info.json: video_path: other": Kind.INFO_PATH,
    "meta/info.json: features.action: dropped": Kind.ROWS_COLUMN,
    "meta/info.json: features.action.shape: short": Kind.INFO_FEATURE,
    "meta/info.json: features.action.dtype: other": Kind.INFO_FEATURE,
    "meta/info.json: features.action.names: short": Kind.INFO_FEATURE,
    f"meta/info.json: features.{TOP}.shape: one more": Kind.VIDEO_SIZE,
    f"meta/info.json: features.{TOP}.info.video.fps: one more": Kind.INFO_VIDEO,
    f"meta/info.json: features.{TOP}.info.video.codec: other": Kind.VIDEO_CODEC,
}


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sound") / "set"
    write_sound(folder)
    return folder


@pytest.fixture
def copy(sound: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(sound, tmp_path / "set"))


def kinds(folder: Path, *, pictures: bool = False) -> set[Kind]:
    return {problem.kind for problem in check(folder, pictures=pictures, workers=1)}


def test_nothing_is_found_in_a_sound_data_set(sound: Path, tmp_path: Path) -> None:
    looked = Looked()
    assert list(check(sound, workers=1, looked=looked)) == []
    assert str(looked) == "3 episodes, 15 rows, the headers of 3 videos and 15 pictures were read"
    assert list(check(sound, pictures=False, workers=1, looked=(looked := Looked()))) == []
    assert str(looked) == "3 episodes, 15 rows, the headers of 3 videos and no pictures were read"
    older = Path(shutil.copytree(sound, tmp_path / "older"))
    as_v21(older)
    assert kinds(older) == set()


def test_each_damage_has_its_kind(sound: Path, tmp_path: Path) -> None:
    known = {damage.name: damage for damage in damages(sound)}
    assert len(EXPECTED) >= 40
    assert set(EXPECTED) <= set(known)
    wrong = {}
    for number, (name, kind) in enumerate(EXPECTED.items()):
        folder = Path(shutil.copytree(sound, tmp_path / str(number)))
        known[name].apply(folder)
        found = kinds(folder)
        if kind not in found:
            wrong[name] = sorted(map(str, found))
        shutil.rmtree(folder)
    assert wrong == {}


@pytest.mark.parametrize("layout", ["v3.0", "v2.1"])
def test_every_damage_is_named_or_of_a_class_that_cannot_be_seen(
    sound: Path, tmp_path: Path, layout: str
) -> None:
    whole = Path(shutil.copytree(sound, tmp_path / "whole"))
    if layout == "v2.1":
        as_v21(whole)
        (whole / "meta/stats.json").unlink()  # LeRobot's layout v2.1 has statistics by episode only
    chosen = [damage for damage in damages(whole) if not is_unseen(damage.name)]
    silent = []
    for number, damage in enumerate(chosen[::5]):
        folder = Path(shutil.copytree(whole, tmp_path / str(number)))
        damage.apply(folder)
        with contextlib.suppress(DatasetError):  # it is no data set at all, and the command says so
            silent += [damage.name] if not kinds(folder) else []
        shutil.rmtree(folder)
    assert silent == []


def test_the_guide_has_every_kind() -> None:
    guide = Path(__file__).parents[3] / "docs/guides/data-set-checks.md"
    text = guide.read_text(encoding="utf-8")
    assert [str(kind) for kind in Kind if f"| `{kind}` |" not in text] == []


def column(path: Path, name: str, change: Callable[[Any], Any]) -> None:
    table = pq.read_table(path)
    values = pa.array(change(table.column(name).to_numpy().copy()), table.schema.field(name).type)
    pq.write_table(table.set_column(table.column_names.index(name), name, values), path)


def test_a_torn_file_hides_nothing_of_the_others(copy: Path) -> None:
    for name in ("meta/tasks.parquet", "meta/stats.json", EPISODES, VIDEO.replace("002", "000")):
        path = copy / name
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    column(copy / ROWS, "frame_index", lambda values: values + 1)
    column(copy / ROWS.replace("002", "001"), "index", lambda values: values + 1)
    found = kinds(copy, pictures=True)
    assert {Kind.TASKS_TORN, Kind.STATISTICS_TORN, Kind.EPISODES_TORN, Kind.VIDEO_TORN} <= found
    assert {Kind.FRAME_INDEX, Kind.INDEX_GAP} <= found


def test_a_problem_names_the_episodes_of_its_file(copy: Path) -> None:
    (copy / ROWS).write_bytes(b"")
    (problem,) = (problem for problem in check(copy, workers=1) if problem.kind is Kind.ROWS_TORN)
    assert problem.concerned == {2}
    assert problem.remedy == ("joshua", "dataset", "repair", str(copy))
    assert str(problem).startswith(f"error: episode 2: {ROWS} cannot be read")
    assert spelled((0, 1, 2, 5, 7, 8)) == "0-2,5,7-8"


def test_a_video_at_another_rate_is_named_whatever_its_length(copy: Path) -> None:
    from joshua_dataset.pictures import Video

    (copy / VIDEO).unlink()
    video = Video(copy / VIDEO, 64, 48, 9)
    for number in range(LENGTHS[2]):
        video.add(np.full((48, 64, 3), 40 * number, np.uint8))
    video.close()
    (problem,) = (problem for problem in check(copy, pictures=False, workers=1) if problem.serious)
    assert problem.kind is Kind.VIDEO_RATE
    assert problem.sentence == f"episode 2: {VIDEO} is at 9 Hz, and its rows are at 10 Hz"


def test_a_wrong_fps_is_told_from_wrong_rows_and_videos(copy: Path) -> None:
    info = json.loads((copy / "meta/info.json").read_text())
    (copy / "meta/info.json").write_text(json.dumps(info | {"fps": 50}))
    (problem,) = (problem for problem in check(copy, workers=1) if problem.serious)
    assert problem.text == "meta/info.json: fps is 50, and the rows and videos are at 10 Hz"


def test_a_faulty_data_set_is_refused_but_for_the_episodes_that_are_left_out(copy: Path) -> None:
    assert require_fit(copy, "used") == []
    column(copy / ROWS, "frame_index", lambda values: values + 1)
    with pytest.raises(UnfitError, match=r"cannot be used: episode 2: frame_index .*`joshua dataset repair"):
        require_fit(copy, "used")
    assert all(not problem.serious for problem in require_fit(copy, "used", left_out={2}))
    assert issubclass(UnfitError, EpisodeError)
