"""The motors on the ports of an emulated hub, in Pybricks' degrees, on the shared mechanics."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from joshua_emulator.joint import TICKS_PER_TURN, Drive, Joint

TICKS_PER_DEGREE = TICKS_PER_TURN / 360
SPIKE_MEDIUM_MOTOR = 48
MOTOR_DEVICES = {38, 46, 47, 48, 49, 65, 75, 76}
SPEED_DEG_S = 1110.0  # of the medium motor
ACCELERATION_DEG_S2 = 4000.0
STALL_TORQUE_MNM = 180.0

OFF = Drive()
POWERED = Drive(
    mode="position",
    speed_limit=SPEED_DEG_S * TICKS_PER_DEGREE,
    acceleration=ACCELERATION_DEG_S2 * TICKS_PER_DEGREE,
)


class EmulatedMotor:
    """One motor; its angle counts turns from the moment at which a program takes it.

    Args:
        angle_deg: of the shaft against its mark, as the absolute encoder sees it.
        device: device id in the firmware.
    """

    def __init__(self, angle_deg: float = 0.0, device: int = SPIKE_MEDIUM_MOTOR) -> None:
        self.device = device
        self.attached = True
        self._joint = Joint(angle_deg * TICKS_PER_DEGREE)
        self._drive = OFF
        self._offset_deg = 0.0

    @property
    def powered(self) -> bool:
        """Whether the motor has torque."""
        return self._drive is not OFF

    @property
    def blocked(self) -> bool:
        """Whether the shaft is blocked."""
        return self._joint.blocked

    @blocked.setter
    def blocked(self, value: bool) -> None:
        self._advance()
        self._joint.blocked = value

    def state(self) -> tuple[int, int, int]:
        """Angle in degrees, speed in degrees a second, load in mN·m."""
        self._advance()
        joint = self._joint
        return (
            round(joint.angle / TICKS_PER_DEGREE - self._offset_deg),
            round(joint.velocity / TICKS_PER_DEGREE),
            round(joint.load * STALL_TORQUE_MNM),
        )

    @property
    def absolute_deg(self) -> float:
        """Angle of the shaft against its mark, -180 to 180."""
        self._advance()
        return (self._joint.angle / TICKS_PER_DEGREE + 180.0) % 360.0 - 180.0

    def take(self) -> None:
        """Reset to the absolute angle, as when a program creates its ``Motor``."""
        self._advance()
        absolute = self.absolute_deg
        self._offset_deg = self._joint.angle / TICKS_PER_DEGREE - absolute

    def stop(self) -> None:
        """Release the shaft."""
        self._set(OFF)

    def hold(self) -> None:
        """Hold the present angle with torque."""
        self._advance()
        self._set(replace(POWERED, target=self._joint.angle))

    def track(self, angle_deg: int) -> None:
        """Move to an angle."""
        self._set(replace(POWERED, target=(angle_deg + self._offset_deg) * TICKS_PER_DEGREE))

    def hand(self, motion: Callable[[float], float] | None) -> None:
        """Move the shaft by hand while torque is off: monotonic seconds to degrees against the mark."""
        self._advance()
        if motion is None:
            self._joint.hand = None
        else:
            self._joint.hand = lambda now_s: motion(now_s) * TICKS_PER_DEGREE

    def _set(self, drive: Drive) -> None:
        self._advance()
        self._drive = drive

    def _advance(self) -> None:
        self._joint.advance(time.monotonic(), self._drive)
