"""Features of one number: a column of numbers, as LeRobot has it, and tables with lists of length 1."""

from __future__ import annotations

import contextlib
import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from joshua.features import DatasetLayout, Feature, FeatureSet, Frame
from joshua_dataset.checking import check
from joshua_dataset.checks.problem import Kind
from joshua_dataset.formats import writer_of
from joshua_dataset.reader import Dataset
from joshua_dataset.recomputing import recomputed
from joshua_dataset.repair import repair
from joshua_dataset.transform import Source, build, delete
from joshua_dataset.writer import DatasetWriter

FPS = 10
SINGLE = {"action": "float", "intervention": "bool"}
FEATURES = FeatureSet(
    [
        Feature.joints("observation.state", ("pan", "lift")),
        Feature.joints("action", ("motor",)),
        Feature("intervention", "bool", (1,)),
    ]
)


def values(number: int) -> dict[str, Any]:
    return {
        "observation.state": [number, -number],
        "action": [number + 0.5],
        "intervention": np.array([number % 2 == 0]),
    }


def opened(folder: Path, table_format: str = "lerobot", *, resume: bool = False) -> DatasetWriter:
    layout = DatasetLayout(folder, "arm", FPS, FEATURES, resume=resume)
    writer: DatasetWriter = writer_of(table_format)(layout)
    writer.open()
    return writer


def add_episode(writer: DatasetWriter, length: int) -> None:
    for number in range(length):
        writer.add_frame(Frame(1_000_000_000 + number * 100_000_000, values(number)))
    writer.end_episode("turn")


def write(folder: Path, *lengths: int, table_format: str = "lerobot") -> Path:
    with contextlib.closing(opened(folder, table_format)) as writer:
        for length in lengths:
            add_episode(writer, length)
    return folder


def with_lists(folder: Path) -> Path:
    """Turn the columns of one number into lists of length 1."""
    for path in folder.glob("data/*/*.parquet"):
        table = pq.read_table(path)
        described = json.loads(table.schema.metadata[b"huggingface"])
        for key in SINGLE:
            column = table.column(key).combine_chunks()
            at = table.column_names.index(key)
            table = table.set_column(at, key, pa.FixedSizeListArray.from_arrays(column, 1))
            kinds = described["info"]["features"]
            kinds[key] = {"feature": kinds[key], "length": 1, "_type": "List"}
        pq.write_table(table.replace_schema_metadata({"huggingface": json.dumps(described)}), path)
    return folder


def schemas(folder: Path) -> list[pa.Schema]:
    return [pq.read_schema(path) for path in sorted(folder.glob("data/*/*.parquet"))]


def require_episodes(folder: Path, *lengths: int, lists: bool = False) -> None:
    """Require the values of some episodes, and no problem but lists of length 1."""
    there = Dataset.read(folder)
    episodes = list(there.episode_list())
    assert [episode.length for episode in episodes] == list(lengths)
    for episode in episodes:
        columns = there.columns(episode)
        for key in FEATURES:
            expected = [np.array(values(number)[key]).tolist() for number in range(episode.length)]
            assert columns[key].tolist() == expected
    warning = (
        "warning: features of one number are stored as lists of length 1, which LeRobot does not load. "
        f"Run `joshua dataset convert {folder} TARGET`"
    )
    assert [str(problem) for problem in check(folder, workers=1)] == [warning] * lists
    stored = there.statistics()
    for key, found in recomputed(folder, workers=1).items():
        assert stored[key]["mean"] == pytest.approx(found["mean"])


def require_numbers(folder: Path) -> None:
    for schema in schemas(folder):
        assert {key: str(schema.field(key).type) for key in SINGLE} == SINGLE
        described = json.loads(schema.metadata[b"huggingface"])["info"]["features"]
        assert described["intervention"] == {"dtype": "bool", "_type": "Value"}


def test_features_of_one_number_are_columns_of_numbers(tmp_path: Path) -> None:
    write(tmp_path / "set", 4, 3)
    require_numbers(tmp_path / "set")
    require_episodes(tmp_path / "set", 4, 3)
    stats = json.loads((tmp_path / "set/meta/stats.json").read_text())
    assert stats["action"]["max"] == [3.5]


def test_lists_are_appended_to_as_lists(tmp_path: Path) -> None:
    folder = with_lists(write(tmp_path / "set", 4))
    require_episodes(folder, 4, lists=True)
    with contextlib.closing(opened(folder, resume=True)) as writer:
        add_episode(writer, 3)
        for number in range(2 * FPS):
            writer.add_frame(Frame(1_000_000_000 + number * 100_000_000, values(number)))
        shutil.copytree(folder, tmp_path / "killed")
        writer.drop_episode()
    require_episodes(folder, 4, 3, lists=True)
    repair(tmp_path / "killed")
    left = Dataset.read(tmp_path / "killed").frames - 7
    assert left > 0
    require_episodes(tmp_path / "killed", 4, 3, left, lists=True)
    for name in ("set", "killed"):
        first, *others = schemas(tmp_path / name)
        assert pa.types.is_fixed_size_list(first.field("action").type)
        assert all(other.equals(first, check_metadata=True) for other in others)


def test_tools_write_lists_as_numbers(tmp_path: Path) -> None:
    old, new = with_lists(write(tmp_path / "old", 4, 5)), write(tmp_path / "new", 3)
    build([Source(old), Source(new)], tmp_path / "both", workers=1)
    require_episodes(tmp_path / "both", 4, 5, 3)
    build([Source(old, (1,))], tmp_path / "part", workers=1)
    require_episodes(tmp_path / "part", 5)
    delete(old, [0], workers=1)
    require_episodes(old, 5)
    for name in ("both", "part", "old"):
        require_numbers(tmp_path / name)


@pytest.mark.parametrize("kind", ["parquet", "csv", "jsonl"])
def test_other_formats_have_the_same_columns(tmp_path: Path, kind: str) -> None:
    build([Source(with_lists(write(tmp_path / "set", 4)))], tmp_path / kind, table_format=kind, workers=1)
    with contextlib.closing(opened(tmp_path / kind, kind, resume=True)) as writer:
        add_episode(writer, 3)
    require_episodes(tmp_path / kind, 4, 3)
    build([Source(tmp_path / kind)], tmp_path / "back", workers=1)
    require_episodes(tmp_path / "back", 4, 3)
    require_numbers(tmp_path / "back")


def test_check_reports_a_torn_table_instead_of_stopping_at_it(tmp_path: Path) -> None:
    folder = write(tmp_path / "set", 4)
    table = next(folder.glob("data/*/*.parquet"))
    table.write_bytes(table.read_bytes()[:100])
    problems = list(check(folder, workers=1))
    (problem,) = (problem for problem in problems if problem.kind is Kind.ROWS_TORN)
    assert problem.episode == 0
    assert f"{table.relative_to(folder)} cannot be read" in problem.text


def test_check_reads_messages_of_one_number(tmp_path: Path) -> None:
    assert list(check(write(tmp_path / "set", 4, table_format="mcap"), workers=1)) == []


def test_the_command_warns_of_lists_and_its_remedy_works(tmp_path: Path) -> None:
    folder, target = with_lists(write(tmp_path / "set", 4)), tmp_path / "numbers"
    joshua = [sys.executable, "-m", "joshua", "dataset"]
    found = subprocess.run([*joshua, "check", str(folder)], capture_output=True, text=True, timeout=120)
    assert found.returncode == 0, found.stderr
    assert f"which LeRobot does not load. Run `joshua dataset convert {folder} TARGET`" in found.stdout
    done = subprocess.run(
        [*joshua, "convert", str(folder), str(target)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    require_numbers(target)
    require_episodes(target, 4)
