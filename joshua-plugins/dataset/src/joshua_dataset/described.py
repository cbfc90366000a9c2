"""Content of a recording: features from the plan's facts and first messages, in the units of the data set."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from joshua.api.nodes import ServiceFacts
from joshua.features import DatasetLayout, EpisodeError, Feature, FeatureSet, Frame, JointUnits, Unit
from joshua.messages import MessageError
from joshua.messages.arrays import array_of

from joshua_dataset.as_messages import CALIBRATION, calibration_text
from joshua_dataset.metadata import ACQUISITION
from joshua_dataset.reader import DatasetError
from joshua_dataset.sampler import COUNTERS
from joshua_dataset.settings import StoreSettings
from joshua_dataset.streams import Stream, picture


class Description:
    """Description and conversion of the frames of a recording.

    Args:
        settings: of the store; facts: observations and actions of the robot; streams: recorded topics.

    Attributes:
        features: of the data set; ``look`` fills in unknown shapes.
    """

    def __init__(self, settings: StoreSettings, facts: ServiceFacts, streams: Collection[Stream]) -> None:
        self._settings, self._facts, self._streams = settings, facts, streams
        self._unit = settings.joint_unit(facts.robot_type)
        self._units = {key: JointUnits.from_ranges(joints) for key, joints in facts.arms.items()}
        self._keys = tuple(stream.feature.key for stream in streams)
        self.features = FeatureSet()
        self.look()

    def look(self) -> None:
        """Take unknown shapes from the newest messages. Raises EpisodeError."""
        acquisition = Feature(ACQUISITION, "int64", (len(self._keys),), self._keys, "ns")
        self.features = FeatureSet([*(self._seen(stream) for stream in self._streams), acquisition])

    def layout(self, *, resume: bool) -> DatasetLayout:
        """Return the layout of the data set."""
        return DatasetLayout(
            folder=Path(self._settings.folder),
            robot_type=self._facts.robot_type,
            fps=self._settings.fps,
            features=self.features,
            codec=self._settings.codec,
            pictures=self._settings.pictures,
            resume=resume,
            identity={
                # an appended episode must share the calibrated ranges, which define the units
                f"{CALIBRATION}{key}": calibration_text(joints)
                for key, joints in self._facts.arms.items()
            },
            counters=COUNTERS,
        )

    def converted(self, frame: Frame) -> Frame:
        """Convert a frame to the units of the data set. Raises MessageError and DatasetError."""
        values = {key: self._value(key, value) for key, value in frame.values.items()}
        values[ACQUISITION] = np.array([frame.stamps_ns[key] for key in self._keys], np.int64)
        return replace(frame, values=values)

    def _value(self, key: str, value: Any) -> Any:
        feature = self.features[key]
        if feature.is_picture:
            return picture(value, feature)
        if key in self._units and self._unit != "rad":
            return self._units[key].from_radians(value, Unit(self._unit))
        return value

    def _seen(self, stream: Stream) -> Feature:
        feature = stream.feature
        if feature.key in self._units and self._unit != "rad":
            return self._units[feature.key].feature(feature, Unit(self._unit))
        if 0 not in feature.shape or stream.newest is None:
            return feature
        try:
            value = (
                picture(stream.newest, feature)
                if feature.is_picture
                else array_of(stream.newest, feature.names)
            )
        except (MessageError, DatasetError) as error:
            raise EpisodeError(f"{feature.topic} cannot be recorded: {error}") from error
        names = feature.names
        if feature.unit and not names:
            names = tuple(getattr(stream.newest, "name", ()))
        return replace(feature, shape=np.shape(value), names=names)
