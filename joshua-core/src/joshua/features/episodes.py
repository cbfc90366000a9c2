"""The contract of data sets that are written episode by episode, whoever makes the episodes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

from joshua.features.feature_set import FeatureSet
from joshua.features.frame import Frame


class EpisodeError(Exception):
    """A data set cannot be written; the message says where, why and what to do."""


@dataclass(frozen=True)
class DatasetLayout:
    """What a data set holds.

    Attributes:
        folder: of the data set; robot_type: what was recorded.
        fps: frames per second.
        features: what each frame has.
    """

    folder: Path
    robot_type: str
    fps: int
    features: FeatureSet


class EpisodeWriter(ABC):
    """Writes one data set, one episode after the other. Used by one thread at a time.

    Every episode that has ended is safe on the disk, whatever happens afterwards.

    Args:
        layout: what the data set holds.

    Attributes:
        episodes: how many have ended.
    """

    def __init__(self, layout: DatasetLayout) -> None:
        self.layout = layout
        self.episodes = 0

    @abstractmethod
    def open(self) -> None:
        """Makes the folder. Raises EpisodeError, also where a data set stands there already."""

    @abstractmethod
    def add_frame(self, frame: Frame) -> None:
        """Adds a frame to the present episode; its stamp need not be on the beat of ``fps``.

        Raises:
            EpisodeError: a value is missing or does not fit its feature, or the disk refuses it.
        """

    @abstractmethod
    def end_episode(self, task: str) -> None:
        """Ends the present episode, which shows ``task``. Raises EpisodeError, also without a frame."""

    @abstractmethod
    def drop_episode(self) -> None:
        """Forgets the frames of the present episode."""

    def close(self) -> None:
        """Forgets an episode that has not ended; a second call does nothing."""
        self.drop_episode()
