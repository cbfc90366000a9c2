"""What became of the trials of a sweep, without Ray."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from joshua_ray.outcomes import COMPLETE, FAILED, INTERRUPTED, STOPPED_EARLY, Record, Sweep


def record(folder: Path, mode: str = "max") -> Record:
    return Record(
        Sweep(
            file="/a/train.pbtxt",
            block="ai.training.rl_config",
            fixed=(),
            folder=str(folder),
            metric="episode/return",
            mode=mode,
            grace=10,
            total=100,
            trials=4,
            seed=0,
            cores=1.0,
            complete=(),
        )
    )


@pytest.mark.parametrize(("mode", "best"), [("max", "00001"), ("min", "00000")])
def test_the_best_trial_is_that_of_the_last_result(tmp_path: Path, mode: str, best: str) -> None:
    found = record(tmp_path, mode)
    for trial, values in (("00000", (9.0, 1.0)), ("00001", (0.0, 5.0))):
        outcome = found.of(trial, {"a.rate": "0.1", "sweep": {}})
        for steps, value in enumerate(values, start=1):
            found.add(outcome, {"episode/return": value, "steps": 48 * steps, "run": f"/runs/{trial}"})
        found.add(outcome, {"run": f"/runs/{trial}", "ended": COMPLETE})
        found.end(outcome)
    chosen = found.best()
    assert chosen is not None
    assert (chosen.trial, chosen.steps, chosen.state, chosen.run) == (best, 96, COMPLETE, f"/runs/{best}")
    assert chosen.fields == {"a.rate": "0.1"}


def test_trials_without_a_result_are_last_and_never_the_best(tmp_path: Path) -> None:
    found = record(tmp_path)
    rows: dict[str, dict[str, Any]] = {
        "00000": {"ended": FAILED, "error": "it ended with exit code 1"},
        "00001": {"episode/return": float("nan"), "steps": 48},
        "00002": {"episode/return": 7.0, "steps": 48, "ended": FAILED, "error": "no space"},
    }
    for trial, row in rows.items():
        found.add(found.of(trial, {}), row)
        found.end(found.of(trial, {}))
    assert found.best() is None
    found.add(found.of("00003", {}), {"episode/return": -3.0, "steps": 48})
    assert [item.trial for item in found.ranked()] == ["00003", "00000", "00001", "00002"]
    assert found.of("00000", {}).error == "it ended with exit code 1"
    assert found.of("00001", {}).state == STOPPED_EARLY
    best = found.best()
    assert best is not None
    assert best.trial == "00003"


def test_what_still_runs_was_interrupted(tmp_path: Path) -> None:
    found = record(tmp_path)
    found.end(found.of("00000", {}))
    assert not found.interrupt()
    found.of("00001", {})
    assert found.interrupt()
    found.write()
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.json"]
    content = json.loads((tmp_path / "sweep.json").read_text())
    assert {item["trial"]: item["state"] for item in content["trials"]} == {
        "00000": STOPPED_EARLY,
        "00001": INTERRUPTED,
    }
    assert content["sweep"]["metric"] == "episode/return"


def test_a_trial_that_is_stopped_after_its_last_row_is_complete(tmp_path: Path) -> None:
    found = record(tmp_path)
    for steps, state in ((99, STOPPED_EARLY), (100, COMPLETE)):
        outcome = found.of(str(steps), {})
        found.add(outcome, {"episode/return": 7.0, "steps": steps})
        found.end(outcome)
        assert outcome.state == state


def test_a_trial_that_tune_gives_up_has_failed(tmp_path: Path) -> None:
    found = record(tmp_path)
    outcome = found.of("00000", {})
    found.add(outcome, {"episode/return": 7.0, "steps": 48})
    found.end(outcome, "its worker was lost")
    assert (outcome.state, outcome.error) == (FAILED, "its worker was lost")
    assert found.best() is None
