"""The interface of data sets that are written episode by episode, from any source."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from joshua.features.feature_set import FeatureSet
from joshua.features.frame import Frame


class EpisodeError(Exception):
    """A data set cannot be written. The message says where, why and what to do."""


@dataclass(frozen=True)
class DatasetLayout:
    """The contents of a data set.

    Attributes:
        folder: of the data set; robot_type: what was recorded.
        fps: frames per second.
        features: of each frame.
        codec: of videos: ``h264``, ``hevc`` or ``av1``.
        pictures: ``video``, ``png`` or ``jpeg``. Layouts that support only videos refuse the others.
        resume: append to an existing data set with the same features.
        identity: further values that appended episodes must share, such as the digest of a calibration, by
        name.
        counters: names of the integers that ``end_episode`` receives for each episode.
    """

    folder: Path
    robot_type: str
    fps: int
    features: FeatureSet
    codec: str = "h264"
    pictures: str = "video"
    resume: bool = False
    identity: Mapping[str, str] = field(default_factory=dict)
    counters: tuple[str, ...] = ()


class EpisodeWriter(ABC):
    """Writes one data set, one episode after the other. Used by one thread at a time.

    An ended episode is safe on the disk, whatever happens afterwards.

    Args:
        layout: the contents of the data set.

    Attributes:
        episodes: number of ended episodes.
    """

    def __init__(self, layout: DatasetLayout) -> None:
        self.layout = layout
        self.episodes = 0

    @abstractmethod
    def open(self) -> None:
        """Create the folder, or append to it. Raises EpisodeError, also if appending is not allowed."""

    @abstractmethod
    def add_frame(self, frame: Frame) -> None:
        """Add a frame to the open episode. Its stamp need not be a multiple of the period of ``fps``.

        Raises:
            EpisodeError: a value is missing or does not match its feature, or writing fails.
        """

    @abstractmethod
    def end_episode(self, task: str, counts: Mapping[str, int] | None = None) -> None:
        """End the open episode, which performs ``task``.

        Args:
            counts: by the names in ``layout.counters``; 0 for those left out.

        Raises:
            EpisodeError: it has no frame, or writing fails.
        """

    @abstractmethod
    def drop_episode(self) -> None:
        """Discard the frames of the open episode."""

    def close(self) -> None:
        """Discard an open episode. Idempotent."""
        self.drop_episode()
