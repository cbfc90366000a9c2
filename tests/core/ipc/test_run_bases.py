"""Where runs are looked for, and whose folders are trusted."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from joshua.ipc import run_bases
from joshua.ipc.client import RunningSystem
from joshua.ipc.run_bases import RunDirectoryError, base_directories, base_directory
from joshua.supervisor.run_directory import NodesInUseError, RunDirectory


def make(base):
    return RunDirectory.create(base, "/data/robot.pbtxt", 7, ["/arm", "/left/camera"])


def test_the_base_follows_the_environment(tmp_path):
    assert base_directory({"XDG_RUNTIME_DIR": str(tmp_path)}) == tmp_path / "joshua"
    fallback = Path(f"/tmp/joshua-{os.getuid()}")
    assert base_directory({}) == fallback
    assert base_directory({"XDG_RUNTIME_DIR": str(tmp_path / "missing")}) == fallback
    assert base_directory({"XDG_RUNTIME_DIR": "relative"}) == fallback
    assert base_directory({"XDG_RUNTIME_DIR": f"/{'x' * 5000}"}) == fallback


def test_a_system_is_found_from_every_usual_environment(tmp_path, monkeypatch):
    user = str(os.getuid())
    (tmp_path / "run" / user).mkdir(parents=True)
    monkeypatch.setattr(run_bases, "_RUNTIME_FOLDERS", tmp_path / "run")
    monkeypatch.setattr(run_bases, "_FALLBACK", tmp_path)
    terminal = {"XDG_RUNTIME_DIR": str(tmp_path / "run" / user)}
    of_terminal, of_service = tmp_path / "run" / user / "joshua", tmp_path / f"joshua-{user}"
    assert base_directories(terminal) == [of_terminal]

    service = make(base_directory({}))  # such as one that systemd starts
    assert base_directories(terminal) == [of_terminal, of_service]
    assert [system.path for system in RunningSystem.all(terminal)] == [service.path]
    with pytest.raises(NodesInUseError, match=f"/arm, /left/camera: held by process {os.getpid()}"):
        make(base_directory(terminal))
    assert base_directories({}, make=True) == [of_service, of_terminal]
    assert of_terminal.stat().st_mode & 0o777 == 0o700
    (tmp_path / "own").mkdir()
    assert RunningSystem.all({"XDG_RUNTIME_DIR": str(tmp_path / "own")}) == []  # chosen: nothing else counts

    of_service.chmod(0o755)
    assert base_directories(terminal) == [of_terminal]  # others may have written there
    assert base_directories({}, make=True) == [of_terminal]
    of_terminal.chmod(0o755)
    with pytest.raises(RunDirectoryError, match="chmod 700"):
        base_directories({}, make=True)
    service.close()


def test_a_socket_whose_path_would_be_too_long_lies_below_tmp(tmp_path):
    long = tmp_path / ("x" * 90)
    long.mkdir()
    usual = Path("/tmp") / f"joshua-{os.getuid()}"
    assert run_bases.short_base_directory({"XDG_RUNTIME_DIR": str(long)}, 30) == usual
    assert run_bases.short_base_directory({"XDG_RUNTIME_DIR": "/tmp"}, 30) == Path("/tmp/joshua")
