"""What ``joshua sweep`` refuses before it needs a cluster."""

from __future__ import annotations

import json
import os
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from checkpoints import NAMES
from joshua.cli.main import main
from joshua_jobs.executor import JobError
from joshua_ray.commands import sweep
from joshua_ray.outcomes import COMPLETE, FAILED, Record, Sweep
from joshua_ray.spaces import Space
from judged_robot import write_judged

PRESETS = Path(__file__).resolve().parents[3] / "configs"
PPO = str(PRESETS / "training_rl_ppo.pbtxt")
IMITATION = str(PRESETS / "training_imitation.pbtxt")
RATE = "ai.training.rl_config.learning_rate"


@pytest.fixture(autouse=True)
def without_ray(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ([PPO], 2, "joshua sweep: no field varies. Write a range, such as"),
        ([PPO, "--set", f"{RATE}=uniform(1)"], 2, "it takes two numbers. Write uniform(0.9,0.999)"),
        ([PPO, "--set", f"{RATE}=grid(0.1,2)"], 2, "learning_rate must be above 0, at most 1"),
        ([PPO, "--set", "ai.training.rl_config.learning_rat=grid(0.1,0.2)"], 2, "learning_rate"),
        ([PPO, "--set", f"{RATE}=grid(0.1,0.2)", "--ray", "10.0.0.1:6379"], 2, "is not on the loopback"),
        ([PPO, "--set", f"{RATE}=grid(0.1,0.2)"], 3, "requires Ray, which is not installed"),
        (
            [str(PRESETS / "test_mock_hardware.pbtxt"), "--set", "general.name=grid(a,b)"],
            2,
            "trains nothing whose settings could be compared",
        ),
        (
            [IMITATION, "--set", "ai.training.imitation_config.learning_rate=grid(0.1,0.2)"],
            2,
            "is not known before it starts. Add --grace STEPS, after which a trial can be stopped",
        ),
    ],
)
def test_what_cannot_be_swept_is_said(
    words: list[str], code: int, said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["sweep", *words]) == code
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_sweep_drives_no_robot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "demos" / "meta").mkdir(parents=True)
    joints = {"dtype": "float32", "shape": [6], "names": [f"{name}.pos" for name in NAMES]}
    picture = {"dtype": "video", "shape": [48, 64, 3], "names": ["height", "width", "channels"]}
    features = {"observation.state": joints, "action": joints, "observation.images.top": picture}
    about = {"codebase_version": "v3.0", "fps": 25, "features": features}
    (tmp_path / "demos" / "meta" / "info.json").write_text(json.dumps(about))
    learned = (
        'method: METHOD_IMITATION imitation_config { dataset_name: "demos" num_epochs: 2 '
        "learning_rate: 0.001 batch_size: 4 }"
    )
    model = "model_type: MODEL_PLUGIN plugin_config { [joshua/joshua.LeRobotPolicy] {} }"
    path = write_judged(tmp_path / "robot.pbtxt", model=model, training=learned, rate_hz=10, cameras=("top",))
    words = ["sweep", str(path), "--set", "ai.training.imitation_config.learning_rate=grid(0.1,0.2)"]
    assert main([*words, "--grace", "10"]) == 2
    said = capsys.readouterr().err
    assert f"{path}: ai.training.environment is ENV_REAL: each trial would open the devices top, arm" in said
    assert "Add --set ai.training.environment=ENV_SIMULATION" in said
    assert main([*words, "--grace", "10", "--set", "ai.training.environment=ENV_SIMULATION"]) == 3


def test_a_trial_has_no_cluster_of_its_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("joshua_ray.executor.check", lambda address: None)
    cluster = 'ai.training.cluster.address="local"'
    assert main(["sweep", PPO, "--set", f"{RATE}=grid(0.1,0.2)", "--set", cluster]) == 2
    said = capsys.readouterr().err
    assert f"{PPO}: ai.training.cluster: a trial would wait for workers" in said
    assert "Remove the block: the trials run on the cluster of --ray" in said


def test_numbers_of_the_command_line_are_checked(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["sweep", PPO, "--trials", "0"])
    assert ended.value.code == 2
    assert "0 is less than 1" in capsys.readouterr().err


def test_without_ray_tune_its_extra_is_named() -> None:
    """Ray may be installed without the libraries of Tune."""
    said = r"Ray Tune, which is not complete \(.*\): install joshua-ray\[sweep\]"
    with pytest.raises(JobError, match=said) as caught:
        sweep._tuning()
    assert caught.value.exit_code == 3


def test_the_report_names_the_first_failure_and_the_best_trial(capsys: pytest.CaptureFixture[str]) -> None:
    settings = Sweep(
        "train.pbtxt", "ai.training.rl_config", (), "", "episode/return", "max", 10, 100, 3, 0, 1.0, ()
    )
    found, said = Record(settings), [f"line {number}" for number in range(20)]
    rows: list[tuple[str, str, dict[str, Any]]] = [
        ("00000", "0.1", {"ended": FAILED, "error": "\n".join(said)}),
        ("00001", "0.2", {"ended": FAILED, "error": "another"}),
        ("00002", "0.3", {"episode/return": 7.0, "steps": 48, "run": "/runs/a", "ended": COMPLETE}),
    ]
    for trial, rate, row in rows:
        outcome = found.of(trial, {RATE: rate})
        found.add(outcome, row)
        found.end(outcome)
    found.of("00002", {}).lost = 1
    sweep._report(found, [Space(RATE, "grid", items=("0.1", "0.2", "0.3"))])
    out, err = capsys.readouterr()
    assert err == "workers lost: 1; their trials were continued elsewhere\n" + "".join(
        f"{line}\n" for line in ("2 of 3 trials failed. The first, 00000:", *(f"  {x}" for x in said[-13:]))
    )
    assert out.endswith(f"best: /runs/a\n  --set '{RATE}=0.3'\n")


class Idle:
    """A cluster of one core."""

    def cores(self) -> float:
        """Return its cores."""
        return 1.0

    largest = cores


def test_a_full_disk_at_the_end_does_not_cost_the_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    def trained(sweep: Sweep, *_: Any) -> Record:
        record = Record(sweep)
        outcome = record.of("00000", {RATE: "0.1"})
        record.add(outcome, {"episode/return": 7.0, "steps": 48, "run": "/runs/a", "ended": COMPLETE})
        monkeypatch.setattr(os, "fsync", full)
        return record

    monkeypatch.setattr(sweep, "_tuning", lambda: SimpleNamespace(Cluster=Idle, run=trained))
    monkeypatch.setattr(sweep, "opened", lambda *_: nullcontext(Idle()))
    words = ["sweep", PPO, "--set", f"{RATE}=grid(0.1)", "--trials", "1", "--output", str(tmp_path / "s")]
    assert main(words) == 1
    said = capsys.readouterr()
    assert "best: /runs/a" in said.out
    cause = "cannot be written: No space left on device: free some space"
    assert said.err == f"joshua sweep: {tmp_path / 's' / 'sweep.json'} {cause}\n"
