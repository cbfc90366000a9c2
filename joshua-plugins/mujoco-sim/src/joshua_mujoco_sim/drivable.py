"""Which joints of a model can be driven to positions, by which of its actuators, and why the others cannot.

A joint of a file is a coordinate of the model with one position in radians or metres: a hinge or slide, or
several of them that equality constraints couple (the fingers of a gripper), or the length of a tendon over
joints that move independently. All actuators that act on it belong to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import mujoco
from numpy.polynomial import Polynomial

from joshua_mujoco_sim.actuator_kinds import (
    JOINT_TRANSMISSIONS,
    KINDS,
    Kind,
    actuator_count,
    actuator_name,
    kind_of,
    output_of,
    reason_against,
)
from joshua_mujoco_sim.position_range import (
    UNLIMITED,
    Drive,
    range_of_goals,
    range_of_joint,
    range_of_tendon,
    shared,
)
from joshua_mujoco_sim.transmission import Coupling, Follower, couplings, length_of_tendon, wrapped_joints
from joshua_mujoco_sim.weak_drives import too_soft

#: Range of a joint without one, to both sides: one turn of a hinge, or this length of a slide.
UNLIMITED_RAD, UNLIMITED_M = math.tau, 1.0

_SPEECH = {
    "position": "position drive",
    "velocity": "velocity drive in a position loop",
    "torque": "motor in a position loop",
}


@dataclass(frozen=True)
class DrivableJoint:
    """One joint of a file.

    Attributes:
        name: for the file and the messages; names: all that mean it, of actuators, joints and tendons.
        unit: ``rad`` or ``m``; low, high: range of the position.
        limited: whether the model limits it; otherwise the range is ``UNLIMITED_RAD`` or ``UNLIMITED_M``.
        kind: command that its drives take; drives: the actuators that move it.
        held: indices of further actuators that act on it, which apply no command.
        joint: index of the joint whose position counts; -1 for a tendon.
        tendon: index of the tendon whose length counts; -1 for a joint.
        followers: joints that move with it.
    """

    name: str
    names: tuple[str, ...]
    unit: Literal["rad", "m"]
    low: float
    high: float
    limited: bool
    kind: Kind
    drives: tuple[Drive, ...]
    held: tuple[int, ...] = ()
    joint: int = -1
    tendon: int = -1
    followers: tuple[Follower, ...] = ()

    @property
    def how(self) -> str:
        """What moves the joint, in words."""
        return _SPEECH[self.kind]


@dataclass(frozen=True)
class Refusal:
    """An actuator that cannot be driven to a position.

    Attributes:
        actuator: its name, else a description; index: in the model; reason: why, a clause about it.
        names: all that mean this actuator.
    """

    actuator: str
    index: int
    reason: str
    names: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.actuator} {self.reason}"


@dataclass(frozen=True)
class Drivables:
    """The joints of a model in the order of its actuators, and the actuators that are none."""

    joints: tuple[DrivableJoint, ...]
    refusals: tuple[Refusal, ...]

    def by_name(self) -> dict[str, DrivableJoint]:
        """Return the joints by every name that means one; of equal names, that of an actuator comes first."""
        return {name: joint for joint in self.joints for name in joint.names}

    def refused(self) -> dict[str, Refusal]:
        """Return the refusals by every name that means one."""
        return {name: refusal for refusal in self.refusals for name in refusal.names}


def drivable_joints(model: mujoco.MjModel) -> tuple[DrivableJoint, ...]:
    """Return the joints that can be driven to positions, in the order of their first actuators."""
    return drivables(model).joints


def refusals(model: mujoco.MjModel) -> tuple[Refusal, ...]:
    """Return the actuators that cannot be driven to a position, each with the reason."""
    return drivables(model).refusals


def must_be_driven_each_step(model: mujoco.MjModel, joint: DrivableJoint) -> bool:
    """Return whether a joint follows a goal only by commands that change from step to step."""
    integrator = mujoco.mjtDyn.mjDYN_INTEGRATOR
    return joint.kind != "position" or any(
        model.actuator_dyntype[drive.actuator] == integrator for drive in joint.drives
    )


def drivables(model: mujoco.MjModel) -> Drivables:
    """Examine every actuator of a model."""
    coupled = couplings(model)
    found: dict[tuple[str, int], list[tuple[Drive, Kind]]] = {}
    refused = []
    for actuator in range(actuator_count(model)):
        reason = reason_against(model, actuator)
        if reason:
            refused.append(_refusal(model, actuator, reason))
            continue
        coordinate, length = _coordinate(model, actuator, coupled)
        drive = Drive(actuator, tuple(float(value) for value in length.coef))
        found.setdefault(coordinate, []).append((drive, kind_of(model, actuator)))
    joints = []
    for (what, index), drives in found.items():
        joint = _joint(model, what, index, drives, coupled)
        if isinstance(joint, str):
            refused += [_refusal(model, drive.actuator, joint) for drive, _ in drives]
        else:
            joints.append(joint)
    helped = _helped(model, joints)
    return Drivables(tuple(_named(model, helped)), tuple(sorted(refused, key=lambda one: one.index)))


def _coordinate(
    model: mujoco.MjModel, actuator: int, coupled: Mapping[int, Coupling]
) -> tuple[tuple[str, int], Polynomial]:
    """Return the coordinate that an actuator moves, and the actuator's length by its position."""
    target = int(model.actuator_trnid[actuator, 0])
    gear = float(model.actuator_gear[output_of(model, actuator), 0])
    if mujoco.mjtTrn(model.actuator_trntype[actuator]) in JOINT_TRANSMISSIONS:
        coupling = coupled[target]
        return ("joint", coupling.root), gear * coupling.position
    length = length_of_tendon(model, target, coupled)
    if length is None:
        return ("tendon", target), Polynomial([0.0, gear])
    return ("joint", length.root), gear * length.position


def _joint(
    model: mujoco.MjModel,
    what: str,
    index: int,
    drives: Sequence[tuple[Drive, Kind]],
    coupled: Mapping[int, Coupling],
) -> DrivableJoint | str:
    """Return a joint without its names, or why its actuators cannot drive it."""
    kind = next(kind for kind in KINDS if any(kind == other for _, other in drives))
    chosen = tuple(drive for drive, other in drives if other == kind)
    followers = _followers(coupled, index) if what == "joint" else ()
    own = range_of_joint(model, index, followers) if what == "joint" else range_of_tendon(model, index)
    reached = UNLIMITED
    if kind == "position":
        for drive in chosen:
            reached = shared(reached, range_of_goals(model, drive))
    low, high = shared(own, reached)
    if low >= high:
        return (
            f"reaches {reached[0]:.4g} to {reached[1]:.4g} within the limits of its control, and what it "
            f"moves has a range of {own[0]:.4g} to {own[1]:.4g}"
        )
    unit = _unit(model, what, index)
    limited = math.isfinite(low) and math.isfinite(high)
    if not limited and what == "tendon" and not wrapped_joints(model, index):
        return "pulls a tendon whose length has no range in the model"
    unlimited = UNLIMITED_RAD if unit == "rad" else UNLIMITED_M
    return DrivableJoint(
        name="",
        names=(),
        unit=unit,
        low=low if limited else -unlimited,
        high=high if limited else unlimited,
        limited=limited,
        kind=kind,
        drives=chosen,
        held=tuple(drive.actuator for drive, other in drives if other != kind),
        joint=index if what == "joint" else -1,
        tendon=index if what == "tendon" else -1,
        followers=followers,
    )


def _helped(model: mujoco.MjModel, joints: Sequence[DrivableJoint]) -> list[DrivableJoint]:
    """Let a position loop drive the joints whose position drives are too soft to hold them."""
    held = [joint for joint in joints if joint.kind == "position"]
    if not held:
        return list(joints)
    soft = [joint for joint, is_soft in zip(held, too_soft(model, held), strict=True) if is_soft]
    return [replace(joint, kind="torque") if joint in soft else joint for joint in joints]


def _followers(coupled: Mapping[int, Coupling], root: int) -> tuple[Follower, ...]:
    return tuple(
        Follower(joint, tuple(float(value) for value in coupling.position.coef))
        for joint, coupling in coupled.items()
        if coupling.root == root and joint != root
    )


def _unit(model: mujoco.MjModel, what: str, index: int) -> Literal["rad", "m"]:
    """Return the unit of a position; a tendon over hinges and slides counts as one over hinges."""
    slide = mujoco.mjtJoint.mjJNT_SLIDE
    joints = [index] if what == "joint" else [joint for joint, _ in wrapped_joints(model, index)]
    return "rad" if any(model.jnt_type[joint] != slide for joint in joints) else "m"


def _named(model: mujoco.MjModel, joints: list[DrivableJoint]) -> Iterator[DrivableJoint]:
    """Give each joint its names: first come those of actuators, then of joints, then of tendons."""
    owners: dict[str, int] = {}
    for names in (_actuator_names, _joint_names, _tendon_names):
        for place, joint in enumerate(joints):
            for name in names(model, joint):
                owners.setdefault(name, place)
    for place, joint in enumerate(joints):
        preferred = [
            *_joint_names(model, joint),
            *_actuator_names(model, joint),
            *_tendon_names(model, joint),
        ]
        if joint.tendon >= 0:
            preferred.reverse()
        own = [name for name in dict.fromkeys(preferred) if owners[name] == place]
        if not own:
            own = [f"actuator_{joint.drives[0].actuator}"]  # others go by its joint's name
            owners[own[0]] = place
        yield replace(joint, name=own[0], names=tuple(own))


def _actuator_names(model: mujoco.MjModel, joint: DrivableJoint) -> list[str]:
    ids = (*(drive.actuator for drive in joint.drives), *joint.held)
    return [name for name in (actuator_name(model, index) for index in ids) if name]


def _joint_names(model: mujoco.MjModel, joint: DrivableJoint) -> list[str]:
    ids = ([joint.joint] if joint.joint >= 0 else []) + [follower.joint for follower in joint.followers]
    return [model.joint(index).name for index in ids if model.joint(index).name]


def _tendon_names(model: mujoco.MjModel, joint: DrivableJoint) -> list[str]:
    ids = [*(drive.actuator for drive in joint.drives), *joint.held]
    tendons = [
        int(model.actuator_trnid[index, 0])
        for index in ids
        if model.actuator_trntype[index] == mujoco.mjtTrn.mjTRN_TENDON
    ]
    return [model.tendon(index).name for index in tendons if model.tendon(index).name]


def _refusal(model: mujoco.MjModel, actuator: int, reason: str) -> Refusal:
    name = actuator_name(model, actuator)
    names = [name] if name else []
    target = int(model.actuator_trnid[actuator, 0])
    if mujoco.mjtTrn(model.actuator_trntype[actuator]) in JOINT_TRANSMISSIONS and model.joint(target).name:
        names.append(model.joint(target).name)
    described = name or (f"the actuator of {names[0]}" if names else f"the actuator number {actuator}")
    return Refusal(described, actuator, reason, tuple(names))
