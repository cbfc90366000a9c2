"""The directory of a running system."""

from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path

import pytest
from joshua.generator import run_directory
from joshua.generator.run_directory import (
    NodesInUseError,
    RunDirectory,
    RunDirectoryError,
    base_directories,
    base_directory,
    running_systems,
    user_systems,
)


def make(base, nodes=("/arm", "/left/camera"), domain_id=7):
    return RunDirectory.create(base, "/data/robot.pbtxt", domain_id, list(nodes))


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
    monkeypatch.setattr(run_directory, "_RUNTIME_FOLDERS", tmp_path / "run")
    monkeypatch.setattr(run_directory, "_FALLBACK", tmp_path)
    terminal = {"XDG_RUNTIME_DIR": str(tmp_path / "run" / user)}
    of_terminal, of_service = tmp_path / "run" / user / "joshua", tmp_path / f"joshua-{user}"
    assert base_directories(terminal) == [of_terminal]

    service = make(base_directory({}))  # such as one that systemd starts
    assert base_directories(terminal) == [of_terminal, of_service]
    assert [path for path, _ in user_systems(terminal)] == [service.path]
    assert base_directories({}, make=True) == [of_service, of_terminal]
    assert of_terminal.stat().st_mode & 0o777 == 0o700
    (tmp_path / "own").mkdir()
    assert user_systems({"XDG_RUNTIME_DIR": str(tmp_path / "own")}) == []  # chosen: nothing else counts

    of_service.chmod(0o755)
    assert base_directories(terminal) == [of_terminal]  # others may have written there
    assert base_directories({}, make=True) == [of_terminal]
    of_terminal.chmod(0o755)
    with pytest.raises(RunDirectoryError, match="chmod 700"):
        base_directories({}, make=True)
    service.close()


def test_who_only_looks_is_not_taken_for_the_run(tmp_path):
    dead = make(tmp_path / "base")
    lock = dead.path / "lock"
    os.close(dead._descriptors.pop())
    with lock.open() as looking:
        fcntl.flock(looking, fcntl.LOCK_SH)
        assert running_systems(tmp_path / "base") == []
    dead.close()


def test_it_is_private_and_says_who_runs_what(tmp_path):
    run = make(tmp_path / "base")

    assert run.path.stat().st_mode & 0o777 == 0o700
    assert (tmp_path / "base").stat().st_mode & 0o777 == 0o700
    ((path, info),) = running_systems(tmp_path / "base")
    assert path == run.path
    assert (info.process_id, info.source, info.nodes) == (
        os.getpid(),
        "/data/robot.pbtxt",
        ("/arm", "/left/camera"),
    )
    run.close()
    run.close()
    assert running_systems(tmp_path / "base") == []
    assert not run.path.exists()


def test_a_held_node_is_refused_with_its_holder_and_the_rest_is_let_go(tmp_path):
    first = make(tmp_path / "base", ["/arm"])
    with pytest.raises(NodesInUseError) as caught:
        make(tmp_path / "base", ["/camera", "/arm"])
    text = str(caught.value)
    assert f"/arm: held by process {os.getpid()}, which runs /data/robot.pbtxt since " in text
    assert "/camera" not in text
    assert "ROS_DOMAIN_ID" in text
    make(tmp_path / "base", ["/camera"]).close()
    first.close()
    make(tmp_path / "base", ["/arm"]).close()


def test_nodes_of_another_domain_or_namespace_are_free(tmp_path):
    runs = [
        make(tmp_path / "base", ["/arm"]),
        make(tmp_path / "base", ["/arm"], domain_id=8),
        make(tmp_path / "base", ["/left/arm"]),
    ]
    assert len(running_systems(tmp_path / "base")) == 3
    for run in runs:
        run.close()


def test_what_a_killed_run_left_is_removed(tmp_path):
    stale = tmp_path / "base" / "runs" / "dead"
    make(tmp_path / "base").close()
    stale.mkdir()
    (stale / "lock").write_text("")
    (stale / "run.json").write_text(json.dumps({"run": "dead"}))
    (stale / "control.sock").write_text("")
    (tmp_path / "base" / "runs" / "half").mkdir()

    run = make(tmp_path / "base")
    assert [path.name for path in (tmp_path / "base" / "runs").iterdir()] == [run.path.name]
    run.close()


def test_a_base_that_others_can_enter_is_refused(tmp_path):
    base = tmp_path / "base"
    base.mkdir()
    base.chmod(0o755)
    with pytest.raises(RunDirectoryError, match="chmod 700"):
        make(base)


def test_a_base_that_is_a_link_is_refused(tmp_path):
    (tmp_path / "real").mkdir(mode=0o700)
    (tmp_path / "base").symlink_to(tmp_path / "real")
    with pytest.raises(RunDirectoryError, match="remove it or set XDG_RUNTIME_DIR"):
        make(tmp_path / "base")


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give files away")
def test_a_base_of_another_user_is_refused(tmp_path):
    base = tmp_path / "base"
    base.mkdir(mode=0o700)
    os.chown(base, 12345, 12345)
    with pytest.raises(RunDirectoryError, match="belongs to user 12345"):
        make(base)


def test_a_base_that_cannot_be_made_is_an_error_with_a_remedy(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunDirectoryError, match="XDG_RUNTIME_DIR"):
        make(tmp_path / "file" / "base")


def test_the_log_is_pointed_to(tmp_path):
    run = make(tmp_path / "base")
    (tmp_path / "x.jsonl").write_text("{}")
    run.point_to_log(tmp_path / "x.jsonl")
    run.point_to_log(tmp_path / "x.jsonl")
    assert (run.path / "log.jsonl").read_text() == "{}"
    run.close()
    assert (tmp_path / "x.jsonl").exists()
