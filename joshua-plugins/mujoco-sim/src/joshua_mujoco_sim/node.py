"""The simulator's own node: keeps the physics running, publishes the model's joints, mirrors topics."""

from __future__ import annotations

from typing import Any

import numpy as np
from joshua.devices.errors import DeviceError
from joshua.messages.make import joint_state
from joshua.node.behaviour import MessagePublisher, NodeBehaviour, NodeContext
from joshua.plan import TopicSpec

from joshua_mujoco_sim.mirror import Mirror
from joshua_mujoco_sim.model_file import ModelError
from joshua_mujoco_sim.physics import ActuatorGroup
from joshua_mujoco_sim.settings import SimulationSettings
from joshua_mujoco_sim.world import World, leave_world, shared_world

JOINT_STATE = "sensor_msgs/msg/JointState"

#: How often the state of the simulation is looked at.
WATCH_PERIOD_S = 0.5


class SimulatorNode(NodeBehaviour):
    """Runs the physics of a file for as long as the node lives.

    It publishes the joints of all actuators on ``~/joint_states``. With mirror mappings the model follows
    their topics.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._settings: SimulationSettings | None = None
        self._world: World | None = None
        self._group: ActuatorGroup | None = None
        self._publisher: MessagePublisher | None = None
        self._mirror: Mirror | None = None
        self._reported = 0

    def configure(self) -> None:
        """Loads the model and declares the topics. Raises DeviceError."""
        spec = self.context.spec
        settings = SimulationSettings.model_validate(spec.settings)
        try:
            world = shared_world(settings.world())
        except ModelError as error:
            raise DeviceError(str(error)) from error
        self._settings, self._world = settings, world
        with world.lock:
            self._group = world.physics.group(())
        self._publisher = self.context.publisher(
            TopicSpec(name="~/joint_states", type_name=JOINT_STATE, rate_hz=settings.joint_state_rate_hz)
        )
        if settings.mode == "MIRROR":
            self._mirror = Mirror(world, settings.mirror_topic_mappings, self.context)
            self._mirror.subscribe()

    def activate(self) -> None:
        """Lets time run."""
        world, settings = self._running()
        world.start()
        self.context.create_timer(1 / settings.joint_state_rate_hz, self._publish, name="joint states")
        self.context.create_timer(WATCH_PERIOD_S, self._watch, name="watch")

    def cleanup(self) -> None:
        """Ends the physics, unless devices of this process still use it."""
        if self._mirror is not None:
            self.context.log.info("%s", self._mirror.report())
            self._mirror.close()
        world, self._world = self._world, None
        if world is not None:
            self.context.log.info("real-time factor %.3f", world.real_time_factor)
            leave_world(world)

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Whether the simulation kept its pace and did not diverge."""
        if self._world is None:
            return []
        world, settings = self._running()
        factor, wanted = world.real_time_factor, settings.real_time_factor
        rows = [("no divergence", not world.divergences, f"{len(world.divergences)} times")]
        if wanted > 0:
            rows.append(("real-time factor", abs(factor - wanted) <= 0.02 * wanted, f"{factor:.3f}"))
        return rows

    def _publish(self) -> None:
        world, _ = self._running()
        assert self._group is not None
        assert self._publisher is not None
        with world.lock:
            position, velocity, force = (
                self._group.position_rad,
                self._group.velocity_rad_s,
                self._group.torque,
            )
        self._publisher.publish(
            joint_state(
                list(self._group.joints),
                position,
                velocity,
                np.nan_to_num(force),
                frame_id=self.context.spec.frame_id,
                at_ns=self.context.now_ns(),
            )
        )

    def _watch(self) -> None:
        world, _ = self._running()
        for text in world.divergences[self._reported :]:
            self.context.log.error("%s; the model was put back to its start", text)
        self._reported = len(world.divergences)
        if world.failure:
            self.context.fail(world.failure)

    def _running(self) -> tuple[World, Any]:
        if self._world is None or self._settings is None:
            raise RuntimeError(f"{self.context.spec.full_name}: activate came before configure")
        return self._world, self._settings
