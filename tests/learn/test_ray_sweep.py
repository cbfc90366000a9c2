"""Sweeps on real Ray clusters, one of whose nodes is killed."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from joshua_ray.commands.sweep import COMPLETE
from joshua_ray.outcomes import FAILED
from joshua_training.run_folder import RunFolder
from ray_nodes import add_worker, started
from trainings import write_training

RATE = "ai.training.rl_config.learning_rate"


def sweep(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "joshua", "sweep", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def wait_until(true: Callable[[], Any], process: subprocess.Popen[str], limit_s: float = 240) -> None:
    until_s = time.monotonic() + limit_s
    while not true():
        assert process.poll() is None, process.communicate()[0]
        assert time.monotonic() < until_s
        time.sleep(0.05)


def processes_of(folder: Path) -> list[str]:
    """Lists processes whose command line names a folder."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes().decode(errors="replace").replace("\0", " ")
        except OSError:
            continue
        if str(folder) in words and str(os.getpid()) != path.parent.name:
            found.append(words)
    return found


def test_a_sweep_names_its_best_trial_and_survives_a_killed_node(tmp_path: Path) -> None:
    path = write_training(tmp_path, total_timesteps=24000, checkpoint_steps=480)
    output = tmp_path / "sweep"
    nodes = started(1)
    try:
        worker = add_worker(nodes)
        process = sweep(
            *(str(path), "--set", f"{RATE}=grid(0.001,0.003)", "--trials", "1", "--grace", "24000"),
            *("--ray", nodes.address, "--output", str(output)),
        )
        wait_until(
            lambda: len({found.parents[3] for found in output.glob("*/runs/*/checkpoints/step_*")}) == 2,
            process,
        )
        nodes.remove_node(worker, allow_graceful=False)
        said, _ = process.communicate(timeout=240)
    finally:
        nodes.shutdown()
    assert process.returncode == 0, said
    content = json.loads((output / "sweep.json").read_text())
    trials = content["trials"]
    assert [trial["state"] for trial in trials] == ["complete", "complete"], said
    assert [trial["steps"] for trial in trials] == [24000, 24000]
    assert sorted(trial["lost"] for trial in trials) == [0, 1]
    assert trials[0]["value"] >= trials[1]["value"]
    again = next(trial for trial in trials if trial["lost"])
    assert f"{again['trial']}: begins again, because its worker was lost: learning_rate" in said
    assert "workers lost: 1; their trials were continued elsewhere" in said
    # continued from its checkpoint, in its own folder
    assert [str(run) for run in output.glob(f"{again['trial']}/runs/*")] == [again["run"]]
    log = (output / again["trial"] / "output.log").read_text()
    assert re.search(r"continuing after \d+ steps from ", log)
    best = trials[0]
    assert f"best: {best['run']}\n  --set '{RATE}={best['fields'][RATE]}'\n" in said
    assert RunFolder.open(Path(best["run"])).checkpoints()
    assert not list(output.rglob("*.pkl"))


def test_ctrl_c_stops_the_trials_which_save(tmp_path: Path) -> None:
    path = write_training(tmp_path, total_timesteps=100_000_000)
    output = tmp_path / "sweep"
    process = sweep(
        *(str(path), "--set", f"{RATE}=loguniform(0.0001,0.01)", "--trials", "8", "--workers", "1"),
        *("--ray", "local", "--output", str(output)),
    )
    wait_until(lambda: any(found.stat().st_size for found in output.glob("*/runs/*/metrics.jsonl")), process)
    os.killpg(process.pid, signal.SIGINT)
    said, _ = process.communicate(timeout=120)
    assert process.returncode == 130, said
    assert re.search(r"^00000 .* interrupted$", said, re.MULTILINE), said
    assert said.rstrip().endswith("interrupted: the trials above keep their last checkpoints"), said
    assert "stopping: the trials save their last checkpoints (Ctrl-C again ends the wait)\n" in said
    assert "Traceback" not in said
    (run,) = output.glob("00000/runs/*")
    until_s = time.monotonic() + 20
    while processes_of(output) and time.monotonic() < until_s:
        time.sleep(0.1)
    assert processes_of(output) == []
    assert RunFolder(run).checkpoints()
    assert not (output / ".tune").exists()


def ended(**shared: Any) -> list[str]:
    """Runs a trial until it fails; returns what it says."""
    from joshua_ray.trial import Trial  # imports Ray, which reads variables of ray_nodes

    common = {"block": "ai.training.rl_config", "fixed": ()}
    trial = Trial({"sweep": common | shared, RATE: 0.001})
    rows = [trial.step()]
    while not rows[-1].get("done"):
        rows.append(trial.step())
    trial.cleanup()
    assert rows[-1]["ended"] == FAILED
    said: list[str] = rows[-1]["error"].splitlines()
    return said


def test_a_trial_says_why_its_run_failed(tmp_path: Path) -> None:
    first, *others = ended(
        file=str(tmp_path / "missing.pbtxt"), folder=str(tmp_path), metric="episode/return", complete=()
    )
    assert first.startswith("it ended with exit code 2 (")
    assert "missing.pbtxt" in "\n".join(others)


def test_a_trial_without_the_metric_ends_as_soon_as_it_could_have_it(tmp_path: Path) -> None:
    path = write_training(tmp_path, total_timesteps=100_000_000)
    first, *_ = ended(
        file=str(path), folder=str(tmp_path), metric="episode/retrun", complete=COMPLETE["METHOD_RL"]
    )
    assert first.startswith("its metrics have no episode/retrun: choose --metric from episode/return, ")
    assert processes_of(tmp_path) == []
