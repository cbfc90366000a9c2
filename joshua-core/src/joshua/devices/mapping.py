"""From a leader's joints to a follower's: the same fraction of each one's own range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from joshua.plan.joints import JointRange


@dataclass(frozen=True)
class MappedJoint:
    """One pair of joints: the follower moves through its range as the leader moves through its own."""

    leader: str
    follower: str
    leader_min_rad: float
    leader_max_rad: float
    follower_min_rad: float
    follower_max_rad: float

    def position_rad(self, leader_rad: float) -> float:
        """The follower's position for one of the leader's; beyond the leader's range it stays at the end."""
        fraction = (leader_rad - self.leader_min_rad) / (self.leader_max_rad - self.leader_min_rad)
        # written so that a value that is not a number stays one, and is refused later
        fraction = 0.0 if fraction < 0.0 else 1.0 if fraction > 1.0 else fraction
        return self.follower_min_rad + fraction * (self.follower_max_rad - self.follower_min_rad)


class LeaderMapping:
    """Maps the joint positions of a leader to those of a follower.

    Joints are paired by name; those without a partner of the same name are paired in their order.

    Args:
        leader_joints, follower_joints: in joint order.

    Raises:
        ValueError: a joint has no range, or there is no pair; names the joint.
    """

    def __init__(self, leader_joints: Sequence[JointRange], follower_joints: Sequence[JointRange]) -> None:
        leaders = {joint.name: joint for joint in leader_joints}
        followers = {joint.name: joint for joint in follower_joints}
        names = [(name, name) for name in followers if name in leaders]
        names += zip(
            [name for name in leaders if name not in followers],
            [name for name in followers if name not in leaders],
            strict=False,  # an arm with more joints than the other keeps the rest where they are
        )
        if not names:
            raise ValueError("leader and follower have no joint in common: check the calibration of both")
        self.pairs = tuple(_pair(leaders[leader], followers[follower]) for leader, follower in names)
        self._by_leader = {pair.leader: pair for pair in self.pairs}
        self.unpaired_leader = tuple(name for name in leaders if name not in self._by_leader)
        paired = {pair.follower for pair in self.pairs}
        self.unpaired_follower = tuple(name for name in followers if name not in paired)

    def pair(self, leader_joint: str) -> MappedJoint | None:
        """The pair of a leader's joint; None for one without a partner, or of another name."""
        return self._by_leader.get(leader_joint)


def _pair(leader: JointRange, follower: JointRange) -> MappedJoint:
    for role, joint in (("leader", leader), ("follower", follower)):
        if not joint.min_rad < joint.max_rad:
            raise ValueError(
                f"joint {joint.name} of the {role} has no range: {joint.min_rad} to {joint.max_rad} rad; "
                "calibrate it, or set position_min below position_max"
            )
    return MappedJoint(
        leader.name, follower.name, leader.min_rad, leader.max_rad, follower.min_rad, follower.max_rad
    )
