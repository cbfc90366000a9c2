"""The scripted demonstrators: they do their tasks from random starts, by either kind of action."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from joshua_mujoco_sim.envs import TermEnv, experts, make_environment, recoveries
from joshua_mujoco_sim.envs.arm_terms import PLACED_M
from joshua_mujoco_sim.envs.experts import EXPERTS, OPEN_RAD, PickPlaceExpert
from joshua_mujoco_sim.envs.kinematics import BASE_Y_M, Kinematics
from joshua_mujoco_sim.envs.tasks import pick_place
from joshua_mujoco_sim.model_file import load_model


def successes(name: str, seeds: range, recoveries: float = 0.0, **options: Any) -> int:
    environment = make_environment(name, disable_env_checker=True, **options).unwrapped
    expert: Any = EXPERTS[name](environment, recoveries=recoveries, seed=0)
    done = 0
    for seed in seeds:
        environment.reset(seed=seed)
        expert.scatter(seed)
        expert.reset()
        for _ in range(environment.task.max_steps):
            action = expert.act()
            assert environment.action_space.contains(action)
            _, _, terminated, _, info = environment.step(action)
            if terminated:
                done += info["is_success"]
                break
    return done


@pytest.mark.parametrize("mode", ["delta", "absolute"])
@pytest.mark.parametrize("randomise", [False, True])
def test_reach(mode: str, randomise: bool) -> None:
    assert successes("joshua/SoArm100Reach-v0", range(50), action_mode=mode, randomise=randomise) == 50


@pytest.mark.parametrize(("mode", "randomise"), [("delta", False), ("absolute", True)])
def test_pick_and_place(mode: str, randomise: bool) -> None:
    """100 starts of each kind are in the session `learn`."""
    name = "joshua/SoArm100PickPlace-v0"
    assert successes(name, range(20), action_mode=mode, randomise=randomise) >= 19


def test_noise_makes_other_demonstrations_that_succeed() -> None:
    name = "joshua/SoArm100PickPlace-v0"
    environment = make_environment(name, disable_env_checker=True).unwrapped
    environment.reset(seed=0)
    actions = [EXPERTS[name](environment, noise_rad=0.005, seed=seed).act() for seed in (1, 1, 2)]
    assert np.array_equal(actions[0], actions[1])
    assert not np.array_equal(actions[0], actions[2])


@pytest.mark.parametrize("name", EXPERTS)
def test_recoveries_start_anywhere_and_succeed(name: str) -> None:
    assert successes(name, range(10), recoveries=1.0) >= 9
    environment = make_environment(name, disable_env_checker=True).unwrapped
    half, never = (EXPERTS[name](environment, recoveries=share) for share in (0.5, 0.0))

    def starts(expert: Any) -> list[Any]:
        found = []
        for seed in range(20):
            environment.reset(seed=seed)
            expert.scatter(seed)
            found.append(environment.state.qpos[0, :6].copy())
        return found

    first, again, usual = starts(half), starts(half), starts(never)
    assert np.array_equal(first, again)
    moved = [np.abs(here - there).max() > 0.2 for here, there in zip(first, usual, strict=True)]
    assert 5 <= sum(moved) <= 15


def test_recoveries_begin_with_a_cube_that_was_pushed_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experts, "MISSES", 0.0)
    name = "joshua/SoArm100PickPlace-v0"
    environment = make_environment(name, disable_env_checker=True).unwrapped
    expert: Any = EXPERTS[name](environment, recoveries=1.0)
    pushed, outside, beside = 0, [], 0
    for seed in range(40):
        environment.reset(seed=seed)
        before = environment.state.site("cube")[0].copy()
        expert.scatter(seed)
        cube, goal = environment.state.site("cube")[0], environment.state.site("goal")[0]
        to_goal_m = np.hypot(*(cube - goal)[:2])
        assert to_goal_m > 1.1 * PLACED_M
        pushed += not np.array_equal(cube, before)
        beside += to_goal_m < recoveries.BESIDE_GOAL_M[1]
        from_base_m = np.hypot(cube[0], cube[1] - BASE_Y_M)
        outside.append(not 0.19 <= from_base_m <= 0.27)
    assert 14 <= pushed <= 34
    assert 5 <= sum(outside) < pushed
    assert 5 <= beside < pushed


def test_recoveries_begin_beside_the_cube_and_touch_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experts, "MISSES", 0.0)
    name = "joshua/SoArm100PickPlace-v0"
    environment = make_environment(name, disable_env_checker=True).unwrapped
    expert: Any = EXPERTS[name](environment, recoveries=1.0)
    state, places = environment.state, []
    for seed in range(30):
        environment.reset(seed=seed)
        expert.scatter(seed)
        contact = state.data.contact
        bodies = {
            state.model.body(state.model.geom_bodyid[geom]).name
            for geoms, away in zip(contact.geom, contact.dist, strict=True)
            if away < 0.0
            for geom in geoms
        }
        assert bodies <= {"cube", "world"}
        places.append(state.site("gripper")[0] - state.site("cube")[0])
    beside = [place for place in places if np.hypot(*place[:2]) < recoveries.START_BESIDE_M]
    assert 8 <= len(beside) < 25
    assert min(place[2] for place in beside) < 0.03


def test_recoveries_begin_after_a_grasp_that_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experts, "MISSES", 1.0)
    name = "joshua/SoArm100PickPlace-v0"
    environment = make_environment(name, disable_env_checker=True).unwrapped
    expert: Any = EXPERTS[name](environment, recoveries=1.0)
    state, closing = environment.state, 0
    for seed in range(30):
        environment.reset(seed=seed)
        time_s = state.data.time
        expert.scatter(seed)
        assert state.data.time == time_s  # the clock of a run goes on as if nothing had happened
        beside_m = np.linalg.norm(state.site("gripper")[0] - state.site("cube")[0])
        moves = np.abs(state.qvel[0]).max() > 0.0
        closing += bool(beside_m < 0.06 and state.ctrl[0, 5] < 0.9 * OPEN_RAD and moves)
        again = state.qpos.copy()
        environment.reset(seed=seed)
        expert.scatter(seed)
        assert np.array_equal(again, state.qpos)
    assert 8 <= closing <= 22


def paths(share: float, seeds: range) -> list[Any]:
    """Steps of the cube until the jaws hold it, of each episode: distances, m, and jaw angles, rad."""
    name = "joshua/SoArm100PickPlace-v0"
    environment = make_environment(name, disable_env_checker=True).unwrapped
    expert: Any = EXPERTS[name](environment, recoveries=share)
    state, found = environment.state, []
    for seed in seeds:
        environment.reset(seed=seed)
        expert.scatter(seed)
        expert.reset()
        steps, before = [], state.site("cube")[0].copy()
        for _ in range(environment.task.max_steps):
            _, _, terminated, _, _ = environment.step(expert.act())
            cube = state.site("cube")[0].copy()
            if cube[2] > 0.02 or terminated:
                break
            away = np.linalg.norm(cube - state.site("gripper")[0])
            steps.append((np.hypot(*(cube - before)[:2]), away, state.qpos[0, 5]))
            before = cube
        found.append(np.array(steps))
    return found


def test_recoveries_move_the_cube_while_the_jaws_approach() -> None:
    alone, moved, again = paths(0.0, range(4)), paths(1.0, range(20)), paths(1.0, range(4))
    near_m = recoveries.MOVED_NEAR_M + 0.01
    far = [steps[np.logical_and.accumulate(steps[:, 1] > near_m)] for steps in (*alone, *moved)]
    lengths_m = [float(steps[:, 0].sum()) for steps in far]
    assert max(lengths_m[:4]) < 1e-3
    assert sum(length_m > 0.01 for length_m in lengths_m[4:]) >= 4
    assert max(float(steps[:, 0].max(initial=0.0)) for steps in far) < 0.01  # continuous: 0.2 m/s at 25 Hz
    assert all(np.array_equal(one, other) for one, other in zip(moved, again, strict=False))


def test_recoveries_let_the_cube_slip_and_grasp_it_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experts, "MISSES", 0.0)
    monkeypatch.setattr(recoveries, "MOVED_S", 0.0)
    monkeypatch.setattr(experts, "SLIPS", 0.0)
    firm = paths(1.0, range(10))
    monkeypatch.setattr(experts, "SLIPS", 1.0)
    slipping = paths(1.0, range(10))
    longer = [len(again) - len(once) for again, once in zip(slipping, firm, strict=True)]
    assert sum(steps >= 5 for steps in longer) >= 6
    assert successes("joshua/SoArm100PickPlace-v0", range(10), recoveries=1.0) >= 9


def test_inverse_kinematics_reaches_a_place_with_the_jaws_along_a_line() -> None:
    import mujoco

    model = load_model("so_arm100/pick_place.xml")
    start = model.key("home").qpos[:5]
    target = np.array([0.08, -0.25, 0.03])
    joints = Kinematics(model).solve(start, target, yaw_rad=0.4, rounds=60)
    data = mujoco.MjData(model)
    data.qpos[:5] = joints
    mujoco.mj_kinematics(model, data)
    assert data.site("gripper").xpos == pytest.approx(target, abs=1e-3)
    frame = data.body("Fixed_Jaw").xmat.reshape(3, 3)
    assert -frame[:, 1] == pytest.approx([0, 0, -1], abs=0.02)
    assert abs(frame[:, 0] @ [np.cos(0.4), np.sin(0.4), 0]) > 0.999


def test_the_variant_for_accelerators_can_be_grasped() -> None:
    """One box for each jaw holds the cube, and the few iterations of the solver do not eject it."""
    task = replace(pick_place(), model_path="so_arm100/pick_place_mjx.xml", frame_skip=10)
    environment = TermEnv(lambda: task)
    expert = PickPlaceExpert(environment)
    done = 0
    for seed in range(10):
        environment.reset(seed=seed)
        expert.reset()
        for _ in range(200):
            *_, terminated, _, info = environment.step(expert.act())
            if terminated:
                break
        done += info["is_success"]
    assert done >= 9


def test_the_cube_is_carried_to_the_goal_without_turning_back() -> None:
    name = "joshua/SoArm100PickPlace-v0"
    environment = make_environment(name, action_mode="absolute", disable_env_checker=True).unwrapped
    expert: Any = EXPERTS[name](environment, seed=0)
    turned = 0
    for seed in range(30):
        environment.reset(seed=seed)
        expert.reset()
        errors_m = []
        for _ in range(environment.task.max_steps):
            if environment.step(expert.act())[2]:
                break
            if environment.state.site("cube")[0, 2] > PLACED_M:  # lifted
                errors_m.append((environment.state.site("goal")[0] - environment.state.site("cube")[0])[:2])
        along_m = np.array(errors_m) @ errors_m[0] / np.linalg.norm(errors_m[0])
        turned += bool(along_m.min() < -0.002)
    assert turned <= 1


class Shifted:
    """A state whose cube and goal seem to be elsewhere."""

    def __init__(self, state: Any) -> None:
        self._state = state
        self.by_m = {"cube": np.zeros(3), "goal": np.zeros(3)}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._state, name)

    def site(self, name: str) -> Any:
        return self._state.site(name) + self.by_m.get(name, 0.0)


class Unsure(PickPlaceExpert):
    """Does what a policy learns that cannot tell the places exactly: the median of the goals."""

    def __init__(self, environment: TermEnv, error_m: float) -> None:
        super().__init__(environment)
        self._state: Any = Shifted(self._state)
        self._error_m, self._chances = error_m, np.random.default_rng(0)
        self._bias = self._errors()

    def begin(self) -> None:
        self.reset()
        self._bias = self._errors()

    def _errors(self) -> Any:
        return self._error_m * self._chances.standard_normal((2, 2)) @ np.eye(2, 3)

    def _fetch(self) -> Any:
        return self._median(super()._fetch, "cube", "goal")

    def _carry(self) -> Any:
        return self._median(super()._carry, "goal")  # the jaws hold the cube

    def _median(self, act: Callable[[], Any], *unsure: str) -> Any:
        at, line, goals, lines = self._at, self._line, [], []
        for _ in range(5):
            self._at, self._line = at, line
            seen = dict(zip(("cube", "goal"), self._bias + self._errors(), strict=True))
            self._state.by_m = {name: seen[name] for name in unsure}
            goals.append(act())
            lines.append(self._line)
        self._state.by_m = {}
        self._line = float(np.median(lines))
        return np.median(goals, axis=0)


def test_the_demonstrator_decides_nothing_that_takes_more_precision_than_pictures_have() -> None:
    environment = make_environment(
        "joshua/SoArm100PickPlace-v0", action_mode="absolute", disable_env_checker=True
    ).unwrapped
    expert = Unsure(environment, 0.006)
    succeeded = 0
    for seed in range(8):
        environment.reset(seed=seed)
        expert.begin()
        for _ in range(environment.task.max_steps):
            *_, terminated, _, info = environment.step(expert.act())
            if terminated:
                break
        succeeded += bool(info["is_success"])
    assert succeeded >= 7
