"""Whatever interrupts an operation on a data set, nothing that was recorded is lost: kills and disks."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import data_operations
import pytest
from data_operations import OPERATIONS, RECORDED, Keep, Operation
from joshua.features import EpisodeError
from joshua_dataset.lock import PRIVATE, WriterLock
from joshua_dataset.open_episode import FRAGMENT_S, SYNC_S
from joshua_dataset.reader import Dataset
from joshua_dataset.transform import delete, recompute

#: Operations that differ in their steps; convert and merge make the steps of split.
STEPS = [name for name in OPERATIONS if name not in ("convert", "merge")]


@pytest.mark.parametrize("name", STEPS)
def test_a_kill_before_any_file_operation(name: str, tmp_path: Path) -> None:
    command = [sys.executable, data_operations.__file__, name, str(tmp_path / "place")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=900)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["wrong"] == [], done.stderr
    assert found["operations"] > 10


@contextlib.contextmanager
def disk(place: Path, size: int) -> Iterator[Path]:
    """A small disk of its own."""
    place.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(place)]
    if os.getuid() or subprocess.run(words, capture_output=True, check=False).returncode:
        pytest.skip("mounting a small disk (tmpfs) requires root and the right to mount")
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


def fill(place: Path, left: int) -> None:
    """Fill a disk up to some bytes."""
    with (place / "fill").open("wb") as file:
        with contextlib.suppress(OSError):
            while True:
                file.write(b"x" * 4096)
                file.flush()
        size = file.seek(0, os.SEEK_END)
        os.ftruncate(file.fileno(), max(0, size - left))


def empty(place: Path) -> None:
    for path in sorted(place.rglob("*"), reverse=True):
        if path.is_dir() and not path.is_symlink():
            path.rmdir()
        else:
            path.unlink()


@pytest.mark.parametrize("name", OPERATIONS)
def test_a_disk_that_is_full_at_any_step(name: str, tmp_path: Path) -> None:
    refused = 0
    with disk(tmp_path / "disk", 3_000_000) as place:
        for left in (*range(0, 32_768, 8192), *range(32_768, 1_000_000, 49_152)):
            empty(place)
            operation = OPERATIONS[name]()
            operation.base(place)
            act = operation.prepare(place)
            fill(place, left)
            said = outcome(operation, act, place)
            refused += bool(said)
            if not said:
                break
    assert refused >= 2, "the disk was never full"
    assert not said, "the disk was always full"


def outcome(operation: Operation, act: object, place: Path) -> str:
    """Run an operation on a disk that may refuse it, then do what it says; return what it said."""
    said = ""
    try:
        act()  # type: ignore[operator]
    except EpisodeError as error:
        said = str(error)
        assert "No space left" in said or "File too large" in said or "Read-only" in said, said
        assert "Nothing" in said or "stays in" in said or "to complete it" in said, said
        assert "un `joshua dataset repair" in said or "un the command again" in said, said
    operation.between(place)
    (place / "fill").unlink(missing_ok=True)
    if said and isinstance(operation, Keep):
        operation.writer.end_episode("wave")  # as `joshua record keep` does
        assert data_operations.content(place / "set")[-1][1] == RECORDED
    if isinstance(operation, Keep):
        operation.writer.close()
    operation.again(place)
    operation.look(place)
    return said


@contextlib.contextmanager
def largest_file(size: int) -> Iterator[None]:
    """A limit as of ``ulimit -f``."""
    former = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, former[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, former)


@pytest.mark.parametrize("name", ["keep", "repair a video", "repair messages", "delete"])
def test_a_limit_of_the_size_of_files(name: str, tmp_path: Path) -> None:
    for number, size in enumerate((0, 700, 1500, 3000)):
        place = tmp_path / str(number)
        place.mkdir()
        operation = OPERATIONS[name]()
        operation.base(place)
        act = operation.prepare(place)

        def limited(act: object = act, size: int = size) -> None:
            with largest_file(size):
                act()  # type: ignore[operator]

        said = outcome(operation, limited, place)
        assert said or size, "nothing can be written"


def test_a_disk_that_becomes_read_only(tmp_path: Path) -> None:
    with disk(tmp_path / "disk", 3_000_000) as place:
        for name in ("repair a video", "delete", "stats"):
            empty(place)
            operation = OPERATIONS[name]()
            operation.base(place)
            act = operation.prepare(place)
            subprocess.run(["mount", "-o", "remount,ro", str(place)], check=True)
            try:
                with pytest.raises(EpisodeError, match="Read-only file system"):
                    act()
                operation.between(place)
            finally:
                subprocess.run(["mount", "-o", "remount,rw", str(place)], check=True)
            operation.again(place)
            operation.look(place)


@pytest.mark.parametrize("code", [errno.EIO, errno.EACCES, errno.EDQUOT, errno.EMFILE, errno.ENOSPC])
@pytest.mark.parametrize("part", ["rows.arrows", "episode.json", f"{data_operations.TOP}.mp4"])
def test_an_error_of_the_system_is_never_taken_for_damage(
    code: int, part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    operation = data_operations.Repair()
    operation.base(tmp_path)
    before = {path.name for path in (tmp_path / "set" / PRIVATE / "open").iterdir()}
    opened = Path.open

    def refused(path: Path, *arguments: object, **options: object) -> object:
        if path.name == part:
            raise OSError(code, os.strerror(code), str(path))
        return opened(path, *arguments, **options)  # type: ignore[call-overload]

    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", refused)
        with pytest.raises(EpisodeError, match=os.strerror(code)):
            operation.prepare(tmp_path)()
    assert before <= {path.name for path in (tmp_path / "set" / PRIVATE / "open").iterdir()}
    operation.again(tmp_path)
    operation.look(tmp_path)


def test_a_data_set_that_is_written_is_changed_by_no_other_command(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    data_operations.write(folder)
    before = data_operations.content(folder)
    lock = WriterLock(folder)
    lock.take()
    for change in (lambda: delete(folder, [0], workers=1), lambda: recompute(folder, workers=1)):
        with pytest.raises(EpisodeError, match=r"is being written by process \d+ on "):
            change()
    lock.release()
    assert data_operations.content(folder) == before
    writer = data_operations.recording(folder, data_operations.LeRobotWriter)
    with pytest.raises(EpisodeError, match=r"is being written by process \d+ on "):
        delete(folder, [0], workers=1)
    writer.end_episode("wave")
    writer.close()
    assert Dataset.read(folder).episodes == len(before) + 1


def test_a_power_cut_costs_two_seconds_at_most() -> None:
    """A fragment waits, then the next flush comes; what remains is the time that the disk takes."""
    assert FRAGMENT_S + SYNC_S <= 1.5
