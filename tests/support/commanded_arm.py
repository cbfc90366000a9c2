"""An arm of one joint that is commanded by messages, without a device."""

from __future__ import annotations

from typing import Any

import numpy as np
from joshua.devices.actuator import JointLimits
from joshua.devices.command_intake import Commanders, CommandIntake
from joshua.devices.goal import GoalGenerator
from joshua.devices.joint_command import CommandReader
from joshua.messages.make import joint_state
from joshua.messages.typestore import message_class
from joshua.node.writers import Writer
from joshua.plan import NodeKind, NodeSpec
from joshua.testing.recording_context import RecordingContext
from stepped_time import SteppedTime


class Arm:
    """The commands of one joint on a clock that the test sets."""

    def __init__(self, clock: SteppedTime, log: Any, commanders: Any, external: Any = ()) -> None:
        self.clock = clock
        self.goals = GoalGenerator(JointLimits(np.full(1, -9.0), np.full(1, 9.0), np.full(1, 50.0)), 0.02)
        self.goals.seed(np.zeros(1))
        self.commanders = Commanders(commanders, external, self.goals, log)
        self.arrived: list[int] = []
        self.fault = ""
        spec = NodeSpec(name="arm", kind=NodeKind.ACTUATOR, behaviour="", implementation="")
        context = RecordingContext(spec)
        self.intake = CommandIntake(
            context, self.goals, self.commanders, self.arrived.append, lambda: self.fault
        )
        self.readers = {topic: CommandReader(topic, ("a",), log) for topic in ("/command", "/pedal")}

    def send(self, publisher: Writer | str, rad: float | None, topic: str = "/command") -> None:
        message = joint_state([], []) if rad is None else joint_state(["a"], [rad])
        self.intake.joint_state(self.readers[topic], message, publisher)

    def play(self, publisher: Writer | str, rad: float, seconds: int) -> None:
        duration = message_class("builtin_interfaces/msg/Duration")(seconds, 0)
        point = message_class("trajectory_msgs/msg/JointTrajectoryPoint")(
            np.array([rad]), np.zeros(0), np.zeros(0), np.zeros(0), duration
        )
        header = joint_state([], []).header
        message = message_class("trajectory_msgs/msg/JointTrajectory")(header, ["a"], [point])
        self.intake.trajectory(self.readers["/command"], message, publisher)

    def step(self, seconds: float = 0.02) -> float:
        """The goal after a time in steps of 20 ms, in which the joints are watched."""
        for _ in range(round(seconds / 0.02)):
            self.clock.sleep(0.02)
            self.commanders.watch(self.clock.monotonic_ns())
            goal = float(self.goals.step(self.clock.monotonic_ns())[0])
        return goal
