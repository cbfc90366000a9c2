"""``joshua runs``: what it prints of the folders of runs, compares and removes.

Why one file: every test reads what the same command says of the same few runs.
"""

from __future__ import annotations

import errno
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE, Popen
from typing import Any

import killed_prune
import pytest
from joshua.cli.main import main
from joshua_training.run_folder import RunError, RunFolder
from joshua_training.summaries import Removal, remove

LONG = "SoArm100PickPlace-v0-with-a-very-long-name-that-somebody-chose"


def command(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = main(["runs", *words])
    said = capsys.readouterr()
    return code, said.out, said.err


def training(
    parent: Path, name: str, *, steps: int = 1000, success: float = 0.5, **settings: Any
) -> RunFolder:
    facts = {
        "environment": "joshua/SoArm100Reach-v0",
        "seed": settings.pop("seed", 1),
        "settings": {"algorithm": "PPO", "learning_rate": 0.001, **settings},
        "versions": {"joshua-core": "0.1.0"},
        "git": {"commit": "abc", "changed": True},
        "started": "2026-11-22T10:00:00+0000",
    }
    path = parent / name
    path.mkdir(parents=True)
    run = RunFolder(path)
    run.write_json("run.json", facts)
    run.add_metrics({"steps": steps // 2, "episode/success_rate": 0.1, "train/loss": 3.0})
    run.add_metrics({"steps": steps, "episode/success_rate": success, "train/loss": 2.0})
    for number in (steps // 2, steps):
        run.save(number, {"weights": b"0" * 100})
    return run


def evaluation(
    parent: Path, name: str, successes: list[int], seed: int = 5, environment: str = "joshua/Ant-v0"
) -> RunFolder:
    path = parent / name
    path.mkdir(parents=True)
    run = RunFolder(path)
    run.write_json(
        "run.json", {"kind": "evaluation", "environment": environment, "seed": seed, "settings": {}}
    )
    rate = sum(successes) / len(successes)
    figure = {"value": rate, "low": 0.1, "high": 0.9, "method": "wilson", "episodes": successes}
    content = {
        "environment": environment,
        "episodes": len(successes),
        "seeds": list(range(seed, seed + len(successes))),
        "metrics": {"success_rate": figure},
        "randomise": False,
    }
    run.write_json("results.json", content)
    return run


def aged(run: RunFolder, days: float) -> None:
    for path in (run.path, *run.path.rglob("*")):
        os.utime(path, (path.stat().st_mtime - days * 86400,) * 2)


@contextmanager
def using(run: RunFolder) -> Iterator[None]:
    """A process that works in a run and writes nothing."""
    code = "import sys, pathlib, joshua_training.run_folder as f\nr = f.RunFolder(pathlib.Path(sys.argv[1]))"
    words = [sys.executable, "-c", f"{code}\nr.lock()\nprint()\nsys.stdin.read()", str(run.path)]
    with Popen(words, stdin=PIPE, stdout=PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"\n"
        yield
        process.communicate()


def test_the_list_fits_80_columns_and_puts_the_newest_last(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    aged(training(tmp_path, "old", steps=123456), 3)
    aged(training(tmp_path, LONG), 2)
    evaluation(tmp_path, "judged", [1, 1, 0])
    torn = tmp_path / "torn"
    torn.mkdir()
    (torn / "run.json").write_text("{")
    code, out, _ = command(capsys, "list", str(tmp_path))
    lines = out.splitlines()
    assert code == 0
    assert lines[0].split() == ["RUN", "KIND", "STEPS", "RESULT"]
    assert lines[1].startswith("old ")
    assert "123,456  success 0.50" in lines[1]
    assert "…" in lines[2]
    assert re.search(r"eval +3  success 0\.67 \(0\.10-0\.90\)$", out, re.MULTILINE)
    assert "cannot be read" in out
    assert max(map(len, lines)) <= 80


def test_a_training_without_success_shows_its_loss(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "act").mkdir()
    run = RunFolder(tmp_path / "act")
    run.write_json("run.json", {"dataset": "cubes"})
    run.add_metrics({"steps": 10, "loss/train": 0.5, "loss/l1": 0.4})
    assert "loss 0.5" in command(capsys, "list", str(tmp_path))[1]
    run.add_metrics({"steps": 20, "loss/train": 0.3, "loss/validation": 0.6})
    assert "20  validation loss 0.6" in command(capsys, "list", str(tmp_path))[1]
    assert "training of cubes" in command(capsys, "show", str(run.path))[1]


def test_a_list_as_json_has_everything(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    training(tmp_path, LONG, success=0.75)
    _, out, _ = command(capsys, "list", str(tmp_path), "--format", "json")
    (row,) = json.loads(out)
    assert row["name"] == LONG
    assert (row["steps"], row["checkpoints"], row["seed"]) == (1000, 2, 1)
    assert row["figures"]["episode/success_rate"] == 0.75
    assert row["settings"]["algorithm"] == "PPO"


def test_a_folder_without_runs_says_what_a_run_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = command(capsys, "list", str(tmp_path))
    assert code == 0
    assert "contains no run. A run is a folder with run.json" in out
    code, _, err = command(capsys, "list", str(tmp_path / "nowhere"))
    assert code == 2
    assert "there is no folder" in err
    assert "name the output_folder of the training" in err


def test_show_tells_settings_figures_versions_and_git(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = training(tmp_path, "reach")
    code, out, _ = command(capsys, "show", str(run.path))
    assert code == 0
    for text in (
        "training of joshua/SoArm100Reach-v0, started 2026-11-22T10:00:00+0000",
        "1,000 steps: success 0.50",
        "checkpoints: 2, ",
        "git: abc, with changes",
        "settings: algorithm PPO, learning_rate 0.001",
        "train/loss 2",
        "versions: joshua-core 0.1.0",
    ):
        assert text in out
    assert max(map(len, out.splitlines()[1:])) <= 80
    _, out, _ = command(capsys, "show", str(run.path), "--format", "json")
    assert json.loads(out)["steps"] == 1000


def test_a_name_that_is_no_run_is_answered_with_the_nearest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    training(tmp_path / "runs", "reach-20261122")
    assert command(capsys, "show", "reach-20261122")[0] == 0
    code, _, err = command(capsys, "show", "reach-20261123")
    assert code == 2
    assert "is not a run, because it has no run.json; in runs/ there are reach-20261122" in err
    (tmp_path / "runs" / "reach-20261122" / "run.json").write_text("[]")
    code, _, err = command(capsys, "show", "reach-20261122")
    assert code == 1
    assert "contains no JSON object: choose another run" in err


def test_compare_shows_what_differs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    training(tmp_path, "a", success=0.25)
    training(tmp_path, "b", success=0.75, learning_rate=0.01, n_epochs=[8, 64])
    code, out, _ = command(capsys, "compare", str(tmp_path / "a"), str(tmp_path / "b"))
    assert code == 0
    rows = [line.split() for line in out.splitlines()]
    assert ["learning_rate", "0.001", "0.01"] in rows
    assert ["episode/success_rate", "0.25", "0.75"] in rows
    assert ["n_epochs", "none", "[8,", "64]"] in rows
    assert "algorithm" not in out
    assert max(map(len, out.splitlines()[2:])) <= 80
    code, _, err = command(capsys, "compare", str(tmp_path / "a"))
    assert code == 2
    assert "one run cannot be compared" in err


def test_two_evaluations_from_the_same_seeds_are_compared_episode_by_episode(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    evaluation(tmp_path, "a", [0] * 9 + [1])
    evaluation(tmp_path, "b", [1] * 9 + [1])
    evaluation(tmp_path, "c", [1] * 10, seed=6)
    names = [str(tmp_path / name) for name in "abc"]
    _, out, _ = command(capsys, "compare", *names[:2])
    (row,) = (line.split() for line in out.splitlines() if line.startswith("success_rate") and "to" in line)
    assert row[1] == "+0.9"
    assert row[-3:] == ["9", "0", "0.00391"]  # 2 / 2 ** 9
    _, out, _ = command(capsys, "compare", names[0], names[2])
    assert "Not compared episode by episode" in out
    assert "began from different seeds" in out
    evaluation(tmp_path, "d", [1] * 10, environment="acme/Other-v0")
    _, out, _ = command(capsys, "compare", names[0], str(tmp_path / "d"), "--format", "json")
    assert "environment is joshua/Ant-v0 and acme/Other-v0" in json.loads(out)["not_paired"]
    (tmp_path / "b" / "results.json").unlink()
    _, out, _ = command(capsys, "compare", *names[:2])
    said = f"{names[1]} has no usable results.json: wait until its evaluation ends, or evaluate again"
    assert f"Not compared episode by episode: {said}" in out


def test_a_comparison_of_one_episode_shows_no_interval(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [str(tmp_path / name) for name in "ab"]
    for value, name in enumerate("ab"):
        run = evaluation(tmp_path, name, [value])
        content = json.loads((run.path / "results.json").read_text())
        mean = {"value": 3.0 * value, "low": None, "high": None, "method": "bootstrap"}
        content["metrics"]["avg_return"] = {**mean, "episodes": [3.0 * value]}
        run.write_json("results.json", content)
    _, out, _ = command(capsys, "compare", *names)
    (row,) = (line.split() for line in out.splitlines() if line.startswith("avg_return") and "+" in line)
    assert row == ["avg_return", "+3", "none", "1", "0", "none"]
    _, out, _ = command(capsys, "compare", *names, "--format", "json")
    assert "NaN" not in out
    assert json.loads(out)["paired"]["avg_return"]["low"] is None


def test_prune_removes_only_with_yes_and_never_what_may_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = training(tmp_path, "old"), training(tmp_path, "new")
    aged(old, 10)
    words = ("prune", str(tmp_path), "--keep-checkpoints", "1")
    code, out, _ = command(capsys, *words)
    assert code == 0
    assert "step_000000000500: older checkpoint, 100 B" in out
    assert "Nothing was removed. Add --yes to free 100 B" in out
    assert len(old.checkpoints()) == 2
    command(capsys, *words, "--yes")
    assert [path.name for path in old.checkpoints()] == ["step_000000001000"]
    assert len(new.checkpoints()) == 2
    aged(old, 10)
    _, out, _ = command(capsys, "prune", str(tmp_path), "--older-than", "7", "--yes")
    assert "unchanged for 2" in out
    assert not old.path.exists()
    assert new.path.exists()
    code, _, err = command(capsys, "prune", str(tmp_path))
    assert code == 2
    assert "add --keep-checkpoints N, --older-than DAYS or --empty" in err


def test_prune_removes_runs_that_came_to_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    failed, judged = training(tmp_path, "failed"), evaluation(tmp_path, "judged", [1])
    for path in failed.checkpoints():
        path.joinpath("weights").unlink()
        path.rmdir()
    for run in (failed, judged):
        aged(run, 1)
    _, out, _ = command(capsys, "prune", str(tmp_path), "--empty", "--yes")
    assert "no checkpoint and no results" in out
    assert not failed.path.exists()
    assert judged.path.exists()
    _, out, _ = command(capsys, "prune", str(tmp_path), "--empty")
    assert out == "Nothing to remove\n"


def test_prune_leaves_a_run_alone_that_a_process_uses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = training(tmp_path, "quiet")
    aged(run, 10)
    words = ("prune", str(tmp_path), "--older-than", "1", "--keep-checkpoints", "1", "--yes")
    with using(run):
        _, out, _ = command(capsys, *words)
        assert out == "Nothing to remove\n"
        with pytest.raises(RunError, match="another process uses the run"):
            remove(Removal(run, run.path, "it began meanwhile", 0))
    assert len(run.checkpoints()) == 2
    command(capsys, *words)
    assert not run.path.exists()


def test_what_cannot_be_removed_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = training(tmp_path, "old")
    aged(run, 10)

    def refused(path: Path, target: Path) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "rename", refused)
    code, _, err = command(capsys, "prune", str(tmp_path), "--older-than", "1", "--yes")
    assert code == 1
    assert f"{run.path} cannot be removed: Permission denied" in err
    with pytest.raises(RunError, match="gone cannot be removed: No such file or directory"):
        remove(Removal(RunFolder(tmp_path / "gone"), tmp_path / "gone", "another command removed it", 0))


def test_one_that_cannot_be_removed_keeps_no_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = training(tmp_path, "first"), training(tmp_path, "second")
    for run in (first, second):
        aged(run, 10)
    rename = Path.rename

    def refused(path: Path, target: Path) -> Path:
        if path == first.path:
            raise OSError(errno.EROFS, "Read-only file system")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", refused)
    code, out, err = command(capsys, "prune", str(tmp_path), "--older-than", "1", "--yes")
    assert code == 1
    assert f"{first.path} cannot be removed: Read-only file system" in err
    assert not second.path.exists()
    assert len(first.checkpoints()) == 2
    assert "Removed: " in out


def test_a_run_that_cannot_be_read_is_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = training(tmp_path, "old")
    aged(run, 10)
    scandir = os.scandir

    def refused(path: Any = ".") -> Any:
        if str(path).endswith("checkpoints"):
            raise OSError(errno.EIO, "Input/output error", str(path))
        return scandir(path)

    with monkeypatch.context() as patch:
        patch.setattr(os, "scandir", refused)
        for words in (("--older-than", "1"), ("--empty",), ("--keep-checkpoints", "0")):
            code, out, err = command(capsys, "prune", str(tmp_path), *words, "--yes")
            assert (code, out) == (0, "Nothing to remove\n")
            assert f"{run.path} is left alone, because {run.path}/checkpoints cannot be read: Input" in err
    assert len(run.checkpoints()) == 2


def test_a_prune_that_is_killed_before_any_file_operation_is_completed_by_the_next(tmp_path: Path) -> None:
    words = [sys.executable, killed_prune.__file__, str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["wrong"] == [], done.stderr
    assert found["operations"] > 8


@pytest.mark.parametrize(
    ("option", "value", "expected"),
    [
        ("--keep-checkpoints", "-1", "a whole number of at least 0"),
        ("--older-than", "soon", "a number of days above 0"),
        ("--older-than", "0", "a number of days above 0"),
        ("--older-than", "nan", "a number of days above 0"),
    ],
)
def test_a_wrong_number_is_refused(
    option: str, value: str, expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        command(capsys, "prune", option, value)
    assert f"{option}: {value!r}: expected {expected}" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("run.json", b'{"settings": [1]}'),
        ("run.json", b"{"),
        ("metrics.jsonl", b'\xff\n{"steps": "many"}\n'),
        ("results.json", b'{"seeds": [1], "metrics": {"success_rate": {}}}'),
        ("results.json", b'{"seeds": [1], "metrics": {"success_rate": 7}}'),
    ],
)
def test_a_damaged_run_is_named_and_hides_no_other(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    content: bytes,
) -> None:
    monkeypatch.chdir(tmp_path)
    training(tmp_path / "runs", "whole")
    damaged = training(tmp_path / "runs", "damaged")
    (damaged.path / name).write_bytes(content)
    (damaged.path / "dangling").symlink_to(tmp_path / "absent")
    code, said, _ = command(capsys, "list")
    assert code == 0
    assert re.search(r"whole +train +1,000 +success 0.50", said)
    assert re.search(r"damaged +train +0 +cannot be read", said)
    for words in (("show", "damaged"), ("compare", "whole", "damaged")):
        code, _, said = command(capsys, *words)
        assert code == 1
        assert re.search(r"runs/damaged.* (cannot be read|are damaged).*: choose another run", said)
