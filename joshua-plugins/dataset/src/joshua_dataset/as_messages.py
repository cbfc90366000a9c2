"""Convert the values of frames to ROS 2 messages, for bags made from data sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from joshua.api import JointRange
from joshua.features import DatasetLayout, Feature, JointUnits, Unit
from joshua.messages import message_class
from joshua.messages.make import header, joint_state

from joshua_dataset.pictures import encoded

#: Name of a data set's entry for the joint ranges that define LeRobot's units.
CALIBRATION = "calibration of "

JOINT_STATE = "sensor_msgs/msg/JointState"

#: Suffix of LeRobot's joint names.
SUFFIX = ".pos"


class Messages:
    """Converter of frames to messages.

    Joint positions become a JointState in radians, pictures a CompressedImage, other numbers a
    Float64MultiArray. Positions in LeRobot's units become a Float64MultiArray, too, if the data set lacks
    the calibration for their conversion.

    Args:
        layout: of the frames.
    """

    def __init__(self, layout: DatasetLayout) -> None:
        self._features = layout.features
        self._units = {key: units_of(layout.identity, key) for key in layout.features}

    def of_frame(self, stamp_ns: int, values: Mapping[str, Any]) -> list[tuple[str, Any]]:
        """Return the topic and message of each feature."""
        return [self._message(feature, values[key], stamp_ns) for key, feature in self._features.items()]

    def _message(self, feature: Feature, value: Any, stamp_ns: int) -> tuple[str, Any]:
        topic = topic_of(feature)
        if feature.is_picture:
            image = message_class("sensor_msgs/msg/CompressedImage")(
                header=header(feature.key, stamp_ns),
                format="jpeg",
                data=np.frombuffer(encoded(value, png=False), np.uint8),
            )
            return topic, image
        numbers = np.asarray(value, np.float64).ravel()
        names = tuple(name.removesuffix(SUFFIX) for name in feature.names)
        if feature.unit in ("rad", "deg") and names:
            return topic, joint_state(
                names, np.radians(numbers) if feature.unit == "deg" else numbers, at_ns=stamp_ns
            )
        units = self._units[feature.key]
        if feature.unit == "lerobot" and units is not None:
            return topic, joint_state(names, units.to_radians(numbers, Unit.LEROBOT), at_ns=stamp_ns)
        dimension = message_class("std_msgs/msg/MultiArrayDimension")
        layout = message_class("std_msgs/msg/MultiArrayLayout")(
            dim=[dimension(label=", ".join(feature.names), size=len(numbers), stride=len(numbers))],
            data_offset=0,
        )
        return topic, message_class("std_msgs/msg/Float64MultiArray")(layout=layout, data=numbers)


def topic_of(feature: Feature) -> str:
    """Return the topic of a feature in messages made from frames."""
    return "/" + feature.key.replace(".", "/") + ("/compressed" if feature.is_picture else "")


def calibration_text(joints: Sequence[JointRange]) -> str:
    """Return joint ranges in the form that a data set stores."""
    return " ".join(f"{joint.name}:{joint.min_rad:.4f}:{joint.max_rad:.4f}" for joint in joints)


def units_of(identity: Mapping[str, str], key: str) -> JointUnits | None:
    """Return the units of a feature from the ranges stored in a data set; None if it stores none."""
    text = identity.get(f"{CALIBRATION}{key}", "")
    try:
        parts = [part.rsplit(":", 2) for part in text.split()]
        joints = [JointRange(name=name, min_rad=float(low), max_rad=float(high)) for name, low, high in parts]
    except ValueError:
        return None
    return JointUnits.from_ranges(joints) if joints else None
