"""Calibration target of a simulated arm, and the hand that moves its joints.

The physics runs in the calibrating process. Collisions are off: a user would hold the arm clear of the table
and of itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import mujoco
from joshua.api import DeviceError
from joshua.api.calibration import TICKS_PER_TURN, ArmCalibration
from joshua_calibration.hand import hand_paths
from joshua_calibration.target import CalibrationTarget, StoredMotor, TargetMotor
from joshua_calibration.target import Hand as HandMoves

from joshua_mujoco_sim.actuator_group import ActuatorGroup
from joshua_mujoco_sim.calibration import IDENTITY, encoder_ticks, misfits
from joshua_mujoco_sim.hand import Hand
from joshua_mujoco_sim.model_file import ModelError
from joshua_mujoco_sim.physics import FloatArray, Physics
from joshua_mujoco_sim.settings import SimActuatorSettings, SimulationSettings
from joshua_mujoco_sim.world import World, leave_world, shared_world

#: How far the hand turns a joint without stops to either side, so that its ends stay distinct.
REACH_RAD = 2.9


class SimCalibrationTarget(CalibrationTarget):
    """The joints of one arm that turn between two stops; wheels and slides keep the model's zero.

    Args:
        settings: of the actuator; simulation: plain settings of the simulation.
    """

    def __init__(self, settings: SimActuatorSettings, simulation: Mapping[str, Any]) -> None:
        self._settings = settings
        self._simulation = dict(simulation)
        self._places = [i for i, joint in enumerate(settings.joint_ranges) if joint["by_hand"]]
        joints = [settings.joint_ranges[place] for place in self._places]
        self._ranges = [_reach(joint["min_rad"], joint["max_rad"]) for joint in joints]
        self._motors = tuple(
            TargetMotor(
                place + 1,
                joint["name"],
                full_turn=(high - low) < joint["max_rad"] - joint["min_rad"],
                typical_range_ticks=round((high - low) * TICKS_PER_TURN / math.tau),
            )
            for place, joint, (low, high) in zip(self._places, joints, self._ranges, strict=True)
        )
        self._world: World | None = None
        self._group: ActuatorGroup | None = None
        self._hand: Hand | None = None
        self._unhook: Callable[[], None] | None = None

    @property
    def motors(self) -> tuple[TargetMotor, ...]:
        """Motors in actuator order; the id is the actuator's position, from 1."""
        return self._motors

    @property
    def identity(self) -> str:
        """Identity, the same for all simulated arms."""
        return IDENTITY

    @property
    def connected(self) -> bool:
        """Whether the physics is running."""
        return self._world is not None

    def connect(self) -> None:
        """Start the physics, or join that of another arm. Raises DeviceError."""
        if self.connected:
            return
        settings = SimulationSettings.model_validate(self._simulation).world()
        # in real time for the user, independent of the run's factor
        world = shared_world(replace(settings, real_time_factor=1.0))
        try:
            with world.lock:
                physics = world.physics
                physics.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
                names = [self._settings.actuators[place] for place in self._places]
                self._group = physics.group(names)
                self._hand = Hand(physics, self._group)
                self._unhook = world.before_step(self._move)
        except ModelError:
            leave_world(world)
            raise
        self._world = world
        world.start()

    def disconnect(self) -> None:
        """Leave the simulation. Idempotent."""
        world, self._world = self._world, None
        if world is None:
            return
        if self._unhook is not None:
            self._unhook()
        self._group = self._hand = self._unhook = None
        leave_world(world)

    def release(self) -> None:
        """Release the joints; the drives only brake."""
        world, _, hand = self._joined("release")
        with world.lock:
            hand.let_go(world.physics)

    def raw_positions(self) -> tuple[int, ...]:
        """Encoder positions in joint order."""
        positions = self._positions("raw_positions")
        if self._hand is not None:
            self._hand.looked_at()
        return tuple(encoder_ticks(float(angle)) for angle in positions)

    def stored(self) -> tuple[StoredMotor, ...] | None:
        """Return None: simulated motors store nothing, so only the file contains the calibration."""
        return None

    def store(self, motor_id: int, values: StoredMotor) -> None:
        """Do nothing: the model cannot store it."""

    @property
    def hand(self) -> HandMoves:
        """Return the hand that moves the joints in place of the user."""
        return self._guide

    def misfits(self, calibration: ArmCalibration) -> Sequence[str]:
        """Return joints that the model does not have, and ranges beyond its own."""
        return tuple(misfits(self._settings.joint_ranges, calibration))

    def _guide(self, joint: int | None, seconds: float) -> bool:
        world, group, hand = self._joined("hand")
        with world.lock:
            present = [float(angle) for angle in group.position_rad]
            hand.follow(hand_paths(joint, present, self._ranges, seconds))
        return True

    def _positions(self, verb: str) -> FloatArray:
        world, group, _ = self._joined(verb)
        with world.lock:
            if world.failure:
                raise DeviceError(world.failure)
            return group.position_rad

    def _move(self, physics: Physics) -> None:
        """Apply the drives' brakes and the hand's forces (before each step, under the lock)."""
        group, hand = self._group, self._hand
        if group is None or hand is None:
            return
        group.brake()
        hand.push(physics)

    def _joined(self, verb: str) -> tuple[World, ActuatorGroup, Hand]:
        if self._world is None or self._group is None or self._hand is None:
            raise DeviceError(f"SimCalibrationTarget.{verb}: the device is not open: call connect first")
        return self._world, self._group, self._hand


def _reach(low: float, high: float) -> tuple[float, float]:
    """Return the range of the hand's motion: up to the stops if they are distinct."""
    middle, half = (low + high) / 2, (high - low) / 2
    return (low, high) if half <= REACH_RAD else (middle - REACH_RAD, middle + REACH_RAD)
