"""Whatever interrupts an operation on a data set, nothing that was recorded is lost: kills and disks."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import data_operations
import pytest
from data_operations import OPERATIONS, RECORDED, Keep, Operation
from joshua.features import EpisodeError
from joshua_dataset.changes import change_folder
from joshua_dataset.cloud import upload as uploading
from joshua_dataset.cloud.copies import store_of
from joshua_dataset.cloud.download import download
from joshua_dataset.cloud.errors import RemoteError
from joshua_dataset.cloud.store import Tally
from joshua_dataset.cloud.upload import upload
from joshua_dataset.lock import PRIVATE, WriterLock
from joshua_dataset.open_episode import SYNC_S
from joshua_dataset.pictures import FRAGMENT_S
from joshua_dataset.reader import Dataset
from joshua_dataset.recomputing import recompute
from joshua_dataset.repair import repair
from joshua_dataset.transform import delete
from joshua_dataset.writer import LeRobotWriter
from small_dataset import TOP

#: Operations that differ in their steps; convert and merge make the steps of split.
STEPS = [name for name in OPERATIONS if name not in ("convert", "merge")]


@pytest.mark.parametrize("name", STEPS)
def test_a_kill_before_any_file_operation(name: str) -> None:
    # In memory where there is such a folder, because thousands of files are flushed to the disk.
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None
    with tempfile.TemporaryDirectory(dir=memory) as folder:
        command = [sys.executable, data_operations.__file__, name, str(Path(folder) / "place")]
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
    with (place / "fill").open("wb", buffering=0) as file:
        with contextlib.suppress(OSError):
            while True:
                file.write(b"x" * 4096)
        file.truncate(max(0, file.tell() - left))


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
@pytest.mark.parametrize("part", ["rows.arrows", "episode.json", f"{TOP}.mp4"])
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
    writer = data_operations.recording(folder, LeRobotWriter)
    with pytest.raises(EpisodeError, match=r"is being written by process \d+ on "):
        delete(folder, [0], workers=1)
    writer.end_episode("wave")
    writer.close()
    assert Dataset.read(folder).episodes == len(before) + 1


def test_an_upload_needs_no_space_beside_the_data_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = tmp_path / "there"
    with disk(tmp_path / "disk", 3_000_000) as place:
        data_operations.write(place / "set")
        fill(place, 0)
        with monkeypatch.context() as patch:
            patch.setattr(tempfile, "tempdir", str(place))
            with pytest.raises(
                RemoteError, match=r"No space left.* stays as it is.* Free some space, then run"
            ):
                upload(place / "set", store_of(f"file://{there}"), Tally())
        assert not (there / "meta" / "info.json").exists()
        upload(place / "set", store_of(f"file://{there}"), Tally())  # without a ledger
        before = data_operations.content(place / "set")
        assert data_operations.content(there) == before


def test_an_upload_does_not_mix_a_data_set_with_what_it_becomes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, there = tmp_path / "set", tmp_path / "there"
    data_operations.write(folder)
    send = uploading._send

    def meanwhile(*arguments: Any) -> None:
        send(*arguments)
        if Dataset.read(folder).episodes == 2:
            delete(folder, [0], workers=1)

    monkeypatch.setattr(uploading, "_send", meanwhile)
    store = store_of(f"file://{there}")
    with pytest.raises(RemoteError, match=r"was changed by another command meanwhile\. Run the same command"):
        upload(folder, store, Tally())
    assert not (there / "meta" / "info.json").exists()
    upload(folder, store, Tally(), replace=True)
    assert data_operations.content(there) == data_operations.content(folder)


@pytest.mark.parametrize("act", [upload, download])
def test_transfers_wait_for_an_interrupted_change(act: Any, tmp_path: Path) -> None:
    folder, there = tmp_path / "set", f"file://{tmp_path / 'there'}"
    data_operations.write(folder)
    upload(folder, store_of(there), Tally())
    change_folder(folder).mkdir(parents=True)
    (change_folder(folder) / "journal.json").write_text('{"moves": []}')
    words = (folder, store_of(there)) if act is upload else (store_of(there), folder)
    with pytest.raises(RemoteError, match=f"was interrupted. Run `joshua dataset repair {folder}` first"):
        act(*words, Tally())
    assert "an interrupted change is completed" in str(repair(folder))
    act(*words, Tally())


def test_a_journal_that_leads_out_of_the_data_set_is_moved_aside(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    data_operations.write(folder)
    (tmp_path / "thesis.txt").write_text("precious")
    change_folder(folder).mkdir(parents=True)
    moves = [["clear", "../thesis.txt", ".joshua/change/old/000000"]]
    (change_folder(folder) / "journal.json").write_text(json.dumps({"moves": moves}))
    with pytest.raises(
        EpisodeError, match=r"journal is not valid .*thesis\.txt' is outside .* was moved to "
    ):
        repair(folder)
    assert (tmp_path / "thesis.txt").read_text() == "precious"
    assert "is complete: 2 episodes" in str(repair(folder))


def test_a_power_cut_costs_two_seconds_at_most() -> None:
    """A fragment waits, then the next flush comes; what remains is the time that the disk takes."""
    assert FRAGMENT_S + SYNC_S <= 1.5
