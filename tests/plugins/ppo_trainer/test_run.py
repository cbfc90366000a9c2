"""A run that cannot learn says why, without a traceback."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from joshua.testing.domain import reserved_domain
from joshua_ppo_trainer.run_folder import RunError, RunFolder, described

PRESET = Path(__file__).resolve().parents[3] / "configs" / "training_rl_ppo.pbtxt"


def test_without_pytorch_a_run_names_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "torch.py").write_text("raise ModuleNotFoundError('No module named torch', name='torch')\n")
    output = f'ai.training.rl_config.output_folder="{tmp_path / "runs"}"'
    with reserved_domain() as domain:
        ended = subprocess.run(
            [sys.executable, "-m", "joshua.cli.main", "--config", str(PRESET), "--set", output],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain), "PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
            timeout=200,
        )
    assert ended.returncode == 3
    assert (
        "training requires torch, which is not installed: install joshua-ppo-trainer[learn]" in ended.stderr
    )
    assert "Traceback" not in ended.stderr
    assert not (tmp_path / "runs").exists()


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"is no run, because it has no run\.json: name the folder"):
        RunFolder.open(tmp_path)
    (tmp_path / "run.json").write_text("{")
    with pytest.raises(RunError, match=r"cannot be read: .*: choose another run"):
        RunFolder.open(tmp_path).facts()


def test_a_full_disk_leaves_the_checkpoints_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = RunFolder.create(tmp_path, "run", {"seed": 1})
    first = folder.save(1, {"a": b"1"})

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(RunError, match="cannot be written: No space left on device: make room"):
        folder.save(2, {"a": b"2"})
    monkeypatch.undo()
    assert folder.checkpoints() == [first]
    assert [path.name for path in (folder.path / "checkpoints").iterdir()] == [first.name]


def test_a_torn_line_and_later_ones_are_cut_from_the_metrics(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "run", {})
    for steps in (10, 20, 30):
        folder.add_metrics({"steps": steps})
    with (folder.path / "metrics.jsonl").open("a") as file:
        file.write('{"steps": 1')
    folder.cut_metrics(20)
    assert (folder.path / "metrics.jsonl").read_text() == '{"steps": 10}\n{"steps": 20}\n'


def test_a_run_records_versions_and_git(tmp_path: Path) -> None:
    assert described(tmp_path)["git"] is None
    found = described(PRESET.parent)
    assert "joshua-core" in found["versions"]
