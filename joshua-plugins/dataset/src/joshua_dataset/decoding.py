"""Decode pictures of untrusted data sets: every size is checked before it is used."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt
from joshua.tools import describe_pointer

#: Largest picture that is decoded, pixels.
LARGEST_PICTURE = 8192 * 8192


class DatasetError(Exception):
    """A data set cannot be read; the message says where, what was found and what to do."""


def unreadable(path: Path, error: Exception) -> DatasetError:
    """Return the error of a file that cannot be read; a Git LFS pointer is named as one."""
    pointer = describe_pointer(path)
    if pointer is not None:
        return DatasetError(". ".join(pointer))
    return DatasetError(f"{path} cannot be read: {error}")


@dataclass(frozen=True)
class Pictures:
    """Location of the pictures of one feature in an episode.

    Attributes:
        path: of a video, a folder of picture files, or the table that holds them.
        from_s: time in the video at which the episode begins; frames: pictures of the episode.
        opened: opens a video that is elsewhere, by its path; None for a file.
    """

    path: Path
    from_s: float
    frames: int
    opened: Callable[[Path], Any] | None = None


def picture_of(data: bytes, path: Path, height: int, width: int) -> npt.NDArray[np.uint8]:
    """Decode a picture of a known size. Raises DatasetError and av.FFmpegError."""
    container: Any
    with av.open(io.BytesIO(data)) as container:
        fits(container.streams.video[0], path, height, width)
        for picture in container.decode(video=0):
            return _rgb(picture, path, height, width)
    raise DatasetError(f"{path} does not contain a picture")


def pictures_of_video(where: Pictures, fps: int, height: int, width: int) -> Iterator[npt.NDArray[np.uint8]]:
    """Yield the pictures of an episode in a video. Raises DatasetError and av.FFmpegError."""
    with av.open(str(where.path)) as container:
        stream = container.streams.video[0]
        fits(stream, where.path, height, width)
        stream.thread_type = "AUTO"
        half_s = 0.5 / fps
        if where.from_s > 0 and stream.time_base is not None:
            container.seek(int((where.from_s - half_s) / stream.time_base), stream=stream)
        count = 0
        for picture in container.decode(stream):
            if picture.time is not None and picture.time < where.from_s - half_s:
                continue
            if count == where.frames:
                return
            yield _rgb(picture, where.path, height, width)
            count += 1


def fits(stream: Any, path: Path, height: int, width: int) -> None:
    """Refuse a video whose pictures have another size than is described, or too large a one.

    Raises:
        DatasetError: it must not be decoded.
    """
    if stream.codec_context is None:
        raise DatasetError(f"{path} has pictures of an unknown codec")
    found = (stream.codec_context.height, stream.codec_context.width)
    if height * width > LARGEST_PICTURE:
        raise DatasetError(f"{path} has pictures of {width} x {height}, which are too large to decode")
    if 0 in found:
        raise DatasetError(
            f"{path} has pictures of no size, or too large a one; {width} x {height} is described"
        )
    if found != (height, width):
        raise _other_size(path, found[0], found[1], height, width)
    # a stream can change its size between two pictures; decoders need a few more pixels than they show
    stream.codec_context.options = {"max_pixels": str((height + 256) * (width + 256))}


def _other_size(path: Path, found_height: int, found_width: int, height: int, width: int) -> DatasetError:
    return DatasetError(
        f"{path} has pictures of {found_width} x {found_height}, and {width} x {height} is described"
    )


def _rgb(picture: Any, path: Path, height: int, width: int) -> npt.NDArray[np.uint8]:
    if (picture.height, picture.width) != (height, width):
        raise _other_size(path, picture.height, picture.width, height, width)
    found: npt.NDArray[np.uint8] = picture.to_ndarray(format="rgb24")
    return found


def picture_at(where: Pictures, number: int, fps: int, height: int, width: int) -> npt.NDArray[np.uint8]:
    """Return one picture of an episode in a video, decoded from the preceding key frame.

    Raises DatasetError and av.FFmpegError.
    """
    half_s = 0.5 / fps
    wanted_s = where.from_s + number / fps - half_s
    file = str(where.path) if where.opened is None else where.opened(where.path)
    with av.open(file) as container:
        stream = container.streams.video[0]
        fits(stream, where.path, height, width)
        if wanted_s > 0 and stream.time_base is not None:
            container.seek(int(wanted_s / stream.time_base), stream=stream)
        for picture in container.decode(stream):
            if picture.time is None or picture.time >= wanted_s:
                return _rgb(picture, where.path, height, width)
    raise DatasetError(f"{where.path} ends before picture {number} of the episode")
