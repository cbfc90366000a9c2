"""Compares the needs of a model with a robot. Each difference names both sides and the remedy."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from joshua.features.feature_set import LEROBOT_SUFFIX, FeatureSet
from joshua.plan.facts import ModelArm
from joshua.plan.feature import ACTION, IMAGES, STATE, Feature
from joshua.plan.joints import JointRange
from joshua.plan.model_needs import ModelNeeds

_RATE_TOLERANCE = 0.01


class Unmet(NamedTuple):
    """One difference. ``field``: of the model's entry, "" for the entry itself."""

    message: str
    remedy: str
    field: str = ""
    allowed: tuple[str, ...] = ()


def unmet(
    needs: ModelNeeds, features: FeatureSet, joints: Sequence[JointRange], rate_hz: float, strategy: str
) -> list[Unmet]:
    """Compares the needs of a model with the robot.

    Args:
        features: of its observations, by the model's keys; joints: those that it commands.
        rate_hz: at which its actions are published; strategy: of the execution.
    """
    source = f" ({needs.source})" if needs.source else ""
    found = list(_features(needs.features or (), features, source))
    if needs.action is not None:
        commanded = Feature.joints(ACTION, tuple(joint.name for joint in joints))
        found += _numbers(needs.action, commanded, source)
    for key, (least, greatest) in needs.ranges.items():
        unit = next((f.unit for f in (*(needs.features or ()), needs.action) if f and f.key == key), "")
        found += _ranges(key, zip(joints, least, greatest, strict=False), unit or "rad", source)
    if needs.rate_hz and abs(rate_hz - needs.rate_hz) > _RATE_TOLERANCE * needs.rate_hz:
        message = f"The model acts {needs.rate_hz:g} times a second{source}, and its node {rate_hz:g} times"
        remedy = f"Set publish_rate_hz: {needs.rate_hz:.4g}"
        found.append(Unmet(message, remedy, "node.publishers[0].publish_rate_hz"))
    if strategy == "REAL_TIME_CHUNKING" and not needs.supports_rtc:
        message = "The model cannot continue a chunk, which REAL_TIME_CHUNKING requires of a flow policy"
        others = ("REPLACE_ON_ARRIVAL", "TEMPORAL_ENSEMBLE", "SYNCHRONOUS")
        found.append(Unmet(message, f"Write strategy: {others[0]}", "execution.strategy", others))
    return found


def as_trained(
    needs: ModelNeeds, features: FeatureSet, joints: Sequence[JointRange]
) -> tuple[FeatureSet, tuple[JointRange, ...]]:
    """Features and joints in the order of a model, where both sides name the same joints.

    Arguments as of ``unmet``. Messages name their joints, so nothing else depends on the order.
    """
    known = (needs.action, *(needs.features or ()))
    order = next((_plain(f.names) for f in known if f and f.names and not f.is_picture), [])
    by_name = {joint.name: joint for joint in joints}
    if sorted(by_name) != sorted(order) or len(by_name) != len(joints):
        return features, tuple(joints)
    found = []
    for feature in features.values():
        own = dict(zip(_plain(feature.names), feature.names, strict=True))
        same = sorted(own) == sorted(order)
        found.append(replace(feature, names=tuple(own[name] for name in order)) if same else feature)
    return FeatureSet(found), tuple(by_name[name] for name in order)


def joined(needs: ModelNeeds, features: FeatureSet, arms: Sequence[ModelArm]) -> FeatureSet:
    """Features with the states of several arms as one, for a model that has one and names its joints."""
    one = next((item for item in needs.features or () if item.key == STATE), None)
    topics = [arm.state for arm in arms]
    parts = [item for item in features.values() if item.topic in topics]
    if one is None or not one.names or STATE in features or not len(parts) == len(arms) > 1:
        return features
    state = Feature.joints(STATE, tuple(name for arm in arms for name in arm.names), unit=parts[0].unit)
    return FeatureSet([state, *(item for item in features.values() if item not in parts)])


def _plain(names: Iterable[str]) -> list[str]:
    return [name.removesuffix(LEROBOT_SUFFIX) for name in names]


def _features(needed: Sequence[Feature], given: FeatureSet, source: str) -> Iterator[Unmet]:
    wanted = {feature.key for feature in needed}
    for feature in needed:
        if feature.key in given:
            compare = _picture if feature.is_picture else _numbers
            yield from compare(feature, given[feature.key], source)
            continue
        same = [f for f in given.values() if f.is_picture is feature.is_picture]
        free = [_short(f.key) for f in same if f.key not in wanted]
        has = ", ".join(f.key for f in same) or "none"
        parts = [f for f in same if f.key.startswith(f"{feature.key}.")]
        if len(parts) > 1:
            arms = ", ".join(f.key.removeprefix(f"{feature.key}.") for f in parts)
            message = (
                f"The model has one {feature.key} for all arms without names of its joints{source}, so it is "
                f"unclear which of them belong to {arms}"
            )
            yield Unmet(message, "Put meta/info.json of its data set beside the weights, which has the names")
            continue
        message = f"The model needs {feature.key}{source}; the robot provides {has}"
        if free:
            remedy = f'Add rename {{ robot: "{free[0]}" model: "{_short(feature.key)}" }} to the model'
        elif feature.is_picture:
            remedy = "Add subscriptions { data_type: IMAGE … } of one more camera to its node"
        else:
            remedy = "Add subscriptions { data_type: JOINT_STATE … } of the arm to its node"
        yield Unmet(message, remedy, "node.subscriptions", tuple(free))


def _short(key: str) -> str:
    return key.removeprefix(IMAGES)


def _picture(needed: Feature, given: Feature, source: str) -> Iterator[Unmet]:
    if any(a and b and a != b for a, b in zip(needed.shape[:2], given.shape[:2], strict=True)):
        height, width = needed.shape[:2]
        message = (
            f"{needed.key}: the model needs {width} × {height} pixels{source}, and {given.topic} "
            f"has {given.shape[1]} × {given.shape[0]}"
        )
        remedy = f"Set width: {width} height: {height} in the camera's block"
        yield Unmet(message, remedy, "node.subscriptions")


def _numbers(needed: Feature, given: Feature, source: str) -> Iterator[Unmet]:
    ours, theirs = _plain(given.names), _plain(needed.names)
    if 0 not in (*needed.shape, *given.shape) and needed.shape != given.shape:
        message = (
            f"{needed.key}: the model has {needed.shape[0]} numbers{source}, and the robot has "
            f"{given.shape[0]}: {', '.join(ours)}"
        )
        yield Unmet(message, "Use weights that were trained on this robot")
    elif ours and theirs and ours != theirs:
        what = "the order differs" if sorted(ours) == sorted(theirs) else "the names differ"
        message = (
            f"{needed.key}: {what}: {', '.join(theirs)} in the model{source}, {', '.join(ours)} on the robot"
        )
        yield Unmet(message, "Give the joints the names of the training: `joshua calibrate`")


def _ranges(
    key: str, trained: Iterable[tuple[JointRange, float, float]], unit: str, source: str
) -> Iterator[Unmet]:
    """Joints whose positions in training lie far outside their range, mostly because of another unit."""
    for joint, least, greatest in trained:
        half = math.degrees(joint.max_rad - joint.min_rad) / 2
        low, high = {
            "rad": (joint.min_rad, joint.max_rad),
            "deg": (math.degrees(joint.min_rad), math.degrees(joint.max_rad)),
            "lerobot_deg": (-half, half),
        }.get(unit, (-100.0, 100.0))
        margin = high - low
        if least < low - margin or greatest > high + margin:
            message = (
                f"{key}: in training {joint.name} went from {least:.4g} to {greatest:.4g}{source}, and this "
                f"robot reaches {low:.4g} to {high:.4g} {unit}"
            )
            yield Unmet(message, "Use the statistics of this robot's data set, or correct the unit")
