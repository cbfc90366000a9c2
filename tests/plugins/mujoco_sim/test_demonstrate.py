"""``joshua demonstrate``: a data set of the demonstrator whose actions make the same episodes again."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest
from joshua.cli.main import main
from joshua.tools import CallError
from joshua_mujoco_sim.commands import demonstrate
from joshua_mujoco_sim.envs import make_environment
from joshua_mujoco_sim.envs.experts import AFTER_STEPS, EXPERTS


def test_each_demonstrator_has_a_task() -> None:
    assert set(demonstrate.TASKS) == set(EXPERTS)


def test_recorded_goals_make_the_same_episode_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "reach"
    assert main(["demonstrate", "SoArm100Reach-v0", str(folder), "--episodes", "2", "--noise", "0.01"]) == 0
    assert f"2 episodes in {folder}\n" in capsys.readouterr().out
    table = pq.read_table(folder / "data").to_pydict()
    environment = make_environment(
        "joshua/SoArm100Reach-v0", action_mode="absolute", disable_env_checker=True
    ).unwrapped
    columns = (table[key] for key in ("episode_index", "observation.state", "action"))
    rows = list(zip(*columns, strict=True))
    for episode in (0, 1):
        environment.reset(seed=episode)
        succeeded, earned, ended = [], 0.0, []
        for _, state, action in (row for row in rows if row[0] == episode):
            assert environment.state.qpos[0] == pytest.approx(state, abs=2e-3)
            _, reward, terminated, _, info = environment.step(np.array(action))
            earned += 0.0 if any(ended) else reward
            ended.append(terminated and not any(ended))
            succeeded.append(info["is_success"])
        assert succeeded.index(True) == len(succeeded) - 1 - AFTER_STEPS
        of_episode = np.array([row[0] == episode for row in rows])
        recorded = {key: np.ravel(table[f"next.{key}"])[of_episode] for key in ("success", "done", "reward")}
        assert recorded["success"].tolist() == succeeded
        assert recorded["done"].tolist() == ended
        assert recorded["reward"].sum() == pytest.approx(earned, abs=1e-4)
        assert 9 < earned < 20
    rewards = table["next.reward"]
    assert len(table["info.goal"][0]) == 3
    terms = [key for key in table if key.startswith("info.reward.")]
    assert terms == [f"info.reward.{term.name}" for term in environment.task.rewards]
    total = np.sum([table[key] for key in terms], axis=0)
    assert total == pytest.approx(np.array(rewards), abs=1e-5)


def test_recoveries_begin_where_the_arm_is_and_not_at_home(tmp_path: Path) -> None:
    arguments = ["demonstrate", "SoArm100PickPlace-v0", str(tmp_path / "cube"), "--episodes", "3"]
    assert main([*arguments, "--recoveries", "1"]) == 0
    table = pq.read_table(tmp_path / "cube" / "data").to_pydict()
    columns = (table[key] for key in ("frame_index", "observation.state", "action", "info.cube"))
    firsts = [row[1:] for row in zip(*columns, strict=True) if row[0] == 0]
    home = make_environment("joshua/SoArm100PickPlace-v0").unwrapped.state.model.key("home").qpos
    assert len(firsts) == 3
    assert all(np.abs(np.array(state) - home[:6]).max() > 0.2 for state, _, _ in firsts)
    assert all(np.abs(np.array(state)[:5] - np.array(action)[:5]).max() < 0.3 for state, action, _ in firsts)


def test_what_cannot_be_recorded_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demonstrate", "joshua/Ant-v0", str(tmp_path / "a")]) == 2
    assert "joshua/Ant-v0 has no demonstrator: choose joshua/" in capsys.readouterr().err
    assert main(["demonstrate", "SoArm100Reach-v0", str(tmp_path)]) == 2
    assert f"{tmp_path} exists: name another folder" in capsys.readouterr().err
    assert main(["demonstrate", "SoArm100Reach-v0", str(tmp_path / "b"), "--cameras", "back"]) == 2
    assert "the model has no camera 'back': choose top, front, wrist" in capsys.readouterr().err
    assert main(["demonstrate", "SoArm100Reach-v0", str(tmp_path / "b"), "--height", "48"]) == 2
    assert "--height has no effect without pictures: add --cameras" in capsys.readouterr().err
    assert not (tmp_path / "b").exists()
    with pytest.raises(SystemExit):
        main(["demonstrate", "SoArm100Reach-v0", str(tmp_path / "c"), "--episodes", "0"])
    assert "'0': expected a whole number from 1 on" in capsys.readouterr().err
    for share in ("1.2", "half", "nan"):
        with pytest.raises(SystemExit):
            main(["demonstrate", "SoArm100Reach-v0", str(tmp_path / "c"), "--recoveries", share])
        assert f"{share!r}: expected a share from 0 to 1, such as 0.5" in capsys.readouterr().err


def test_a_run_that_has_just_ended_is_named(tmp_path: Path) -> None:
    system = SimpleNamespace(path=tmp_path / "gone", name="process 1, which runs demos.pbtxt")
    with (
        pytest.raises(CallError, match=r"process 1, which runs demos\.pbtxt, has ended: start it again"),
        demonstrate._alone(system),
    ):
        raise AssertionError("no run is there")
