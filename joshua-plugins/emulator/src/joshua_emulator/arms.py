"""Arms that can be emulated: joints with their names and mechanical ranges, as data.

Ranges are in radians about the middle of the model's joint axis. SO-ARM100: the public MuJoCo model, with a
wrist roll just short of a turn so that it has stops. Koch: different values, so that a mapping between both
is visible.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass

from joshua_emulator.joint import TICKS_PER_TURN

TICKS_PER_RADIAN = TICKS_PER_TURN / math.tau


@dataclass(frozen=True)
class ArmJoint:
    """One joint: its name and its mechanical range in radians."""

    name: str
    low_rad: float
    high_rad: float

    @property
    def half_range_ticks(self) -> float:
        """Half of the mechanical range."""
        return (self.high_rad - self.low_rad) / 2 * TICKS_PER_RADIAN


ARMS = {
    "so_arm100": (
        ArmJoint("shoulder_pan", -2.2, 2.2),
        ArmJoint("shoulder_lift", -3.14158, 0.2),
        ArmJoint("elbow_flex", 0.0, 3.14158),
        ArmJoint("wrist_flex", -2.0, 1.8),
        ArmJoint("wrist_roll", -2.9, 2.9),
        ArmJoint("gripper", -0.2, 2.0),
    ),
    "koch": (
        ArmJoint("shoulder_pan", -1.9, 1.9),
        ArmJoint("shoulder_lift", -1.6, 1.8),
        ArmJoint("elbow_flex", -1.5, 1.7),
        ArmJoint("wrist_flex", -1.8, 1.8),
        ArmJoint("wrist_roll", -2.8, 2.8),
        ArmJoint("gripper", -0.6, 0.6),
    ),
}


def mounted_middle(identity: str, slot: int) -> int:
    """Return the raw encoder tick at the middle of a joint's range.

    Horns are mounted at any angle, so each device has its own value, constant for its identity.
    """
    digest = hashlib.sha256(f"{identity}/{slot}".encode()).digest()
    return 1 + int.from_bytes(digest[:4], "big") % (TICKS_PER_TURN - 1)
