"""Check the headers of the videos, and where the episodes are in them. No picture is decoded here."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
from joshua.api.files import file_inside, inside

from joshua_dataset import mp4
from joshua_dataset.checks.contents import Contents, EpisodeRow, shown
from joshua_dataset.checks.problem import Kind, Problem, of_episodes, repairing
from joshua_dataset.metadata import INFO
from joshua_dataset.reader import Dataset, DatasetError

#: Largest difference of a picture's time from that of its row at which LeRobot takes it, s.
TOLERANCE_S = 1e-4


@dataclass(frozen=True)
class Use:
    """The pictures of an episode in a video.

    Attributes:
        episode: its index; from_s, to_s: its times in the video, ``to_s`` NaN where none is described.
        length: its frames.
    """

    episode: int
    from_s: float
    to_s: float
    length: int


@dataclass
class VideoFile:
    """A video by its header.

    Attributes:
        key: of the feature; path: of the file; uses: by the episodes, in order.
        is_open: the header was read; what follows is empty if not.
        frames: pictures in it, 0 if the header does not tell; rate_hz: of the pictures.
        begin_s: time of the first picture; width, height: of the pictures, pixels.
        codec, pixel_format: names of FFmpeg; has_audio: it has sound, too.
    """

    key: str
    path: Path
    uses: list[Use] = field(default_factory=list)
    is_open: bool = False
    frames: int = 0
    rate_hz: float = 0.0
    begin_s: float = 0.0
    width: int = 0
    height: int = 0
    codec: str = ""
    pixel_format: str = ""
    has_audio: bool = False


@dataclass
class Videos:
    """The videos of a data set that its episodes name.

    Attributes:
        files: that exist; missing: that do not.
        problems: found while reading.
    """

    files: list[VideoFile] = field(default_factory=list)
    missing: list[VideoFile] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)


def read(contents: Contents) -> Videos:
    """Read the headers of the videos that the episodes name; look for their picture files."""
    found = Videos()
    dataset = contents.dataset
    if dataset is None or contents.has_messages:
        return found
    by_path: dict[Path, VideoFile] = {}
    for row in contents.rows:
        for key, path, use in _uses(dataset, row):
            by_path.setdefault(path, VideoFile(key, path)).uses.append(use)
    is_video = dataset.pictures in ("video", "table")
    for path, file in by_path.items():
        if not path.exists():
            found.missing.append(file)
        elif is_video:
            found.files.append(_probed(contents, file, found.problems))
        else:
            found.problems += _pictures(contents, dataset, file)
    found.problems += _missing(contents, found, by_path)
    return found


def _uses(dataset: Dataset, row: EpisodeRow) -> Iterator[tuple[str, Path, Use]]:
    """Yield where the pictures of an episode are, by feature and file."""
    values = row.values
    try:
        episode = dataset.episode_of({"tasks": [], "stats": {}, **values})
    except DatasetError:
        return  # the check of the table of episodes says why
    for key, where in episode.pictures.items():
        if where.path == episode.table or not math.isfinite(where.from_s):
            continue
        told = values.get(f"videos/{key}/to_timestamp", math.nan)
        to_s = float(told) if isinstance(told, int | float) else math.nan
        yield key, where.path, Use(episode.index, where.from_s, to_s, episode.length)


def _probed(contents: Contents, file: VideoFile, problems: list[Problem]) -> VideoFile:
    """Fill in what the header of a video says; add the problem if it cannot be read."""
    path: Any = file.path
    try:
        file_inside(contents.folder, path, "the video")
        with av.open(str(path)) as container:
            stream = container.streams.video[0]
            context = stream.codec_context
            if context is None:
                raise ValueError("its codec is unknown")
            file.frames = stream.frames
            file.rate_hz = float(stream.average_rate or 0)
            if stream.start_time is not None and stream.time_base is not None:
                file.begin_s = float(stream.start_time * stream.time_base)
            file.width, file.height = context.width, context.height
            file.codec = context.codec.canonical_name
            file.pixel_format = str(context.pix_fmt)
            file.has_audio = bool(container.streams.audio)
        if mp4.is_cut(path):
            raise ValueError("it ends before its last picture")
        file.is_open = True
    except (OSError, av.FFmpegError, ValueError, IndexError) as error:
        problem = contents.refused(path, error, Kind.VIDEO_TORN)
        problems.append(of_episodes(problem, (use.episode for use in file.uses)))
    return file


def _pictures(contents: Contents, dataset: Dataset, file: VideoFile) -> Iterator[Problem]:
    """Yield a problem if picture files of an episode are missing."""
    suffix = ".png" if dataset.pictures == "png" else ".jpg"
    try:
        folder = inside(contents.folder, file.path)
        there = {path.name for path in folder.iterdir()}
    except OSError as error:
        yield contents.refused(file.path, error, Kind.PICTURES_MISSING)
        return
    for use in file.uses:
        lost = [i for i in range(use.length) if f"frame-{i:06d}{suffix}" not in there]
        if lost:
            text = f"{contents.name(file.path)} lacks {len(lost)} of {use.length} pictures, first {lost[0]}"
            yield Problem(Kind.PICTURES_MISSING, text, use.episode, remedy=repairing(contents.folder))


def _missing(contents: Contents, found: Videos, by_path: dict[Path, VideoFile]) -> Iterator[Problem]:
    remedy = repairing(contents.folder)
    is_template = found.missing and len(found.missing) == len(by_path)
    if is_template and any((contents.folder / "videos").rglob("*.mp4")):
        text = f"{INFO}: video_path is {shown(contents.info.get('video_path'))}, which names no video"
        yield Problem(Kind.INFO_PATH, text, remedy=remedy)
        return
    for file in found.missing:
        kind = Kind.PICTURES_MISSING if not file.path.suffix else Kind.VIDEO_MISSING
        problem = Problem(kind, f"{contents.name(file.path)} is missing", remedy=remedy)
        yield of_episodes(problem, (use.episode for use in file.uses))


def problems(contents: Contents, videos: Videos, fps: float) -> Iterator[Problem]:
    """Yield where the headers of the videos contradict what is described.

    Args:
        fps: rate at which the episodes were recorded, Hz.
    """
    for file in videos.files:
        yield from _uses_agree(contents, file, fps)
        if file.is_open:
            yield from _picture(contents, file)
            yield from _length(contents, file, fps)


def _picture(contents: Contents, file: VideoFile) -> Iterator[Problem]:
    """Yield problems of the size and the codec."""
    assert contents.dataset is not None
    name, remedy = contents.name(file.path), repairing(contents.folder)
    height, width, _ = contents.dataset.features[file.key].shape
    if (file.height, file.width) != (height, width):
        text = f"{name} has pictures of {file.width} x {file.height}, and {width} x {height} is described"
        problem = Problem(Kind.VIDEO_SIZE, text, remedy=remedy)
        yield of_episodes(problem, (use.episode for use in file.uses))
    described = contents.features[file.key]
    told = described.get("info") or described.get("video_info") or {}
    found = {
        "video.codec": file.codec,
        "video.pix_fmt": file.pixel_format,
        "has_audio": file.has_audio,
        "video.is_depth_map": False,
    }
    for what, value in found.items():
        if told.get(what) in (None, "") or told[what] == value:
            continue
        kind = Kind.VIDEO_CODEC if what == "video.codec" else Kind.INFO_VIDEO
        text = f"{INFO}: {what} of {file.key} is {shown(told[what])}, and {name} has {shown(value)}"
        yield Problem(kind, text, serious=False, remedy=remedy)


def _length(contents: Contents, file: VideoFile, fps: float) -> Iterator[Problem]:
    """Yield a problem if a video has more or fewer pictures than its episodes."""
    if not file.frames or not fps:
        return
    name, remedy = contents.name(file.path), repairing(contents.folder)
    for use in file.uses:
        end = round((use.from_s - file.begin_s) * fps) + use.length
        if end > file.frames:
            there = max(0, use.length - (end - file.frames))
            text = f"{file.key}: {there} pictures, and {use.length} are described ({name})"
            yield Problem(Kind.VIDEO_SHORT, text, use.episode, remedy=remedy)
    ends = [round((use.from_s - file.begin_s) * fps) + use.length for use in file.uses]
    if contents.has_all_rows and ends and file.frames > max(ends):
        text = f"{name} has {file.frames} pictures, and its episodes end after {max(ends)}"
        yield Problem(Kind.VIDEO_LONG, text, serious=False, remedy=remedy)


def _uses_agree(contents: Contents, file: VideoFile, fps: float) -> Iterator[Problem]:
    """Yield where the times of the episodes in a video contradict their lengths, or each other."""
    if not fps:
        return
    name, remedy, half_s = f"videos/{file.key}", repairing(contents.folder), 0.5 / fps
    for use in file.uses:
        length_s = use.length / fps
        if contents.is_v3 and not math.isnan(use.to_s) and abs(use.to_s - use.from_s - length_s) > half_s:
            text = (
                f"{name}: from_timestamp {use.from_s:.4f} and to_timestamp {use.to_s:.4f} contradict "
                f"{use.length} frames ({length_s:.4f} s)"
            )
            yield Problem(Kind.EPISODE_VIDEO, text, use.episode, remedy=remedy)
        steps = (use.from_s - file.begin_s) * fps
        if abs(steps - round(steps)) / fps > TOLERANCE_S:
            text = f"{name}: from_timestamp {use.from_s:.4f} is between two pictures"
            yield Problem(Kind.EPISODE_VIDEO, text, use.episode, remedy=remedy)
    yield from _follow(contents, file, file.uses, fps)


def _follow(contents: Contents, file: VideoFile, uses: Sequence[Use], fps: float) -> Iterator[Problem]:
    # pictures between two episodes are not used, and no command takes them out of a video
    remedy, half_s = repairing(contents.folder), 0.5 / fps
    name = contents.name(file.path)
    if uses and abs(uses[0].from_s - file.begin_s) > half_s:
        text = f"{name} begins at {file.begin_s:.4f} s, and its first episode at {uses[0].from_s:.4f} s"
        yield Problem(Kind.EPISODE_VIDEO, text, uses[0].episode, serious=False)
    for before, after in pairwise(uses):
        end_s = before.from_s + before.length / fps
        if after.from_s < end_s - half_s:
            text = f"{name}: it begins at {after.from_s:.4f} s, before episode {before.episode} ends"
            yield Problem(Kind.EPISODE_VIDEO, text, after.episode, remedy=remedy)
        elif after.from_s > end_s + half_s and contents.has_all_rows:
            text = f"{name}: {after.from_s - end_s:.4f} s before it belong to no episode"
            yield Problem(Kind.EPISODE_VIDEO, text, after.episode, serious=False)


def moments(item: tuple[Path, VideoFile, float]) -> list[Problem]:
    """Compare the time of each picture of a video with that of its row, as LeRobot does.

    Args:
        item: folder of the data set; one of its videos; its frames per second.
    """
    folder, file, fps = item
    try:
        times_s = sorted(_times_s(file.path))
    except (OSError, av.FFmpegError, IndexError) as error:
        text = f"{file.key}: {file.path.relative_to(folder).as_posix()}: {error}"
        return [Problem(Kind.VIDEO_TORN, text, file.uses[0].episode, remedy=repairing(folder))]
    found = []
    for use in file.uses:
        begin = next((i for i, at_s in enumerate(times_s) if at_s > use.from_s - 0.5 / fps), len(times_s))
        own = times_s[begin : begin + use.length]
        wrong = [i for i, at_s in enumerate(own) if abs(at_s - use.from_s - i / fps) > TOLERANCE_S]
        if wrong:
            off_s = own[wrong[0]] - use.from_s - wrong[0] / fps
            text = (
                f"{file.key}: {len(wrong)} pictures are not at the times of their rows; picture "
                f"{wrong[0]} is {off_s:+.4f} s away"
            )
            found.append(Problem(Kind.VIDEO_RATE, text, use.episode, remedy=repairing(folder)))
    return found


def _times_s(path: Path) -> Iterator[float]:
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        for packet in container.demux(stream):
            if packet.pts is not None and stream.time_base is not None:
                yield float(packet.pts * stream.time_base)
