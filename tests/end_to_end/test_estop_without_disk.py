"""``joshua estop`` while the file system of the run is full, read-only or gone, and every process stopped."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from guarded_arm import HOLD, Rig, running
from joshua.guardian.latch import latch_folder
from processes import descendants_of, is_guardian
from small_disk import SmallDisk, small_disk

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes in /proc")

NO_SPACE = "No space left on device"


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    with small_disk(tmp_path / "disk") as disk:
        yield disk
    # With a read-only XDG_RUNTIME_DIR, the next run would use the other place, so it is latched there, too.
    for path in latch_folder(Path(f"/tmp/joshua-{os.getuid()}")).glob("*.json"):
        if "so-arm100" in path.read_text() and str(tmp_path) in path.read_text():
            path.unlink()


def rows(output: str) -> dict[str, str]:
    """The tables of the command: what it says of each actuator and each road."""
    found: dict[str, str] = {}
    for line in output.splitlines():
        if line.startswith("  "):
            name, _, rest = line.strip().partition("  ")
            found[name] = rest.strip()
    return found


def estop(rig: Rig, code: int = 0) -> dict[str, str]:
    """Stops the run, and checks at the servos that the torque is off."""
    result = rig.joshua("estop")
    assert rig.energised() == {False}, result.stdout + result.stderr
    assert result.returncode == code, result.stdout + result.stderr
    return rows(result.stdout)


def test_a_full_disk(disk: SmallDisk, joshua_domain_id: int) -> None:
    with running(disk.path, joshua_domain_id, HOLD) as rig:
        disk.fill()
        for _ in range(2):
            said = estop(rig)
            assert said["/follower_arm"].startswith("off     read back from 6 joints by its ")
            assert f"by renaming a file ({NO_SPACE}); it counts for every actuator" in said["latch"]
            assert said["control socket"] == f"process {rig.process.pid} told its nodes"
            assert said["device"] == "not needed"
            again = estop(rig)
            assert again["/follower_arm"].startswith("off     read back from 6 joints by its ")
            rig.wait(lambda: "fault" in rig.joshua("status").stdout)
            refused = rig.joshua("resume", "follower_arm")
            assert "an e-stop without a name is latched" in refused.stderr
            released = rig.joshua("estop", "--release")
            assert released.returncode == 0, released.stderr
            resumed = rig.joshua("resume", "follower_arm")
            assert resumed.returncode == 0, resumed.stderr
            assert rig.energised() == {True}
        stopped = rig.joshua("stop")
        assert stopped.returncode == 0, stopped.stderr
        rig.process.wait(60)


def test_a_full_disk_and_a_driver_that_hangs(disk: SmallDisk, joshua_domain_id: int) -> None:
    with running(disk.path, joshua_domain_id, HOLD) as rig:
        disk.fill()
        os.kill(rig.process.pid, signal.SIGSTOP)
        os.kill(rig.driver, signal.SIGSTOP)
        said = estop(rig)
        assert said["/follower_arm"].startswith("off     read back from 6 joints by ")
        assert "does not answer: no answer" in said["control socket"]
        assert rig.gone(rig.driver)


def test_a_read_only_disk(disk: SmallDisk, joshua_domain_id: int) -> None:
    with running(disk.path, joshua_domain_id, HOLD) as rig:
        disk.make_read_only()
        said = estop(rig)
        assert said["/follower_arm"] == "off     read back from 6 joints by its driver"
        assert "not set in" in said["latch"]
        assert "Read-only file system" in said["latch"]
        assert said["control socket"] == f"process {rig.process.pid} told its nodes"
        refused = rig.joshua("resume", "follower_arm")
        assert "the e-stop of so-arm100 is latched since" in refused.stderr
        released = rig.joshua("estop", "--release", str(disk.path / "teleop.pbtxt"))
        assert released.returncode == 0, released.stderr
        refused = rig.joshua("resume", "follower_arm")
        assert "an e-stop might not be possible" in refused.stderr
        assert "Read-only file system" in refused.stderr
        assert rig.energised() == {False}
        disk.make_writable()
        resumed = rig.joshua("resume", "follower_arm")
        assert resumed.returncode == 0, resumed.stderr
        disk.make_read_only()
        stopped = rig.joshua("stop")
        assert stopped.returncode == 0, stopped.stderr
        rig.process.wait(60)


def test_a_read_only_disk_and_everything_stopped(disk: SmallDisk, joshua_domain_id: int) -> None:
    with running(disk.path, joshua_domain_id, HOLD) as rig:
        disk.make_read_only()
        everything_stops(rig)
        result = rig.joshua("estop")
        assert rig.energised() == {False}, result.stdout
        assert "e-stop not latched" in result.stdout
        assert "The e-stop does not last" in result.stdout
        os.kill(rig.fork_server, signal.SIGCONT)


@pytest.mark.parametrize("lost", ["joshua", "."])
def test_a_folder_that_has_vanished(disk: SmallDisk, joshua_domain_id: int, lost: str) -> None:
    with running(disk.path, joshua_domain_id, HOLD) as rig:
        shutil.rmtree(disk.path / "run" / lost)
        said = estop(rig)
        assert said["/follower_arm"].startswith("off     read back from 6 joints by ")
        assert rig.joshua("estop", "--release").returncode == 0
        resumed = rig.joshua("resume", "follower_arm")
        assert resumed.returncode == 0, resumed.stderr
        everything_stops(rig, [number for number in descendants_of(rig.driver) if is_guardian(number)])
        said = estop(rig)
        assert said["/follower_arm"] == "off     read back from 6 joints by this command"
        os.kill(rig.fork_server, signal.SIGCONT)
        os.kill(rig.process.pid, signal.SIGCONT)
        rig.wait(rig.is_ready)
        shutil.rmtree(disk.path / "run" / lost)
        rig.wait(lambda: rig.joshua("stop").stdout.startswith("stopped "))
        rig.process.wait(60)


@pytest.mark.parametrize("lost", ["joshua", "."])
def test_a_folder_that_has_vanished_and_a_supervisor_that_cannot_make_it_again(
    disk: SmallDisk, joshua_domain_id: int, lost: str
) -> None:
    with running(disk.path, joshua_domain_id, HOLD) as rig:
        os.kill(rig.process.pid, signal.SIGSTOP)
        shutil.rmtree(disk.path / "run" / lost)
        said = estop(rig, 4)
        assert "it counts for every actuator" in said["latch"]
        guarded = said[f"of process {rig.guardian}"]
        assert "its guardian has ended, as it does when the torque is off" in guarded
        os.kill(rig.process.pid, signal.SIGCONT)
        assert rig.joshua("estop", "--release").returncode == 0
        rig.wait(lambda: rig.joshua("resume", "follower_arm").returncode == 0)


def test_what_a_guardian_did_is_kept_on_a_full_disk_without_a_supervisor(
    disk: SmallDisk, joshua_domain_id: int
) -> None:
    with running(disk.path, joshua_domain_id, HOLD) as rig:
        os.kill(rig.process.pid, signal.SIGSTOP)  # it writes nothing more
        disk.fill()
        (log,) = (disk.path / "log").glob("*.jsonl")
        with log.open("ab") as file:  # the last page of the log has room without any space on the disk
            file.write(b"\n" * (-log.stat().st_size % os.sysconf("SC_PAGE_SIZE")))
        size = log.stat().st_size
        os.kill(rig.driver, signal.SIGKILL)
        rig.wait(lambda: rig.gone(rig.guardian))
        rig.process.kill()
        rig.process.wait()
        assert log.stat().st_size == size
        assert rig.energised() == {True}
        said = rig.joshua("status").stdout
        assert (
            "/follower_arm holds its position with torque (guardian: the driver ended without a safe" in said
        )
        assert " held" in said
        assert estop(rig)["/follower_arm"] == "off     read back from 6 joints by this command"


def everything_stops(rig: Rig, guardians: Sequence[int] = ()) -> None:
    """Stops every process of the run that could act on the follower."""
    for process in (rig.process.pid, rig.fork_server, rig.driver, *(guardians or [rig.guardian])):
        os.kill(process, signal.SIGSTOP)


@pytest.mark.parametrize("full", [False, True])
def test_everything_is_stopped(disk: SmallDisk, joshua_domain_id: int, full: bool) -> None:
    with running(disk.path, joshua_domain_id, HOLD) as rig:
        if full:
            disk.fill()
        everything_stops(rig)
        said = estop(rig)
        assert said["/follower_arm"] == "off     read back from 6 joints by this command"
        assert "no answer" in said["control socket"]
        assert (
            f"/follower_arm: killed its guardian (process {rig.guardian}), killed its driver"
            in said["device"]
        )
        assert rig.gone(rig.guardian)
        assert rig.gone(rig.driver)
        os.kill(rig.fork_server, signal.SIGCONT)
        os.kill(rig.process.pid, signal.SIGCONT)
        rig.wait(lambda: "fault" in rig.joshua("status").stdout)
        assert rig.energised() == {False}
