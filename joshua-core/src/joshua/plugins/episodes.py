"""The contract of data sets that are written episode by episode, whoever makes the episodes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


class EpisodeError(Exception):
    """A data set cannot be written; the message says where, why and what to do."""


@dataclass(frozen=True)
class VectorFeature:
    """Numbers of each frame: ``key`` such as ``observation.state``, and the name of each number."""

    key: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class PictureFeature:
    """A picture of each frame: ``key`` such as ``observation.images.top``, and its size in pixels."""

    key: str
    width: int
    height: int


@dataclass(frozen=True)
class DatasetLayout:
    """What a data set holds.

    Attributes:
        folder: of the data set; robot_type: what was recorded.
        fps: frames per second.
        vectors, pictures: what each frame has.
    """

    folder: Path
    robot_type: str
    fps: int
    vectors: tuple[VectorFeature, ...]
    pictures: tuple[PictureFeature, ...] = ()


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
    def add_frame(self, stamp_ns: int, values: Mapping[str, Any]) -> None:
        """Adds a frame to the present episode.

        Args:
            stamp_ns: when it was taken, which need not be on the beat of ``fps``.
            values: by key of the feature: numbers of shape (N,), pictures of shape (H, W, 3), uint8, RGB.

        Raises:
            EpisodeError: a value has another shape, or the disk refuses it.
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
