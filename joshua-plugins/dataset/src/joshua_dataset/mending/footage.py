"""Look at the videos of a damaged data set: which pictures are whole, and which belong to which episode."""

from __future__ import annotations

import contextlib
import errno
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
from joshua.api.files import file_inside, inside, is_system_error, safe_name
from joshua.features import Feature

from joshua_dataset import mp4
from joshua_dataset.decoding import DatasetError, fits
from joshua_dataset.files import cause
from joshua_dataset.mending.evidence import Evidence
from joshua_dataset.pictures import ERRORS

#: Most pictures that are given up, one by one, until the end of a torn video can be decoded.
_MOST_GIVEN_UP = 32


@dataclass(frozen=True)
class Video:
    """One video file.

    Attributes:
        path: of the file; number: in its name.
        declared: pictures that it should have; whole: pictures that can be decoded, from the first one on.
        rate_hz: of its pictures; None if they are not evenly spaced from the time 0 on.
        codec, pixel_format: as ``info.json`` names them, "" for none; has_audio: it has sound, too.
        why: what is wrong with it, "" for nothing.
    """

    path: Path
    number: int
    declared: int
    whole: int
    rate_hz: Fraction | None
    codec: str
    pixel_format: str
    has_audio: bool
    why: str

    def is_as_described(self, fps: int) -> bool:
        """Return whether the file can stay as it is."""
        return not self.why and self.whole == self.declared and self.rate_hz == fps


@dataclass(frozen=True)
class Clip:
    """The pictures of an episode: a part of a video, or a folder of picture files.

    Attributes:
        video: None for a folder; folder: None for a video.
        first: picture in the video; whole: how many of them can be decoded, from the first one on.
        why: what ends them.
    """

    video: Video | None
    folder: Path | None
    first: int
    whole: int
    why: str


def videos(evidence: Evidence, feature: Feature) -> list[Video]:
    """Look at all videos of a camera, in order. Raises OSError of the system."""
    height, width, _ = feature.shape
    return [look(path, number, height, width) for number, path in _files(evidence, feature)]


def size_of(evidence: Evidence, feature: Feature) -> tuple[int, int] | None:
    """Return the height and the width of all videos of a camera; None if they do not agree, or are torn.

    Raises:
        OSError: of the system.
    """
    sizes = set()
    for _, path in _files(evidence, feature):
        try:
            with _opened(path) as source:
                context = source.streams.video[0].codec_context
                sizes.add((int(context.height), int(context.width)))
        except (*ERRORS, IndexError, ValueError, AttributeError) as error:
            if is_system_error(error):
                raise
    return sizes.pop() if len(sizes) == 1 else None


def _files(evidence: Evidence, feature: Feature) -> list[tuple[int, Path]]:
    """Return the videos of a camera with the number in their name, in order."""
    key = re.escape(safe_name(feature.key, "the feature"))
    if evidence.is_v3:
        pattern = re.compile(rf"videos/{key}/chunk-(\d+)/file-(\d+)\.mp4")
    else:
        pattern = re.compile(rf"videos/chunk-(\d+)/{key}/episode_(\d+)\.mp4")
    found = []
    for path in inside(evidence.folder, "videos").rglob("*.mp4"):
        match = pattern.fullmatch(path.relative_to(evidence.folder).as_posix())
        if match is not None:
            found.append((int(match[1]), int(match[2]), path))
    return [(number, file_inside(evidence.folder, path, "the video")) for _, number, path in sorted(found)]


def look(path: Path, number: int, height: int, width: int) -> Video:
    """Decode a video. Raises OSError of the system."""
    found = _look(path, number, height, width, threads="AUTO")
    if found.why:  # with several threads, an error comes before the pictures that precede it
        found = _look(path, number, height, width, threads="NONE")
    return found


def _look(path: Path, number: int, height: int, width: int, *, threads: str) -> Video:
    declared = whole = 0
    codec = pixel_format = ""
    has_audio = False
    times: list[Fraction] = []
    average_hz: Fraction | None = None
    why = ""
    try:
        with _opened(path) as source:
            stream = source.streams.video[0]
            fits(stream, path, height, width)
            codec = str(stream.codec_context.codec.canonical_name)
            pixel_format = str(stream.codec_context.pix_fmt or "")
            has_audio = bool(source.streams.audio)
            declared, average_hz = int(stream.frames), stream.average_rate
            stream.thread_type = threads
            for picture in _pictures(source, stream):
                if (picture.height, picture.width) != (height, width):
                    raise DatasetError(f"picture {whole} has another size")
                if picture.pts is not None and picture.time_base is not None:
                    times.append(picture.pts * picture.time_base)
                whole += 1
    except (*ERRORS, DatasetError, IndexError, ValueError) as error:
        if is_system_error(error):
            raise
        why = f"{path.name}: {' '.join(cause(error).split())}"
    declared = max(declared, whole)
    if not why and whole < declared:
        why = f"{path.name} has {whole} of {declared} pictures"
    rate_hz = average_hz if whole == 1 and times[:1] == [0] else _rate_hz(times, whole)
    return Video(path, number, declared, whole, rate_hz, codec, pixel_format, has_audio, why)


def _pictures(source: Any, stream: Any) -> Iterator[Any]:
    """Yield the pictures of a video up to the first error, with those that wait in the decoder by then.

    Raises:
        OSError, av.FFmpegError: the error.
    """
    for packet in source.demux(stream):
        try:
            yield from packet.decode()
        except ERRORS:
            yield from stream.codec_context.decode(None)
            raise


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a video; of one without an index, the whole fragments. Raises ``ERRORS``."""
    with contextlib.ExitStack() as stack:
        file: Any = stack.enter_context(path.open("rb"))
        try:
            source = stack.enter_context(av.open(file, "r"))
        except av.FFmpegError as error:
            fragments = mp4.fragments(path)
            if is_system_error(error) or fragments.is_complete or not fragments.end:
                raise
            file = stack.enter_context(mp4.opened(path, fragments))
            source = stack.enter_context(av.open(file, "r"))
        yield source


def _rate_hz(times: Sequence[Fraction], count: int) -> Fraction | None:
    if len(times) != count or count < 2 or times[0] != 0:
        return None
    step_s = times[-1] / (count - 1)
    if step_s <= 0:
        return None
    if any(abs(at_s - number * step_s) > step_s / 10 for number, at_s in enumerate(times)):
        return None
    rate = 1 / step_s
    whole = round(rate)
    return Fraction(whole) if abs(rate - whole) < Fraction(whole, 1000) else rate


def placed(
    evidence: Evidence, feature: Feature, found: Sequence[Video], lengths: Mapping[int, int], fps: int
) -> dict[int, Clip]:
    """Return where the pictures of each episode are; an episode is left out if nothing says that.

    Args:
        found: the videos of the camera; lengths: rows that were found of each episode, in order.
        fps: frames per second.
    """
    if not evidence.is_v3:
        return {video.number: _clip(video, 0) for video in found}
    described = {
        number: int(row["length"])
        for number, row in evidence.described.items()
        if isinstance(row.get("length"), int)
    }
    for counted in ({**lengths, **described}, lengths):
        clips = _in_order(found, dict(sorted(counted.items())))
        if clips is not None:
            return clips
    return _as_described(evidence, feature, found, fps)


def _in_order(found: Sequence[Video], lengths: Mapping[int, int]) -> dict[int, Clip] | None:
    """Let the episodes follow each other; None unless they fill the videos exactly."""
    clips: dict[int, Clip] = {}
    waiting = list(found)
    first = 0
    for number, length in lengths.items():
        if waiting and first == waiting[0].declared:
            waiting.pop(0)
            first = 0
        if not waiting or first + length > waiting[0].declared:
            return None
        clips[number] = _clip(waiting[0], first)
        first += length
    is_exact = len(waiting) == 1 and first == waiting[0].declared
    return clips if is_exact else None


def _as_described(evidence: Evidence, feature: Feature, found: Sequence[Video], fps: int) -> dict[int, Clip]:
    clips = {}
    by_place = {_place_of(video.path): video for video in found}
    for number, row in evidence.described.items():
        place = tuple(row.get(f"videos/{feature.key}/{name}") for name in ("chunk_index", "file_index"))
        from_s = row.get(f"videos/{feature.key}/from_timestamp")
        video = next((video for at, video in by_place.items() if at == place), None)
        if video is None or not isinstance(from_s, (int, float)) or not 0 <= from_s < 1e9:
            continue
        clips[number] = _clip(video, round(from_s * fps))
    return clips


def _place_of(path: Path) -> tuple[int, int]:
    """Return the numbers of the chunk and the file of a video in LeRobot's layout v3."""
    return int(path.parent.name.removeprefix("chunk-")), int(path.stem.removeprefix("file-"))


def _clip(video: Video, first: int) -> Clip:
    whole = max(0, video.whole - first)
    return Clip(video, None, first, whole, video.why or f"{video.path.name} has no more pictures")


def mended(video: Video, copied: Video) -> Video:
    """Return a video with the pictures of a copy of it, in the place of the first of its own."""
    return replace(copied, declared=video.declared, why=video.why)


def without_pictures(video: Video) -> Video:
    """Return a video of which nothing can be used."""
    return replace(video, whole=0, why=video.why or f"the pictures of {video.path.name} cannot be timed")


def copy(video: Video, target: Path, most: int, fps: int, height: int, width: int) -> Video:
    """Write the first whole pictures of a video into a new one, without encoding them anew; look at it.

    The new one has one picture for each ``1 / fps``, from the time 0 on. Where pictures depend on later
    ones that are missing, it has some fewer.

    Args:
        most: pictures; fps: frames per second; height, width: of the pictures.

    Raises:
        OSError, av.FFmpegError: the disk refuses it, or the codec.
    """
    made = video
    first = min(most, video.whole)
    for count in range(first, max(0, first - _MOST_GIVEN_UP), -1):
        _copy(video, target, count, fps)
        made = look(target, video.number, height, width)
        if made.is_as_described(fps) or (count == 1 and made.whole == 1):
            return made
    return made


def _copy(video: Video, target: Path, count: int, fps: int) -> None:
    with _opened(video.path) as source, av.open(str(target), "w", format="mp4") as made:
        original = source.streams.video[0]
        stream = made.add_stream_from_template(original, opaque=True)
        packets = []
        for packet in source.demux(original):
            if packet.size and packet.pts is not None:
                packets.append(packet)
            if len(packets) == count:
                break
        shown = {pts: number for number, pts in enumerate(sorted(packet.pts for packet in packets))}
        delay = max((number - shown[packet.pts] for number, packet in enumerate(packets)), default=0)
        for number, packet in enumerate(packets):
            packet.time_base = Fraction(1, fps)
            packet.pts, packet.dts = shown[packet.pts], number - max(0, delay)
            packet.duration = 1
            packet.stream = stream
            made.mux(packet)
    if not mp4.fragments(target).is_complete:  # some writes of FFmpeg fail without a word
        raise OSError(errno.EIO, "the video cannot be written", str(target))
