"""Pause, step, reset and set-state of a simulation, as ROS 2 topics."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any

import mujoco
import numpy as np
from joshua.node.behaviour import NodeContext
from joshua.plan import TopicSpec

from joshua_mujoco_sim.world import World

PAUSE = TopicSpec(name="~/pause", type_name="std_msgs/msg/Bool")
STEP = TopicSpec(name="~/step", type_name="std_msgs/msg/Int32")
RESET = TopicSpec(name="~/reset", type_name="std_msgs/msg/Empty")
SET_STATE = TopicSpec(name="~/set_state", type_name="sensor_msgs/msg/JointState")

#: Most steps of one request: a minute of a 2 ms step.
STEPS_LIMIT = 30_000


class ControlTopics:
    """Obeys the control topics of a simulation (transport threads).

    Args:
        world: what is controlled.
        context: of the node, for subscriptions and the log.
    """

    def __init__(self, world: World, context: NodeContext) -> None:
        self._world = world
        self._log = context.log
        for topic, take in (
            (PAUSE, self._pause),
            (STEP, self._step),
            (RESET, self._reset),
            (SET_STATE, self._set_state),
        ):
            context.subscribe(topic, take)

    def _pause(self, message: Any, received_ns: int) -> None:
        del received_ns
        if message.data:
            self._world.pause()
        else:
            self._world.resume()
        self._say(PAUSE, f"{'paused' if message.data else 'runs on'} at {self._world.physics.time_s:.3f} s")

    def _step(self, message: Any, received_ns: int) -> None:
        del received_ns
        count = int(message.data)
        if not self._world.paused:
            self._refuse(STEP, "the simulation is not paused; pause it first (true on ~/pause)")
        elif not 0 < count <= STEPS_LIMIT:
            self._refuse(STEP, f"{count} steps; ask for 1 to {STEPS_LIMIT}")
        else:
            self._world.step_paused(count)
            self._say(STEP, f"{count} more steps")

    def _reset(self, message: Any, received_ns: int) -> None:
        del message, received_ns
        self._world.reset()
        self._say(RESET, "the model is back at its start")

    def _set_state(self, message: Any, received_ns: int) -> None:
        del received_ns
        world, physics = self._world, self._world.physics
        model = physics.model
        # where one number says where it is
        single = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
        known = {model.joint(i).name: i for i in range(model.njnt) if model.jnt_type[i] in single}
        values = dict(zip(message.name, message.position, strict=False))
        unknown = [name for name in values if name not in known]
        if unknown or not values or not np.isfinite(list(values.values())).all():
            what = "every position must be a finite number"
            if unknown:
                near = get_close_matches(unknown[0], known, n=1, cutoff=0.5)
                what = f"no joint {', '.join(unknown)}" + (f"; did you mean {near[0]}?" if near else "")
            self._refuse(SET_STATE, f"{what}; joints are {', '.join(filter(None, known))}")
            return
        with world.lock:
            for name, value in values.items():
                joint = physics.model.joint(known[name])
                physics.data.qpos[joint.qposadr[0]] = value
                physics.data.qvel[joint.dofadr[0]] = 0.0
            mujoco.mj_forward(physics.model, physics.data)
        self._say(SET_STATE, f"{', '.join(values)} set")

    def _say(self, topic: TopicSpec, text: str) -> None:
        """Answers on /rosout, where ``joshua sim`` listens for the name of its topic."""
        self._log.info("%s: %s", topic.name, text)

    def _refuse(self, topic: TopicSpec, text: str) -> None:
        self._log.warning("%s: %s", topic.name, text)
