"""Operations on data sets, apart from what may go wrong beneath them: kills and disks.

``python data_operations.py NAME FOLDER`` kills an operation before each of its file operations in turn,
see ``killed_steps``.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NoReturn

from damaged_recording import damage, digests
from joshua_dataset import mp4
from joshua_dataset.bag import messages
from joshua_dataset.changes import is_interrupted
from joshua_dataset.export import export
from joshua_dataset.from_messages import message_file
from joshua_dataset.lock import PRIVATE
from joshua_dataset.mcap_writer import McapWriter
from joshua_dataset.open_episode import open_folder
from joshua_dataset.reader import Dataset, DatasetError
from joshua_dataset.recomputing import recompute
from joshua_dataset.repair import is_unfinished, repair
from joshua_dataset.transform import Source, build, delete
from joshua_dataset.writer import DatasetWriter, LeRobotWriter, ParquetWriter
from killed_steps import kill_at_each_step
from small_dataset import TOP, frame, layout

#: Frames of an unfinished episode, and those that are in whole fragments or batches of its files.
RECORDED, WHOLE = 14, 10
LENGTHS = (3, 2)
FOREIGN = ("README.md", "meta/notes.txt", "data/chunk-000/mine.txt")

Content = list[tuple[list[float], int]]


def content(folder: Path) -> Content:
    """The numbers and the count of pictures of each episode, all of which are read."""
    found = Dataset.read(folder)
    result = []
    for episode in found.episode_list():
        pictures = sum(1 for _ in found.decoded(episode, TOP))
        result.append((found.columns(episode)["action"][:, 0].tolist(), pictures))
        assert pictures == episode.length, f"{pictures} pictures, {episode.length} rows"
    assert len(result) == found.episodes
    if not is_interrupted(folder):
        assert found.statistics()["action"]["count"].tolist() == [sum(pictures for _, pictures in result)]
    return result


def add_frames(writer: DatasetWriter, length: int) -> None:
    for number in range(length):
        writer.add_frame(frame(number % 12, 1_000_000_000 + number * 100_000_000))


def expected(*lengths: int) -> Content:
    return [([number % 12 + 0.5 for number in range(length)], length) for length in lengths]


def write(folder: Path, kind: type[DatasetWriter] = LeRobotWriter, **changes: Any) -> None:
    with contextlib.closing(kind(layout(folder, **changes))) as writer:
        writer.open()
        for length in LENGTHS:
            add_frames(writer, length)
            writer.end_episode("wave")
    for name in FOREIGN:
        if (folder / name).parent.is_dir():
            (folder / name).write_text("of a user")


def recording(folder: Path, kind: type[DatasetWriter], **changes: Any) -> DatasetWriter:
    """A writer with an open episode, of which the whole part has reached the files."""
    writer = kind(layout(folder, resume=True, **changes))
    writer.task = "wave"
    writer.open()
    add_frames(writer, RECORDED)
    deadline_s = time.monotonic() + 60
    while not reached(writer):
        assert time.monotonic() < deadline_s, "the frames have not reached the files"
        time.sleep(0.01)
    return writer


def reached(writer: DatasetWriter) -> bool:
    if isinstance(writer, McapWriter):
        writer._bag._file.flush()  # type: ignore[union-attr]
        return True
    if writer.layout.pictures != "video":
        return not writer.waiting and len(list((open_folder(writer.layout.folder) / TOP).iterdir())) > WHOLE
    path = open_folder(writer.layout.folder) / f"{TOP}.mp4"
    data = path.read_bytes()
    return mp4.fragments(path).end > 0 and data.count(b"moof") + data.count(b"moov") >= WHOLE // 5


def killed(act: Callable[[], object]) -> None:
    """Runs in a process that ends without closing anything."""
    child = os.fork()
    if not child:
        try:
            act()
        except BaseException:  # noqa: BLE001 - the exit code says it
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0


class Operation(ABC):
    """One operation, in a folder of its own."""

    #: The disk needs this much beside the base, at most.
    room = 400_000

    @abstractmethod
    def base(self, place: Path) -> None:
        """Make what is there before it."""

    @abstractmethod
    def prepare(self, place: Path) -> Callable[[], object]:
        """Return what is to be interrupted."""

    @abstractmethod
    def again(self, place: Path) -> None:
        """Do what its message or the documentation says, when there is space or after a kill."""

    @abstractmethod
    def look(self, place: Path) -> None:
        """Assert that everything is there after it, and after an interruption and ``again``."""

    def between(self, place: Path) -> None:
        """Assert what holds at any moment in which no process works."""
        readable(place / "set")
        for name in FOREIGN:
            assert (place / "set" / name).read_text() == "of a user", name


def readable(folder: Path) -> None:
    """Assert that a data set is complete, or says which command completes it."""
    try:
        content(folder)
    except DatasetError as error:
        if "joshua dataset repair" not in str(error):
            raise


class Keep(Operation):
    def base(self, place: Path) -> None:
        write(place / "set")

    def prepare(self, place: Path) -> Callable[[], object]:
        self.writer = recording(place / "set", LeRobotWriter)
        return lambda: self.writer.end_episode("wave")

    def again(self, place: Path) -> None:
        if is_unfinished(place / "set"):
            repair(place / "set")

    def look(self, place: Path) -> None:
        found = content(place / "set")
        assert found[:-1] == expected(*LENGTHS)
        assert len(found) == 3
        assert WHOLE <= found[2][1] <= RECORDED
        assert found[2] == expected(found[2][1])[0]


class Repair(Operation):
    """Of a video; of picture files, of which one is not readable; of messages."""

    kind: type[DatasetWriter] = LeRobotWriter
    changes: Mapping[str, Any] = MappingProxyType({})
    least = WHOLE

    def base(self, place: Path) -> None:
        write(place / "set", self.kind, **self.changes)
        killed(lambda: recording(place / "set", self.kind, **self.changes))

    def prepare(self, place: Path) -> Callable[[], object]:
        return lambda: repair(place / "set")

    def again(self, place: Path) -> None:
        assert repair(place / "set")

    def look(self, place: Path) -> None:
        found = content(place / "set")
        assert found[:-1] == expected(*LENGTHS)
        assert len(found) == 3
        assert self.least <= found[2][1]
        assert found[2] == expected(found[2][1])[0]
        assert not is_unfinished(place / "set")


class RepairFiles(Repair):
    kind = ParquetWriter
    changes: Mapping[str, Any] = MappingProxyType({"pictures": "png"})
    least = 6

    def base(self, place: Path) -> None:
        super().base(place)
        damaged = open_folder(place / "set") / TOP / "frame-000006.png"
        damaged.write_bytes(b"\0" * 100)

    def look(self, place: Path) -> None:
        super().look(place)
        aside = place / "set" / PRIVATE / "aside"
        kept = {path.name for path in aside.rglob("frame-*.png")}
        assert {f"frame-{number:06d}.png" for number in range(6, WHOLE)} <= kept
        assert list(aside.rglob("rows.arrows"))


class RepairMessages(Repair):
    kind = McapWriter

    def look(self, place: Path) -> None:
        found = Dataset.read(place / "set")
        lengths = [episode.length for episode in found.episode_list()]
        assert lengths[:2] == [3 * length for length in LENGTHS]
        assert lengths[2] >= 3 * WHOLE

    def between(self, place: Path) -> None:
        assert Dataset.read(place / "set").episodes >= 2


class Delete(Operation):
    def base(self, place: Path) -> None:
        write(place / "set")

    def prepare(self, place: Path) -> Callable[[], object]:
        return lambda: delete(place / "set", [1], workers=1)

    def again(self, place: Path) -> None:
        repair(place / "set")
        if Dataset.read(place / "set").episodes == 2:
            delete(place / "set", [1], workers=1)

    def look(self, place: Path) -> None:
        assert content(place / "set") == expected(3)
        assert not (place / "set" / PRIVATE).exists()


class Make(Operation):
    """Makes data sets from another one, which stays as it is."""

    kept: tuple[int, ...] = LENGTHS

    def base(self, place: Path) -> None:
        write(place / "set")

    def make(self, place: Path) -> object:
        return build([Source(place / "set")], place / "made", codec="h264", table_format="csv", workers=1)

    def prepare(self, place: Path) -> Callable[[], object]:
        return lambda: self.make(place)

    def again(self, place: Path) -> None:
        if is_interrupted(place / "made") or (place / "made" / "meta" / "info.json").exists():
            repair(place / "made")
        if not (place / "made" / "meta" / "info.json").exists():
            self.make(place)

    def between(self, place: Path) -> None:
        super().between(place)
        assert content(place / "set") == expected(*LENGTHS)
        if (place / "made" / "meta" / "info.json").exists():
            assert content(place / "made") == expected(*self.kept)

    def look(self, place: Path) -> None:
        assert content(place / "made") == expected(*self.kept)
        assert not (place / "made" / PRIVATE).exists()


class Split(Make):
    kept = (2,)

    def make(self, place: Path) -> object:
        return build([Source(place / "set", (1,))], place / "made", workers=1)


class Merge(Make):
    kept = LENGTHS + LENGTHS

    def make(self, place: Path) -> object:
        return build([Source(place / "set"), Source(place / "set")], place / "made", workers=1)


class Export(Make):
    """Makes the messages of a data set, which has no frames."""

    def make(self, place: Path) -> object:
        return export(place / "set", place / "made", "mcap")

    def between(self, place: Path) -> None:
        Operation.between(self, place)
        assert content(place / "set") == expected(*LENGTHS)
        if (place / "made" / "meta" / "info.json").exists():
            self.require_messages(place)

    def look(self, place: Path) -> None:
        self.require_messages(place)
        assert not (place / "made" / PRIVATE).exists()

    def require_messages(self, place: Path) -> None:
        found = Dataset.read(place / "made")
        lengths = [sum(1 for _ in messages(message_file(found, item))) for item in found.episode_list()]
        topics = len(found.features.pictures) + len(list(found.features.numbers))
        assert lengths == [length * topics for length in LENGTHS]


class Stats(Operation):
    def base(self, place: Path) -> None:
        write(place / "set")

    def prepare(self, place: Path) -> Callable[[], object]:
        return lambda: recompute(place / "set", workers=1)

    def again(self, place: Path) -> None:
        if is_interrupted(place / "set"):
            repair(place / "set")

    def look(self, place: Path) -> None:
        assert content(place / "set") == expected(*LENGTHS)


class Mend(Operation):
    """Mends a data set in which a table, a video and the statistics are damaged."""

    def base(self, place: Path) -> None:
        write(place / "set")
        damage(place / "set")
        # in a file, because another process looks at it
        (place / "before.json").write_text(json.dumps(digests(place / "set")))

    def prepare(self, place: Path) -> Callable[[], object]:
        return lambda: repair(place / "set")

    def between(self, place: Path) -> None:
        for name in FOREIGN:
            assert (place / "set" / name).read_text() == "of a user", name
        before = json.loads((place / "before.json").read_text())
        assert set(before.values()) <= set(digests(place / "set").values()), "a damaged file is lost"

    def again(self, place: Path) -> None:
        assert repair(place / "set").is_complete

    def look(self, place: Path) -> None:
        self.between(place)
        assert content(place / "set") == [*expected(3), ([0.5], 1)]
        assert repair(place / "set").is_complete


OPERATIONS: dict[str, Callable[[], Operation]] = {
    "keep": Keep,
    "repair a video": Repair,
    "repair picture files": RepairFiles,
    "repair messages": RepairMessages,
    "mend": Mend,
    "delete": Delete,
    "convert": Make,
    "split": Split,
    "merge": Merge,
    "export": Export,
    "stats": Stats,
}


def main() -> NoReturn:
    operation = OPERATIONS[sys.argv[1]]()

    def look(work: Path) -> None:
        operation.between(work)
        operation.again(work)
        operation.look(work)

    kill_at_each_step(Path(sys.argv[2]), operation.base, operation.prepare, look)


if __name__ == "__main__":
    main()
