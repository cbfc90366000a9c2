"""Verbs of a simulation's node: pause, resume, step, reset and set state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Annotated

import mujoco
from joshua.api import RefusedError, verb
from numpy.polynomial import Polynomial
from pydantic import Field

from joshua_mujoco_sim.transmission import single_joints
from joshua_mujoco_sim.world import World

#: Largest number of steps per request: one minute at 2 ms per step.
STEPS_LIMIT = 30_000


@dataclass(frozen=True)
class Steps:
    """Number of steps."""

    count: Annotated[int, Field(ge=1, le=STEPS_LIMIT)] = 1


@dataclass(frozen=True)
class State:
    """Positions by joint, in radians or metres."""

    joints: dict[str, float] = field(default_factory=dict)


class Controls:
    """The verbs of a simulation. Some declare motion, because a real arm may follow a simulated one.

    Args:
        world: returns the world, once it is loaded.
    """

    def __init__(self, world: Callable[[], World]) -> None:
        self._world = world

    @verb(moves=False)
    def pause(self) -> str:
        """Pause simulated time."""
        world = self._world()
        world.pause()
        return f"paused at {world.physics.time_s:.3f} s"

    @verb(moves=True)
    def resume(self) -> str:
        """Resume simulated time."""
        world = self._world()
        world.resume()
        return f"resumed at {world.physics.time_s:.3f} s"

    @verb(moves=True)
    def step(self, steps: Steps) -> str:
        """Advance by a number of steps while paused."""
        world = self._world()
        if not world.paused:
            raise RefusedError("the simulation is not paused; pause it first (joshua sim pause)")
        world.step_paused(steps.count)
        return f"advanced by {steps.count} step{'s' * (steps.count > 1)}"

    @verb(moves=True)
    def reset(self) -> str:
        """Reset the model to its start."""
        self._world().reset()
        return "reset"

    @verb(moves=True)
    def set_state(self, state: State) -> str:
        """Set the positions of joints, at rest."""
        world = self._world()
        model, data = world.physics.model, world.physics.data
        known = _joints_by_name(world)
        unknown = [name for name in state.joints if name not in known]
        if unknown or not state.joints:
            what = f"no joint {', '.join(unknown)}" if unknown else "no joint is given"
            near = get_close_matches(unknown[0], known, n=1, cutoff=0.5) if unknown else []
            hint = f"; did you mean {near[0]}?" if near else ""
            listed = dict.fromkeys(model.joint(index).name for index in known.values())
            raise RefusedError(f"{what}{hint}; joints are {', '.join(filter(None, listed)) or 'none'}")
        if bad := list(
            filter(None, (_beyond(model, known[name], state.joints[name]) for name in state.joints))
        ):
            raise RefusedError(f"{'; '.join(bad)}; nothing was set")
        with world.lock:
            followers = {joint.joint: joint.followers for joint in world.physics.drivable_joints()}
            for name, value in state.joints.items():
                joint = model.joint(known[name])
                data.qpos[joint.qposadr[0]] = value
                data.qvel[joint.dofadr[0]] = 0.0
                for follower in followers.get(known[name], ()):
                    data.qpos[model.jnt_qposadr[follower.joint]] = Polynomial(follower.position)(value)
                    data.qvel[model.jnt_dofadr[follower.joint]] = 0.0
            mujoco.mj_forward(model, data)
        return f"set {', '.join(state.joints)}"


def _joints_by_name(world: World) -> dict[str, int]:
    """Return hinges and slides by their names, and those that are driven also by those of their actuators."""
    model = world.physics.model
    driven = {
        name: joint.joint
        for joint in world.physics.drivable_joints()
        for name in joint.names
        if joint.joint >= 0
    }
    own = {model.joint(index).name: index for index in single_joints(model)}
    own.pop("", None)
    return driven | own


def _beyond(model: mujoco.MjModel, joint: int, value: float) -> str:
    """Return why a joint cannot take a position; "" if it can."""
    name, unit = model.joint(joint).name, "rad"
    if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
        unit = "m"
    low, high = model.jnt_range[joint]
    if not model.jnt_limited[joint] or low <= value <= high:
        return ""
    return f"{name}={value:g} is beyond its limits, {low:g} to {high:g} {unit}"
