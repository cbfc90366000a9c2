"""The folder of a run: nothing in it is half written, and what cannot be used is named."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from joshua_training import run_folder
from joshua_training.run_folder import (
    KEPT,
    RunError,
    RunFolder,
    described,
    read_part,
    refuse_other,
    unwritable,
)


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"is not a run, because it has no run\.json: name the folder"):
        RunFolder.open(tmp_path)
    (tmp_path / "run.json").write_text("{")
    with pytest.raises(RunError, match=r"cannot be read: .*: choose another run"):
        RunFolder.open(tmp_path).facts()


def test_runs_of_one_second_have_folders_of_their_own(tmp_path: Path) -> None:
    made = {RunFolder.create(tmp_path, "run", {"number": number}).path for number in range(20)}
    assert len(made) == 20
    (tmp_path / "file").touch()
    with pytest.raises(RunError, match=r"file/run-.* cannot be created: Not a directory: set output_folder"):
        RunFolder.create(tmp_path / "file", "run", {})


def test_only_the_owner_can_enter_a_run(tmp_path: Path) -> None:
    former = os.umask(0)
    try:
        path = RunFolder.create(tmp_path / "runs", "run", {}).path
    finally:
        os.umask(former)
    assert path.stat().st_mode & 0o777 == 0o700


def test_checkpoints_are_written_and_removed_in_their_run_alone(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "run", {"seed": 1})
    with pytest.raises(RunError, match=r"'\.\./\.\./state' cannot be a file name"):
        folder.save(1, {"../../state": b"1"})
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "step_000000000001").mkdir(parents=True)
    shutil.rmtree(folder.path / "checkpoints", ignore_errors=True)
    (folder.path / "checkpoints").symlink_to(elsewhere)
    with pytest.raises(RunError, match=r"the folder of the checkpoints .* is a symlink that leads outside"):
        folder.save(2, {"a": b"2"})
    with pytest.raises(RunError, match="is a symlink that leads outside"):
        folder.checkpoints()
    assert [path.name for path in elsewhere.iterdir()] == ["step_000000000001"]


def test_a_full_disk_leaves_the_checkpoints_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = RunFolder.create(tmp_path, "run", {"seed": 1})

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    said = "cannot be written: No space left on device: free some space, and"
    with pytest.raises(RunError, match=f"{said} start again; the run has no checkpoint yet"):
        folder.save(1, {"a": b"1"})
    monkeypatch.undo()
    first = folder.save(1, {"a": b"1"})
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(RunError, match=f"{said} continue with resume_run; the last checkpoint is complete"):
        folder.save(2, {"a": b"2"})
    monkeypatch.undo()
    assert folder.checkpoints() == [first]
    assert [path.name for path in (folder.path / "checkpoints").iterdir()] == [first.name]


def test_a_disk_that_is_not_full_has_another_remedy(tmp_path: Path) -> None:
    said = str(unwritable(tmp_path, OSError(30, "Read-only file system")))
    assert said == f"{tmp_path} cannot be written: Read-only file system: make it writable"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "state.json is missing"),
        (b'{"steps": 1', r"state.json is truncated or damaged \(.*\)"),
        (b"\xff\xfe", r"state.json is truncated or damaged \(.*\)"),
        (b"[1]", "state.json has no steps"),
        (b"{}", "state.json has no steps"),
    ],
)
def test_a_torn_checkpoint_names_the_one_before_it(tmp_path: Path, content: bytes | None, said: str) -> None:
    folder = RunFolder.create(tmp_path, "run", {})
    files = {"other": b"1"} if content is None else {"state.json": content}
    first, second = (folder.save(steps, files) for steps in (1, 2))
    with pytest.raises(RunError, match=rf"{second} cannot be used: {said}: remove it, .* from {first.name}$"):
        read_part(second, "state.json", json.loads, "steps")
    with pytest.raises(RunError, match=rf"{first} cannot be used: {said}: start a new run, because there is"):
        read_part(first, "state.json", json.loads, "steps")


def test_a_checkpoint_that_was_not_fetched_is_named_with_the_command(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "run", {})
    pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n"
    checkpoint = folder.save(1, {"policy.safetensors": pointer})
    with pytest.raises(RunError, match=r"policy.safetensors is a Git LFS pointer.*: Run git lfs install"):
        read_part(checkpoint, "policy.safetensors", json.loads)


def test_secrets_in_the_facts_of_a_run_are_hidden_and_the_run_is_continued(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WANDB_API_KEY", "0123456789abcdef")
    address = "https://me:pass-word@example.org/set"
    settings = {"dataset": address, "tags": ["0123456789abcdef"], "seed": 1}
    folder = RunFolder.create(tmp_path, "run", {"method": "METHOD_RL", "settings": settings})
    text = (folder.path / "run.json").read_text()
    assert "pass-word" not in text
    assert "0123456789abcdef" not in text
    assert "https://(hidden)@example.org/set" in text
    monkeypatch.delenv("WANDB_API_KEY")
    refuse_other(folder.facts(), {"settings": settings}, ())
    elsewhere = {**settings, "dataset": "https://me:pass-word@example.org/other"}
    with pytest.raises(RunError, match="started with dataset"):
        refuse_other(folder.facts(), {"settings": elsewhere}, ())


def test_one_process_at_a_time_writes_into_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_folder, "ENDING_S", 0.0)
    first = RunFolder.create(tmp_path, "run", {})
    first.lock()
    second = RunFolder.open(first.path)
    with pytest.raises(RunError, match=rf"another process uses the run {first.path}: wait until it ends"):
        second.lock()
    first.unlock()
    second.lock()
    second.unlock()


@pytest.mark.parametrize(
    ("before", "said"),
    [
        ({"kind": "evaluation", "environment": "a"}, "is an evaluation, not a training by METHOD_RL"),
        ({"method": "METHOD_IMITATION"}, "is a training by METHOD_IMITATION, not a training by METHOD_RL"),
        ({}, "is of unknown kind"),
    ],
)
def test_a_run_of_another_kind_is_not_continued(before: dict[str, str], said: str) -> None:
    with pytest.raises(RunError, match=f"the run {said}.*: name another one in resume_run"):
        refuse_other(before, {"environment": "a", "seed": 1}, ())
    refuse_other(before | {"features": 1}, {"features": 1}, ())  # facts that belong to any kind


def test_a_torn_line_and_later_ones_are_cut_from_the_metrics(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "run", {})
    for steps in (10, 20, 30):
        folder.add_metrics({"steps": steps})
    with (folder.path / "metrics.jsonl").open("ab") as file:
        file.write(b'[20]\n\xff\n{"steps": 1')
    folder.cut_metrics(20)
    assert (folder.path / "metrics.jsonl").read_text() == '{"steps": 10}\n{"steps": 20}\n'


def test_a_run_records_versions() -> None:
    found = described(Path(__file__).parent)["versions"]
    assert {"joshua-core", "joshua-training", "joshua-evaluation", "joshua-inference", "numpy"} <= set(found)


def test_a_run_records_the_commit_and_whether_its_files_are_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def git(*words: str) -> str:
        who = ("-c", "user.name=A", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false")
        done = subprocess.run(("git", *who, *words), cwd=tmp_path, check=True, capture_output=True, text=True)
        return done.stdout.strip()

    assert described(tmp_path)["git"] is None
    git("init", "-q")
    assert described(tmp_path)["git"] is None  # without a commit
    file = tmp_path / "train.pbtxt"
    file.write_text("1")
    git("add", ".")
    git("commit", "-qm", "first")
    commit = git("rev-parse", "HEAD")
    assert described(tmp_path)["git"] == {"commit": commit, "changed": False}
    inner = RunFolder.create(tmp_path / "runs", "run", {}).path
    assert described(inner)["git"] == {"commit": commit, "changed": False}
    file.write_text("2")
    assert described(tmp_path)["git"] == {"commit": commit, "changed": True}
    git("commit", "-qam", "second")
    assert described(tmp_path)["git"] == {"commit": git("rev-parse", "HEAD"), "changed": False}
    monkeypatch.setenv("PATH", str(tmp_path))
    assert described(tmp_path)["git"] is None  # without git


def test_a_checkpoint_of_folders_is_put_in_its_place_at_once(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "run", {})

    def write(draft: Path) -> None:
        assert folder.checkpoints() == []
        (draft / "model").mkdir()
        (draft / "model" / "weights").write_bytes(b"1")

    assert (folder.save_by(7, write) / "model" / "weights").read_bytes() == b"1"
    assert [path.name for path in folder.checkpoints()] == ["step_000000000007"]


def test_an_old_checkpoint_is_complete_or_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = RunFolder.create(tmp_path, "run", {})

    def interrupted(path: Path, ignore_errors: bool = False) -> None:
        if path.exists():
            (path / "a").unlink()
            raise KeyboardInterrupt

    for steps in range(KEPT):
        folder.save(steps, {"a": b"1", "b": b"2"})
    monkeypatch.setattr(shutil, "rmtree", interrupted)
    with pytest.raises(KeyboardInterrupt):
        folder.save(KEPT, {"a": b"1", "b": b"2"})
    monkeypatch.undo()
    for path in folder.checkpoints():
        assert sorted(file.name for file in path.iterdir()) == ["a", "b"]
    folder.save(KEPT + 1, {"a": b"1", "b": b"2"})
    assert len(list((folder.path / "checkpoints").iterdir())) == KEPT  # nothing is left of it


def test_a_run_goes_on_with_its_own_settings_only() -> None:
    before = {"seed": 1, "settings": {"batch_size": 8, "sizes": [1, 2], "steps": 10}}
    refuse_other(before, {"seed": 1, "settings": {"batch_size": 8, "sizes": (1, 2), "steps": 20}}, ("steps",))
    with pytest.raises(RunError, match="was started with batch_size 8, but the file says 4: continue with"):
        refuse_other(before, {"settings": {"batch_size": 4}}, ())
    with pytest.raises(RunError, match="was started with seed 1, but the file says 2"):
        refuse_other(before, {"seed": 2}, ())


def test_a_run_of_an_older_version_goes_on_once_it_says_how_it_was_started(tmp_path: Path) -> None:
    """The message names a line of JSON; with it, the run is accepted."""
    folder = RunFolder.create(tmp_path, "run", {"settings": {"batch_size": 8}})
    wanted = {
        "simulator_backend": "BACKEND_MJX",
        "settings": {"batch_size": 8, "sizes": (1, 2), "limit": None},
    }
    with pytest.raises(
        RunError,
        match=r"did not record simulator_backend, but the file says BACKEND_MJX: if that is how the run was "
        r'started, add "simulator_backend": "BACKEND_MJX" to run\.json; otherwise start a new run',
    ):
        refuse_other(folder.facts(), wanted, ())
    facts = {**folder.facts(), "simulator_backend": "BACKEND_MJX"}
    with pytest.raises(RunError, match=r'add "sizes": \[1, 2\] to "settings" in run\.json'):
        refuse_other(facts, wanted, ())
    refuse_other({**facts, "settings": {"batch_size": 8, "sizes": [1, 2]}}, wanted, ())
