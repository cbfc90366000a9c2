"""Ranges of positions: those of joints and tendons, and those that a position drive reaches.

A range is a low and a high end in radians or metres, infinite where the model sets no limit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco

from joshua_mujoco_sim.actuator_kinds import control_of
from joshua_mujoco_sim.transmission import Follower, wrapped_joints

Range = tuple[float, float]

UNLIMITED: Range = (-math.inf, math.inf)


@dataclass(frozen=True)
class Drive:
    """One actuator of a joint.

    Attributes:
        actuator: index in the model.
        length: coefficients of the polynomial, lowest first, that gives the actuator's length by the position
            of the joint.
    """

    actuator: int
    length: tuple[float, ...]


def shared(one: Range, other: Range) -> Range:
    """Return the part that two ranges share; its ends are in the wrong order if there is none."""
    return max(one[0], other[0]), min(one[1], other[1])


def range_of_joint(model: mujoco.MjModel, joint: int, followers: Sequence[Follower]) -> Range:
    """Return the range of a joint, narrowed by the ranges of joints that follow it linearly."""
    limits = _range(model, joint)
    for follower in followers:
        offset, slope, *further = (*follower.position, 0.0, 0.0)[:5]
        if not slope or any(further):
            continue
        ends = [(end - offset) / slope for end in _range(model, follower.joint)]
        narrowed = shared(limits, (min(ends), max(ends)))
        if narrowed[0] < narrowed[1]:
            limits = narrowed
    return limits


def range_of_tendon(model: mujoco.MjModel, tendon: int) -> Range:
    """Return the range of a tendon's length: its own, else the one that the ranges of its joints leave it."""
    if model.tendon_limited[tendon]:
        return float(model.tendon_range[tendon, 0]), float(model.tendon_range[tendon, 1])
    parts = wrapped_joints(model, tendon)
    if not parts:
        return UNLIMITED
    low = high = 0.0
    for joint, coefficient in parts:
        ends = [coefficient * end for end in _range(model, joint)]
        low += min(ends)
        high += max(ends)
    return low, high


def range_of_goals(model: mujoco.MjModel, drive: Drive) -> Range:
    """Return the positions at which a position drive balances within the limits of its control."""
    actuator = drive.actuator
    controls = _controls(model, actuator)
    if controls is None or len(drive.length) != 2:
        return UNLIMITED
    gain, gain_per_length = model.actuator_gainprm[actuator, :2]
    if model.actuator_gaintype[actuator] != mujoco.mjtGain.mjGAIN_AFFINE:
        gain_per_length = 0.0
    bias, bias_per_length = model.actuator_biasprm[actuator, :2]
    offset, slope = drive.length
    goals = []
    for control in controls:
        length = -(gain * control + bias) / (gain_per_length * control + bias_per_length)
        goals.append((float(length) - offset) / slope)
    return min(goals), max(goals)


def _controls(model: mujoco.MjModel, actuator: int) -> Range | None:
    """Return the limits of what multiplies the gain: the control, or the activation that integrates it."""
    if model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_INTEGRATOR:
        low, high = model.actuator_actrange[actuator]
        return (float(low), float(high)) if model.actuator_actlimited[actuator] else None
    control = control_of(model, actuator)
    low, high = model.actuator_ctrlrange[control]
    return (float(low), float(high)) if model.actuator_ctrllimited[control] else None


def _range(model: mujoco.MjModel, joint: int) -> Range:
    if not model.jnt_limited[joint]:
        return UNLIMITED
    return float(model.jnt_range[joint, 0]), float(model.jnt_range[joint, 1])
