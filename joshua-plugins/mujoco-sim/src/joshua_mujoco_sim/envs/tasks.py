"""The tasks that come with JOSHUA, as data, and the rewards that each can be given by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from joshua_mujoco_sim.envs import ant_terms as ant
from joshua_mujoco_sim.envs import arm_terms as arm
from joshua_mujoco_sim.envs import common_terms as common
from joshua_mujoco_sim.envs.terms import (
    ActionMode,
    ObservationTerm,
    ResetTerm,
    RewardTerm,
    Task,
    TerminationTerm,
)

#: The arm's joints come first in every model that has one.
_ARM = slice(0, 6)

_SERVOS = {"offset": arm.middles, "scale": arm.half_ranges}
_ARM_OBSERVATIONS = (
    ObservationTerm("state", common.columns, {"qpos": _ARM}, "rad", _ARM, **_SERVOS),
    ObservationTerm("velocity", common.velocities, {"qvel": _ARM}, "rad/s", _ARM, scale=2.5),
    ObservationTerm("lead", common.lead, {"qpos": _ARM}, "rad", _ARM, scale=arm.STEP_RAD),
    ObservationTerm("grip", common.site_position, {"site": "gripper"}, "m", offset=arm.workspace, scale=0.15),
    ObservationTerm("last_action", common.last_action),
)

#: What an action of the arm can mean: a change of the goals, or the goals themselves as data sets hold them.
_ARM_ACTIONS = {
    "delta": ActionMode(arm.move_goals),
    "absolute": ActionMode(
        arm.take_goals,
        arm.lowest_goals,
        arm.highest_goals,
        arm.present_goals,
        "rad",
        shown={"last_action": {"unit": "rad", **_SERVOS}, "lead": {"scale": arm.half_ranges}},
    ),
}


def _smooth(action_change: float) -> tuple[RewardTerm, ...]:
    """Return the costs of uneven motion; ``action_change``: weight of that term."""
    return (
        RewardTerm("action_change", common.action_change, action_change),
        RewardTerm("joint_speed", common.joint_speed, -0.0005, {"qvel": _ARM}),
    )


_DIVERGED = TerminationTerm("diverged", common.diverged, failure=True)

#: Randomised physics of the arm, which ``randomise=True`` adds.
ARM_RANDOMISATION = (
    ResetTerm("servo_gain", common.randomise_servos, {"low": 0.8, "high": 1.2}),
    ResetTerm("damping", common.randomise, {"field": "dof_damping", "rows": _ARM, "low": 0.7, "high": 1.3}),
    ResetTerm(
        "dry_friction",
        common.randomise,
        {"field": "dof_frictionloss", "rows": _ARM, "low": 0.5, "high": 1.5},
    ),
    ResetTerm(
        "contact_friction",
        common.randomise,
        {"field": "geom_friction", "columns": 0, "low": 0.7, "high": 1.3},
    ),
)


#: Randomised physics of the ant, which ``randomise=True`` adds.
ANT_RANDOMISATION = (
    ResetTerm(
        "motor_gain", common.randomise, {"field": "actuator_gainprm", "columns": 0, "low": 0.8, "high": 1.2}
    ),
    ResetTerm("damping", common.randomise, {"field": "dof_damping", "low": 0.7, "high": 1.3}),
    ResetTerm(
        "contact_friction",
        common.randomise,
        {"field": "geom_friction", "columns": 0, "low": 0.6, "high": 1.4},
    ),
)


def reach(reward: str = "reach") -> Task:
    """The grip goes to a place in front of the arm. Rewards: ``reach``, ``reach_sparse``."""
    sites = {"first": "gripper", "second": "goal"}
    done = {**sites, "radius_m": arm.REACHED_M}
    rewards = {
        "reach": (
            RewardTerm("approach", arm.closeness, 2.0, {**sites, "scale_m": 0.1}, potential=True),
            RewardTerm("fine_approach", arm.closeness, 2.0, {**sites, "scale_m": 0.02}, potential=True),
            RewardTerm("reached", arm.within_reward, 10.0, done),
            RewardTerm("time", common.alive, -0.02),
            *_smooth(-0.01),
        ),
        "reach_sparse": (RewardTerm("reached", arm.within_reward, 1.0, done),),
    }
    return Task(
        model_path="so_arm100/reach.xml",
        frame_skip=20,
        actions=_ARM_ACTIONS,
        action_size=6,
        observations=(*_ARM_OBSERVATIONS, ObservationTerm("to_goal", arm.offset, sites, "m", scale=0.1)),
        rewards=_choose("reach", rewards, reward),
        terminations=(TerminationTerm("reached", arm.within, done, success=True), _DIVERGED),
        resets=(
            ResetTerm("joints", common.noisy_joints, {"qpos": _ARM, "qvel": _ARM, "position_rad": 0.1}),
            ResetTerm(
                "goal",
                arm.place_goal,
                {"radius_m": (0.16, 0.32), "angle_rad": 1.0, "height_m": (0.04, 0.22)},
            ),
        ),
        max_steps=75,
        camera="front",
        randomisation=ARM_RANDOMISATION,
        objects={"goal": arm.goal_position},
    )


def pick_place(reward: str = "pick_place") -> Task:
    """The cube goes onto the goal, and the jaw lets go. Rewards: ``pick_place``, ``pick_place_sparse``."""
    to_cube = {"first": "gripper", "second": "cube"}
    to_goal = {"first": "cube", "second": "goal"}
    done = {"radius_m": arm.PLACED_M}
    rewards = {
        "pick_place": (
            RewardTerm("near_cube", arm.closeness, 2.0, {**to_cube, "scale_m": 0.1}, potential=True),
            RewardTerm("lifted", arm.lifted, 4.0, {"height_m": 0.05}, potential=True),
            RewardTerm("near_goal", arm.closeness, 8.0, {**to_goal, "scale_m": 0.1}, potential=True),
            RewardTerm("placed", arm.placed_reward, 50.0, done),
            RewardTerm("dropped", arm.dropped_reward, -20.0),
            RewardTerm("time", common.alive, -0.02),
            # a fifth of reaching's: the noise of exploring would cost most of what approaching earns
            *_smooth(-0.002),
        ),
        "pick_place_sparse": (RewardTerm("placed", arm.placed_reward, 1.0, done),),
    }
    sector = {"radius_m": (0.19, 0.27), "angle_rad": 0.8}
    return Task(
        model_path="so_arm100/pick_place.xml",
        frame_skip=20,
        actions=_ARM_ACTIONS,
        action_size=6,
        observations=(
            *_ARM_OBSERVATIONS,
            ObservationTerm("to_cube", arm.offset, to_cube, "m", scale=0.1),
            ObservationTerm("cube_to_goal", arm.offset, to_goal, "m", scale=0.1),
            ObservationTerm("cube_attitude", common.columns, {"qpos": slice(9, 13)}),
        ),
        rewards=_choose("pick_place", rewards, reward),
        terminations=(
            TerminationTerm("placed", arm.placed, done, success=True),
            TerminationTerm("dropped", arm.dropped),
            _DIVERGED,
        ),
        resets=(
            ResetTerm("joints", common.noisy_joints, {"qpos": _ARM, "qvel": _ARM, "position_rad": 0.05}),
            ResetTerm("goal", arm.place_goal, {**sector, "height_m": (0.001, 0.001)}),
            ResetTerm("cube", arm.place_cube, {**sector, "apart_m": 0.07}),
        ),
        max_steps=200,
        camera="front",
        randomisation=ARM_RANDOMISATION,
        objects={"cube": arm.cube_pose, "goal": arm.goal_position},
    )


def ant_forward(reward: str = "forward") -> Task:
    """The ant runs along x, by the physics and rewards of Gymnasium's ``Ant-v5``. Reward: ``forward``."""
    rewards = {
        "forward": (
            RewardTerm("forward", ant.travelled, 1.0, {"step_s": 0.05}, potential=True),
            RewardTerm("healthy", ant.healthy, 1.0),
            RewardTerm("control", common.action_size, -0.5),
            RewardTerm("contact", ant.contact_size, -5e-4),
        ),
    }
    return Task(
        model_path="ant/ant.xml",
        frame_skip=5,
        actions={"torque": ActionMode(ant.motors)},
        action_size=8,
        # not scaled: the numbers are those of Ant-v5
        observations=(
            ObservationTerm("posture", ant.posture),
            ObservationTerm("velocity", common.velocities),
            ObservationTerm("contact_forces", ant.contact_forces),
        ),
        rewards=_choose("ant", rewards, reward),
        terminations=(TerminationTerm("unhealthy", ant.unhealthy),),
        resets=(ResetTerm("noise", ant.start, {"scale": 0.1}),),
        max_steps=1000,
        camera="track",
        keyframe="",
        randomisation=ANT_RANDOMISATION,
        objects={"torso": ant.torso},
        forces=True,
    )


#: Tasks by the id of their environment.
TASKS: dict[str, Callable[..., Task]] = {
    "joshua/SoArm100Reach-v0": reach,
    "joshua/SoArm100PickPlace-v0": pick_place,
    "joshua/Ant-v0": ant_forward,
}


def _choose(task: str, rewards: Mapping[str, tuple[RewardTerm, ...]], name: str) -> tuple[RewardTerm, ...]:
    try:
        return rewards[name]
    except KeyError:
        raise ValueError(f"{task} has no reward function {name!r}: choose {' or '.join(rewards)}") from None
