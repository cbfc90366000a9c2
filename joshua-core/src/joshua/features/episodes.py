"""The contract of data sets that are written episode by episode, whoever makes the episodes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
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
        codec: of videos: ``h264``, ``hevc`` or ``av1``.
        pictures: ``video``, ``png`` or ``jpeg``; layouts that know only videos refuse the others.
        resume: append to a data set that exists and has the same features.
        identity: what an appended episode must share besides, such as the digest of a calibration, by name.
        counters: names of whole numbers that ``end_episode`` gets for each episode.
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
    """Write one data set, one episode after the other. Used by one thread at a time.

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
        """Create the folder, or append to it. Raises EpisodeError, also where it may not be appended to."""

    @abstractmethod
    def add_frame(self, frame: Frame) -> None:
        """Add a frame to the open episode; its stamp need not be on the beat of ``fps``.

        Raises:
            EpisodeError: a value is missing or does not fit its feature, or the disk refuses it.
        """

    @abstractmethod
    def end_episode(self, task: str, counts: Mapping[str, int] | None = None) -> None:
        """End the open episode, which shows ``task``.

        Args:
            counts: by the names in ``layout.counters``; 0 for those that are left out.

        Raises:
            EpisodeError: it has no frame, or the disk refuses it.
        """

    @abstractmethod
    def drop_episode(self) -> None:
        """Discard the frames of the open episode."""

    def close(self) -> None:
        """Discard an episode that has not ended; idempotent."""
        self.drop_episode()
