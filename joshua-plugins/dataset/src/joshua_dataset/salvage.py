"""Read what is whole of an episode that was not ended: its longest prefix of frames that have all parts.

Nothing is removed here. A file that is read becomes part of the data set, or stays where it is; an error of
the system, such as a full disk, ends the attempt and is never taken for damage.
"""

from __future__ import annotations

import errno
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import av
from joshua.api.files import file_inside, inside, is_system_error
from joshua.features import DatasetLayout

from joshua_dataset import mp4
from joshua_dataset.decoding import DatasetError, picture_of
from joshua_dataset.files import Files
from joshua_dataset.open_episode import columns_of, open_folder, pictures_path, whole_rows
from joshua_dataset.pictures import ERRORS, PICTURE_STRIDE
from joshua_dataset.statistics import PictureStatistics, Statistics


@dataclass(frozen=True)
class Salvaged:
    """The whole frames of an episode.

    Attributes:
        length: frames; columns: of their numbers, (N,) or (N, D).
        pictures: statistics by feature; sources: files or folders with the pictures.
        is_damaged: something is unreadable that a kill does not explain, so the files must not be removed.
    """

    length: int
    columns: dict[str, Any] = field(default_factory=dict)
    pictures: dict[str, Statistics] = field(default_factory=dict)
    sources: dict[str, Path] = field(default_factory=dict)
    is_damaged: bool = False


def salvage(layout: DatasetLayout, files: Files | None = None) -> Salvaged:
    """Read the longest whole prefix of the open episode of a data set.

    Raises:
        OSError, av.FFmpegError: the system does not let it be read, or its videos be completed, or a path
            leads out of the data set.
    """
    files = files or Files()
    rows, is_damaged = whole_rows(open_folder(layout.folder))
    parts = [_part(layout, feature.key, files) for feature in layout.features.pictures]
    length = 0 if rows is None else len(rows)
    for part in parts:
        length = min(length, part.most())
    pictures: dict[str, Statistics] = {}
    while length:
        shortest = length
        for part in parts:
            count, pictures[part.key] = part.make(length)
            shortest = min(shortest, count)
        if shortest == length:
            break
        length = shortest
    is_damaged = is_damaged or any(part.is_damaged for part in parts)
    if not length or rows is None:
        return Salvaged(0, is_damaged=is_damaged)
    columns = {name: values[:length] for name, values in columns_of(rows).items()}
    return Salvaged(length, columns, pictures, {part.key: part.source for part in parts}, is_damaged)


class _Part(ABC):
    """The pictures of one feature.

    Attributes:
        key: of the feature; source: file or folder with the pictures after ``make``.
        is_damaged: as of ``Salvaged``.
    """

    def __init__(self, layout: DatasetLayout, key: str) -> None:
        self.key = key
        self.path = pictures_path(layout, key)
        self.source = self.path
        self.is_damaged = False
        self._height, self._width, _ = layout.features[key].shape

    @abstractmethod
    def most(self) -> int:
        """Return the number of pictures that may be whole. Raises OSError of the system."""

    @abstractmethod
    def make(self, length: int) -> tuple[int, Statistics]:
        """Complete a file with the first pictures; return how many are whole, and their statistics.

        Raises:
            OSError, av.FFmpegError: of the system.
        """


class _VideoPart(_Part):
    """A video, of which the whole fragments are copied into an ordinary one."""

    def __init__(self, layout: DatasetLayout, key: str, files: Files) -> None:
        super().__init__(layout, key)
        self._files = files
        file_inside(layout.folder, self.path, "the video")
        self._whole = file_inside(
            layout.folder, self.path.with_name(f"{self.path.name}.whole"), "the video to be completed"
        )
        self._found = mp4.Fragments(False, 0, (0, b""), True)
        self._packets = 0

    def most(self) -> int:
        try:
            self._found = mp4.fragments(self.path)
        except FileNotFoundError:
            return 0
        self.is_damaged = not (self._found.is_torn or self._found.is_complete)
        if not self._found.end:
            return 0
        self._packets = 0
        try:
            with mp4.opened(self.path, self._found) as file, av.open(file, "r") as source:
                for packet in source.demux(video=0):
                    self._packets += packet.size > 0
        except (av.FFmpegError, IndexError):  # FFmpeg reads through Python, whose errors are OSError alone
            self.is_damaged = True
        return self._packets

    def make(self, length: int) -> tuple[int, Statistics]:
        self.source = self.path
        count, found = 0, PictureStatistics()
        if not (self._found.is_complete and self._packets == length):
            try:
                self._copy(length)
            except ERRORS as error:
                if is_system_error(error):
                    raise
                self.is_damaged = True
                return 0, {}
            self.source = self._whole
        try:
            for picture in self._pictures():
                if count == length:
                    break
                if count % PICTURE_STRIDE == 0:
                    found.add(picture)
                count += 1
        except av.FFmpegError:
            pass  # the pictures before are whole
        if count < length:
            self.is_damaged = True
        return count, found.result() if count else {}

    def _pictures(self) -> Iterator[Any]:
        with self.source.open("rb") as file, av.open(file, "r") as source:
            for picture in source.decode(video=0):
                yield picture.to_ndarray(format="rgb24")

    def _copy(self, length: int) -> None:
        """Copy the first pictures into an ordinary video. Raises ``ERRORS``."""
        count = 0
        with (
            mp4.opened(self.path, self._found) as file,
            av.open(file, "r") as source,
            av.open(str(self._whole), "w", format="mp4") as target,
        ):
            stream = target.add_stream_from_template(source.streams.video[0], opaque=True)
            for packet in source.demux(video=0):
                if count == length:
                    break
                if packet.size:
                    packet.stream = stream
                    target.mux(packet)
                    count += 1
        if not mp4.fragments(self._whole).is_complete:  # some writes of FFmpeg fail without a word
            raise OSError(errno.EIO, "the video cannot be completed", str(self._whole))


class _FilesPart(_Part):
    """One file for each picture; those that do not belong to the prefix are set apart beside it."""

    def __init__(self, layout: DatasetLayout, key: str, files: Files) -> None:
        super().__init__(layout, key)
        self._files = files
        folder = open_folder(layout.folder)
        self._folder = layout.folder
        self._unreadable = inside(layout.folder, folder / f"{key}.unreadable")
        self._spare = inside(layout.folder, folder / f"{key}.spare")

    def most(self) -> int:
        if not self.path.is_dir():
            return 0
        there = sorted(self.path.iterdir())
        whole = 0
        for number, path in enumerate(there):
            if path.stem != f"frame-{number:06d}" or self._read(path) is None:
                break
            whole += 1
        self._set_apart(there[whole:], self._unreadable)
        # a kill tears one picture at most
        self.is_damaged = self._unreadable.is_dir() and len(list(self._unreadable.iterdir())) > 1
        return whole

    def make(self, length: int) -> tuple[int, Statistics]:
        there = sorted(self.path.iterdir())
        self._set_apart(there[length:], self._spare)
        found = PictureStatistics()
        for path in there[:length:PICTURE_STRIDE]:
            picture = self._read(path)
            assert picture is not None, f"{path} was read before"
            found.add(picture)
        return length, found.result()

    def _read(self, path: Path) -> Any:
        """Return a picture; None if it is damaged. Raises OSError of the system."""
        data = file_inside(self._folder, path, "the picture").read_bytes()
        try:
            return picture_of(data, path, self._height, self._width)
        except (DatasetError, IndexError, *ERRORS):
            return None

    def _set_apart(self, paths: list[Path], folder: Path) -> None:
        if paths:
            folder.mkdir(exist_ok=True)
        for path in paths:
            self._files.replace(path, folder / path.name)


def _part(layout: DatasetLayout, key: str, files: Files) -> _Part:
    kind = _VideoPart if layout.pictures == "video" else _FilesPart
    return kind(layout, key, files)
