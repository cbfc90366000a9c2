"""The directory of a running system."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from joshua.ipc.client import running_systems
from joshua.ipc.run_bases import RunDirectoryError, base_directories
from joshua.supervisor.run_directory import (
    NodesInUseError,
    RunDirectory,
    socket_folder,
)
from joshua.supervisor.starting import started_processes, starting
from small_disk import small_disk


def make(base, nodes=("/arm", "/left/camera"), domain_id=7):
    return RunDirectory.create(base, "/data/robot.pbtxt", domain_id, list(nodes))


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


def test_the_socket_of_a_simulation_outlives_nobody(tmp_path):
    base = tmp_path / "base"
    program = (
        "import os, signal, sys\nfrom pathlib import Path\n"
        "from joshua.supervisor.run_directory import socket_folder\n"
        "with socket_folder(Path(sys.argv[1]), 'physics') as folder:\n"
        "    (folder / 'bus.sock').write_text('')\n    print(folder, flush=True)\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    killed = subprocess.run([sys.executable, "-c", program, base], capture_output=True, text=True, timeout=60)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    left = Path(killed.stdout.strip())
    assert (left / "bus.sock").exists()

    with socket_folder(base, "physics") as mine:
        assert not left.exists()
        assert mine.stat().st_mode & 0o777 == 0o700
        with socket_folder(base, "physics"):
            assert mine.exists(), "its owner lives"
        make(base).close()
        assert mine.exists()
    assert list((base / "physics").iterdir()) == []

    left.mkdir()
    make(base).close()
    assert not left.exists(), "a run without a simulation tidies up as well"


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


def test_a_run_needs_space_and_leaves_a_spare_file_for_an_estop(tmp_path):
    with small_disk(tmp_path / "disk", size_bytes=256 * 1024, inodes=200) as disk:
        base = disk.path / "joshua"
        make(base).close()
        (base / "estop" / "spare").unlink()
        disk.fill()
        with pytest.raises(RunDirectoryError, match=r"No space left on device\. Free space"):
            make(base)
        disk.free()
        run = make(base)
        assert (base / "estop" / "spare").read_bytes() == b""
        run.close()


def test_a_directory_that_vanishes_on_a_full_disk_keeps_its_nodes_and_comes_back_later(tmp_path):
    with small_disk(tmp_path / "disk", size_bytes=256 * 1024, inodes=200) as disk:
        base = disk.path / "joshua"
        run = make(base)
        shutil.rmtree(base / "runs")
        disk.fill()
        for _ in range(2):
            with pytest.raises(RunDirectoryError):
                run.restore()
        assert running_systems(base) == []
        disk.free()
        with pytest.raises(NodesInUseError, match=f"held by process {os.getpid()}"):
            make(base)
        assert run.restore()
        assert not run.restore()
        assert [path for path, _ in running_systems(base)] == [run.path]
        run.close()


def test_a_run_on_a_disk_that_becomes_read_only_is_still_found(tmp_path):
    with small_disk(tmp_path / "disk", size_bytes=256 * 1024, inodes=200) as disk:
        base = disk.path / "joshua"
        run = make(base)
        disk.make_read_only()
        assert [path for path, _ in running_systems(base)] == [run.path]
        assert base in base_directories({"XDG_RUNTIME_DIR": str(disk.path)})
        with starting(base):
            assert started_processes([base]) == set()
        run.close()
        assert running_systems(base) == []
        disk.make_writable()
