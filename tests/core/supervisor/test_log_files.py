"""Log files: rotation, a full disk, old runs, where they lie."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from joshua.supervisor import log_files
from joshua.supervisor.log_files import KEPT_ROTATIONS, LogFile, log_directory, new_log, remove_old_logs


def write(path, lines, **settings):
    warnings = []
    log = LogFile(path, warnings.append, **settings)
    for line in lines:
        log.put(line)
    log.close()
    return warnings


def test_lines_are_appended_in_order(tmp_path):
    path = tmp_path / "deep" / "run.jsonl"
    assert write(path, ["one", "zwei ä", "bad \udc80"]) == []
    assert path.read_bytes().decode() == "one\nzwei ä\nbad \\udc80\n"


def test_a_file_that_has_grown_is_rotated_and_the_oldest_goes(tmp_path):
    path = tmp_path / "run.jsonl"
    write(path, [f"{index:09d}" for index in range(60)], max_file_bytes=100)

    names = sorted(item.name for item in tmp_path.iterdir())
    assert names == ["run.jsonl", *(f"run.jsonl.{number}" for number in range(1, KEPT_ROTATIONS + 1))]
    assert path.read_text().splitlines()[-1] == "000000059"
    assert path.with_name("run.jsonl.1").read_text().splitlines()[-1] == "000000049"
    assert all(item.stat().st_size <= 100 for item in tmp_path.iterdir())


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
@pytest.mark.parametrize("umask", [0o000, 0o022], ids=oct)
def test_only_the_owner_can_read_logs(tmp_path, umask):
    former = os.umask(umask)
    try:
        log = LogFile(tmp_path / "state/log/run.jsonl", pytest.fail, max_file_bytes=100)
        for number in range(20):
            log.put(f'{{"number": {number}}}')
        log.close()
    finally:
        os.umask(former)
    found = {path.stat().st_mode & 0o777 for path in (tmp_path / "state/log").iterdir()}
    assert found == {0o600}
    assert len(list((tmp_path / "state/log").iterdir())) > 1, "nothing was rotated"
    for folder in (tmp_path / "state", tmp_path / "state/log"):
        assert folder.stat().st_mode & 0o777 == 0o700


def test_a_full_disk_is_warned_of_once_and_written_to_again_when_it_has_room(tmp_path, monkeypatch):
    monkeypatch.setattr(log_files, "RETRY_S", 0.0)
    path = tmp_path / "run.jsonl"
    path.symlink_to("/dev/full")
    warnings = []
    log = LogFile(path, warnings.append)
    for index in range(3):
        log._write([f"lost {index}"])
    path.unlink()
    log._write(["kept"])
    log.close()

    assert len(warnings) == 1
    assert "No space left on device" in warnings[0]
    assert str(path) in warnings[0]
    lines = path.read_text().splitlines()
    assert "3 lines could not be written here" in lines[1]
    assert lines[2] == "kept"


def test_a_folder_that_cannot_be_made_is_warned_of(tmp_path):
    (tmp_path / "file").write_text("")
    (warning,) = write(tmp_path / "file" / "run.jsonl", ["x"])
    assert "cannot be written" in warning
    assert "JOSHUA_LOG_DIR" in warning


def test_only_the_newest_runs_are_kept(tmp_path):
    for index in range(6):
        stem = f"my-robot-20260102-03040{index}-77"
        for name in (f"{stem}.jsonl", f"{stem}.jsonl.1", f"{stem}-arm.png"):
            (tmp_path / name).write_text("")
            os.utime(tmp_path / name, (index, index))
    (tmp_path / "other.txt").write_text("")
    remove_old_logs(tmp_path, keep=2)
    remove_old_logs(tmp_path / "missing")
    assert sorted(item.name for item in tmp_path.iterdir()) == [
        "my-robot-20260102-030404-77-arm.png",
        "my-robot-20260102-030404-77.jsonl",
        "my-robot-20260102-030404-77.jsonl.1",
        "my-robot-20260102-030405-77-arm.png",
        "my-robot-20260102-030405-77.jsonl",
        "my-robot-20260102-030405-77.jsonl.1",
        "other.txt",
    ]


def test_what_is_no_log_of_a_run_is_never_removed(tmp_path):
    for index in range(5):
        (tmp_path / f"episode_{index}.jsonl").write_text("somebody's data")
    new_log(tmp_path, "my-robot").write_text("")
    new_log(tmp_path, "").write_text("")
    remove_old_logs(tmp_path, keep=0)
    assert len(list(tmp_path.iterdir())) == 5


def test_the_folder_follows_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", "/person")
    assert log_directory({"JOSHUA_LOG_DIR": "/x"}) == Path("/x")
    assert log_directory({"XDG_STATE_HOME": "/s"}) == Path("/s/joshua/log")
    assert log_directory({"XDG_STATE_HOME": "relative"}) == Path("/person/.local/state/joshua/log")
    assert log_directory({}) == Path("/person/.local/state/joshua/log")
