"""How the joints of a model move together: by equality constraints, and along tendons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
from numpy.polynomial import Polynomial


@dataclass(frozen=True)
class Coupling:
    """A position as a function of one joint's.

    Attributes:
        root: index of that joint; position: by the root's position, in radians or metres.
    """

    root: int
    position: Polynomial


@dataclass(frozen=True)
class Follower:
    """A joint that moves with another one.

    Attributes:
        joint: index; position: coefficients of its position by the other's, lowest first.
    """

    joint: int
    position: tuple[float, ...]


def single_joints(model: mujoco.MjModel) -> tuple[int, ...]:
    """Return the indices of the joints with one degree of freedom: hinges and slides."""
    single = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    return tuple(index for index in range(model.njnt) if model.jnt_type[index] in single)


def couplings(model: mujoco.MjModel) -> dict[int, Coupling]:
    """Return each hinge and slide as a function of the joint that leads it, which is itself for most.

    Joints that equality constraints couple have one leader: the first one with an actuator from which the
    positions of all others follow, else the first one at all. Without such a joint, each leads itself.
    """
    edges = _edges(model)
    coupled = {joint: Coupling(joint, Polynomial([0.0, 1.0])) for joint in single_joints(model)}
    actuated = _actuated(model)
    for group in _components(edges):
        for leader in sorted(group, key=lambda joint: (joint not in actuated, joint)):
            led = _led_by(leader, edges)
            if set(led) == group:
                coupled |= {joint: Coupling(leader, position) for joint, position in led.items()}
                break
    return coupled


def length_of_tendon(model: mujoco.MjModel, tendon: int, coupled: Mapping[int, Coupling]) -> Coupling | None:
    """Return the length of a fixed tendon by the one joint that its joints follow; None if there is none.

    Args:
        model: the compiled model; tendon: index; coupled: the result of ``couplings``.
    """
    total = Polynomial([0.0])
    roots = set()
    for joint, coefficient in wrapped_joints(model, tendon):
        if coefficient:
            roots.add(coupled[joint].root)
            total += coefficient * coupled[joint].position
    if len(roots) != 1 or not any(total.coef[1:]):
        return None
    return Coupling(roots.pop(), total)


def wrapped_joints(model: mujoco.MjModel, tendon: int) -> list[tuple[int, float]]:
    """Return the joints of a fixed tendon with their coefficients; none for a spatial tendon."""
    first = int(model.tendon_adr[tendon])
    wraps = range(first, first + int(model.tendon_num[tendon]))
    return [
        (int(model.wrap_objid[wrap]), float(model.wrap_prm[wrap]))
        for wrap in wraps
        if model.wrap_type[wrap] == mujoco.mjtWrap.mjWRAP_JOINT
    ]


def _edges(model: mujoco.MjModel) -> dict[tuple[int, int], Polynomial]:
    """Return the position of a joint by another's, for each pair (of, by) that a constraint couples."""
    edges = {}
    for index in range(model.neq):
        of, by = int(model.eq_obj1id[index]), int(model.eq_obj2id[index])
        if model.eq_type[index] != mujoco.mjtEq.mjEQ_JOINT or by < 0 or not model.eq_active0[index]:
            continue
        of_start = float(model.qpos0[model.jnt_qposadr[of]])
        by_start = float(model.qpos0[model.jnt_qposadr[by]])
        coefficients = [float(value) for value in model.eq_data[index, :5]]
        moved = Polynomial([-by_start, 1.0])
        edges[of, by] = (of_start + Polynomial(coefficients)(moved)).trim()
        offset, slope = coefficients[:2]
        if slope and not any(coefficients[2:]):
            edges[by, of] = Polynomial([by_start - (of_start + offset) / slope, 1.0 / slope])
    return edges


def _components(edges: Mapping[tuple[int, int], Polynomial]) -> list[set[int]]:
    """Return the sets of joints that constraints couple, directly or through others."""
    groups: list[set[int]] = []
    for pair in edges:
        touched = [group for group in groups if group & set(pair)]
        groups = [group for group in groups if not group & set(pair)]
        groups.append(set(pair).union(*touched))
    return groups


def _led_by(leader: int, edges: Mapping[tuple[int, int], Polynomial]) -> dict[int, Polynomial]:
    """Return the positions that follow from the leader's."""
    led = {leader: Polynomial([0.0, 1.0])}
    reached = [leader]
    for by in reached:
        for (of, other), position in edges.items():
            if other == by and of not in led:
                led[of] = position(led[by]).trim()
                reached.append(of)
    return led


def _actuated(model: mujoco.MjModel) -> set[int]:
    """Return the joints with an actuator of their own."""
    kinds = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    pairs = zip(model.actuator_trntype, model.actuator_trnid, strict=True)
    return {int(target[0]) for kind, target in pairs if kind in kinds}
