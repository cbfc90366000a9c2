"""Each remedy that ``check`` prints cures what it is printed for."""

from __future__ import annotations

import argparse
import contextlib
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import damaged_sets
import lerobot_sets
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from damaged_sets import CASES
from joshua.features import DatasetLayout, EpisodeError, Feature, FeatureSet, Frame
from joshua_dataset.checking import check
from joshua_dataset.checks.problem import TARGET, Kind, Problem
from joshua_dataset.commands import dataset as command
from joshua_dataset.repair import repair
from joshua_dataset.writer import LeRobotWriter
from lerobot_sets import V21, V30


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("originals")
    for version in (V30, V21):
        lerobot_sets.make(folder / version, version)
    return {version: folder / version for version in (V30, V21)}


#: Damage that leaves nothing to make a data set of: no remedy may be printed.
HOPELESS = {
    *((V30, name) for name in ("rows torn", "rows empty", "rows missing", "state dropped")),
    *((V30, name) for name in ("video empty", "video missing")),
    *((version, name) for version in (V30, V21) for name in ("feature without a column", "info torn")),
}


#: Damage for which ``check`` names no remedy, because a person has to know what is right.
WITHOUT = ("fps zero", "fps missing", "codebase_version", "data_path")


def cured(folder: Path, words: tuple[str, ...]) -> Path:
    """Run a remedy as it is printed, in this process; return the data set that it leaves or makes."""
    target = folder.with_name("target")
    chosen = [str(target) if word == TARGET else word for word in words]
    assert chosen[:2] == ["joshua", "dataset"]
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    assert command.run(parser.parse_args([*chosen[2:], "--workers", "1"])) == 0, shlex.join(chosen)
    return target if TARGET in words else folder


def kinds(problems: list[Problem]) -> set[tuple[Kind, int, str]]:
    return {(problem.kind, problem.episode, problem.text) for problem in problems}


@pytest.mark.parametrize(("version", "name"), sorted(HOPELESS))
def test_no_remedy_is_printed_where_nothing_is_left(
    originals: dict[str, Path], tmp_path: Path, version: str, name: str
) -> None:
    folder = damaged_sets.damaged(originals[version], tmp_path / "set", version, name)
    problems = list(check(folder, workers=1))
    assert any(problem.serious for problem in problems)
    assert not [str(problem) for problem in problems if problem.remedy is not None]
    with pytest.raises(EpisodeError, match=r"othing was changed"):
        repair(folder)


@pytest.mark.parametrize(("version", "name"), [case for case in CASES if case not in HOPELESS])
def test_each_remedy_cures(originals: dict[str, Path], tmp_path: Path, version: str, name: str) -> None:
    first = damaged_sets.damaged(originals[version], tmp_path / "first", version, name)
    remedies = {problem.remedy for problem in check(first, workers=1) if problem.remedy is not None}
    remedies = {tuple(word.replace(str(first), "FOLDER") for word in words) for words in remedies}
    assert remedies or name in WITHOUT, "no remedy is printed"
    for number, words in enumerate(sorted(remedies)):
        folder = damaged_sets.damaged(originals[version], tmp_path / f"{number}" / "set", version, name)
        named = tuple(word.replace("FOLDER", str(folder)) for word in words)
        before = [problem for problem in check(folder, workers=1) if problem.remedy == named]
        assert before
        made = cured(folder, named)
        after = kinds(list(check(made, workers=1)))
        assert not kinds(before) & after, f"{shlex.join(words)} does not cure"


def values(number: int) -> dict[str, Any]:
    return {"action": [number, 1.0], "grip": [0.5]}


def test_lists_of_one_are_cured(tmp_path: Path) -> None:
    """The one remedy that makes another data set."""
    folder = tmp_path / "set"
    features = FeatureSet([Feature.joints("action", ("pan", "lift")), Feature("grip", "float32", (1,))])
    with contextlib.closing(LeRobotWriter(DatasetLayout(folder, "arm", 10, features))) as writer:
        writer.open()
        for number in range(4):
            writer.add_frame(Frame(1000 + number * 100_000_000, values(number)))
        writer.end_episode("wave")
    path = folder / lerobot_sets.rows_path(V30)
    table = pq.read_table(path)
    lists = pa.FixedSizeListArray.from_arrays(table.column("grip").combine_chunks(), 1)
    table = table.set_column(table.column_names.index("grip"), "grip", lists)
    pq.write_table(table.replace_schema_metadata(None), path)
    (found,) = check(folder, workers=1)
    assert found.remedy is not None
    assert TARGET in found.remedy
    made = cured(folder, found.remedy)
    assert not list(check(made, workers=1))


def test_a_remedy_is_a_command_as_printed(originals: dict[str, Path], tmp_path: Path) -> None:
    """With a space in the name of the folder, in a process of its own."""
    folder = damaged_sets.damaged(originals[V30], tmp_path / "my data set", V30, "index gap")
    (printed,) = {str(problem).rpartition("Run `")[2] for problem in check(folder, workers=1)}
    program, *words = shlex.split(printed.removesuffix("`"))
    command_line = [str(Path(sys.executable).with_name(program)), *words]
    done = subprocess.run(command_line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not list(check(folder, workers=1))
