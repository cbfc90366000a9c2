"""Pictures of a data set at the size of the policy's input: decoded once, or while they are read."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import av
import numpy as np
from joshua_dataset.decoding import DatasetError, picture_at
from joshua_dataset.reader import Dataset
from joshua_training.run_folder import RunError

from joshua_imitation.data import Array, Recording
from joshua_imitation.scratch import Scratch

MB = 1 << 20


class PictureStore:
    """Pictures of some frames of one camera, by their number.

    Args:
        recording: whose; key: of the camera; size: (height, width) of the policy's input.
        file: cache of decoded pictures; None decodes each on demand; mode: of the file.
    """

    def __init__(
        self,
        recording: Recording,
        key: str,
        size: tuple[int, int],
        file: Path | None,
        mode: Literal["w+", "r"] = "w+",
    ) -> None:
        self._recording, self._key, self._size = recording, key, size
        self._starts = np.unique(recording.first)
        self._kept: Any = None
        self._has: Array | None = None if recording.stream is None else np.zeros(len(recording), bool)
        if file is not None:
            if mode == "w+":
                _reserve(file, len(recording) * size[0] * size[1] * 3)
            self._kept = np.memmap(
                file, np.uint8, "r+" if mode == "w+" else mode, shape=(len(recording), *size, 3)
            )

    def fill(self, told: Callable[[int], bool]) -> bool:
        """Decode all; ``told`` is called after each episode and returns whether to continue."""
        recording, at = self._recording, 0
        for episode in recording.episodes:
            for picture in _decoded(recording.dataset, episode, self._key):
                self._kept[at] = scaled(picture, self._size)
                at += 1
            if not told(episode.length):
                return False
        if at != len(recording):
            raise RunError(
                f"{recording.dataset.folder} has {len(recording)} frames, but {at} pictures of {self._key}: "
                f"run `joshua dataset check {recording.dataset.folder}`"
            )
        return True

    def get(self, frames: Array) -> Array:
        """Return pictures, (…, H, W, 3) uint8. Raises RunError."""
        if self._kept is not None:
            if self._has is not None:
                for frame in np.unique(frames[~self._has[frames]]):
                    self._kept[frame] = self._one(int(frame))
                    self._has[frame] = True
            return np.asarray(self._kept[frames])
        flat = [self._one(int(frame)) for frame in frames.reshape(-1)]
        return np.stack(flat).reshape(*frames.shape, *self._size, 3)

    def _one(self, frame: int) -> Array:
        number = int(np.searchsorted(self._starts, frame, side="right")) - 1
        recording = self._recording
        where = recording.episodes[number].pictures[self._key]
        if recording.stream is not None:
            where = replace(where, opened=recording.stream.opened)
        height, width, _ = recording.dataset.features[self._key].shape
        try:
            found = picture_at(where, frame - int(self._starts[number]), recording.dataset.fps, height, width)
        except (DatasetError, av.FFmpegError, OSError) as error:
            raise RunError(
                f"{where.path}: {error}: run `joshua dataset check {recording.dataset.folder}`"
            ) from error
        return scaled(found, self._size)


class Album:
    """Pictures of all cameras of a recording.

    Args:
        recording: whose; size: (height, width), None as recorded; room_mb: for decoded ones.
        shared: folder of another process, see below; None if this one decodes, or has a stream of its own.

    Attributes:
        sizes: by key; decoded: whether all are kept decoded; folder: of decoded ones, None without.
        shared: folder that other processes can use: of the decoded pictures, or of the blocks of a stream.
    """

    def __init__(
        self,
        recording: Recording,
        size: tuple[int, int] | None,
        room_mb: int,
        shared: Path | None = None,
    ) -> None:
        features = recording.dataset.features
        self.sizes: dict[str, tuple[int, int]] = {
            key: size or (features[key].shape[0], features[key].shape[1]) for key in recording.pictures
        }
        needed = sum(len(recording) * height * width * 3 for height, width in self.sizes.values())
        self.needed_mb = -(-needed // MB)
        self.decoded = self.needed_mb <= room_mb
        if recording.stream is not None and recording.dataset.pictures != "video":
            raise RunError(
                f"{recording.stream.address} has pictures outside videos, which cannot be streamed: "
                "fetch the data set with `joshua dataset download`"
            )
        if not self.decoded and recording.dataset.pictures != "video":
            raise RunError(
                f"the pictures take {self.needed_mb} MB decoded, and only those of videos can be decoded "
                f"while they are read: set picture_cache_mb: {self.needed_mb}, or a smaller image_width"
            )
        self._stream = recording.stream
        others = shared if self._stream is None else None
        self._scratch = _room(needed) if self.decoded and others is None else None
        self.folder = self._scratch.path if self._scratch is not None else others
        self.shared = self._stream.videos if self._stream is not None else self.folder
        self._stores: dict[str, PictureStore] = {}
        try:
            for index, (key, size) in enumerate(self.sizes.items()):
                file = self.folder / f"{index}.raw" if self.folder is not None else None
                self._stores[key] = PictureStore(recording, key, size, file, "w+" if others is None else "r")
            if self._stream is not None and shared is None:
                self._stream.check_room(
                    episode.pictures[key].path for episode in recording.episodes for key in recording.pictures
                )
        except RunError:
            self.close()
            raise
        self.frames = len(recording) * len(self._stores)

    def fill(self, told: Callable[[int], bool]) -> bool:
        """Decode all if there is room; return False if the run stops. A stream decodes what is wanted."""
        if not self.decoded or self._stream is not None:
            return True
        return all(store.fill(told) for store in self._stores.values())

    def get(self, key: str, frames: Array) -> Array:
        """Return pictures of a camera, (…, H, W, 3) uint8."""
        return self._stores[key].get(frames)

    def close(self) -> None:
        """Removes the decoded pictures, and the copied part of a stream."""
        if self._stream is not None:
            self._stream.close()
        if self._scratch is not None:
            self._stores = {}
            self._scratch.close()


def scaled(picture: Array, size: tuple[int, int]) -> Array:
    """Scale a picture, each pixel the average of those that it covers."""
    if picture.shape[:2] == size:
        return picture
    frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
    return np.asarray(
        frame.reformat(width=size[1], height=size[0], interpolation="AREA").to_ndarray(format="rgb24")
    )


def _reserve(file: Path, size: int) -> None:
    """Reserve space on the disk: writing to a map of a full disk would kill the process. Raises RunError."""
    try:
        with file.open("wb") as opened:
            if size and hasattr(os, "posix_fallocate"):  # not on macOS
                os.posix_fallocate(opened.fileno(), 0, size)
            opened.truncate(size)
    except OSError as error:
        raise RunError(
            f"{file} cannot be written: {error.strerror}: set picture_cache_mb: 0 to decode while reading, "
            "or TMPDIR to another disk"
        ) from error


def _room(needed: int) -> Scratch:
    """Make a folder on a disk with enough space. Raises RunError."""
    scratch = Scratch("joshua-pictures")
    place = scratch.path.parent
    free = shutil.disk_usage(place).free
    if free < needed + 64 * MB:
        scratch.close()
        raise RunError(
            f"the decoded pictures take {-(-needed // MB)} MB, and {place} has {free // MB} MB free: set "
            "picture_cache_mb: 0 to decode while reading, a smaller image_width, or TMPDIR to another disk"
        )
    return scratch


def _decoded(dataset: Dataset, episode: Any, key: str) -> Iterator[Array]:
    try:
        yield from dataset.decoded(episode, key)
    except DatasetError as error:
        raise RunError(f"{error}: run `joshua dataset check {dataset.folder}`") from error
