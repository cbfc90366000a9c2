"""The checks of the machine, on real file trees."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from joshua.cli.doctor.checks import (
    CHECKS,
    brltty,
    latency_timer,
    modem_manager,
    permissions,
    plugins,
    realtime,
    shared_memory,
    usb,
)
from joshua.cli.doctor.finding import Finding, Level
from joshua.cli.doctor.host import Host
from usb_host import MakeHost, plug

LIMITS = """Limit                     Soft Limit           Hard Limit           Units
Max nice priority         0                    0
Max realtime priority     {}                    {}
"""


def only(findings: object) -> Finding:
    (finding,) = list(findings)  # type: ignore[call-overload]
    return finding


def test_a_port_that_the_user_may_open_is_in_order(tmp_path: Path, make_host: MakeHost) -> None:
    path = plug(tmp_path, "ttyACM0", "L1")
    os.chmod(path, 0o660)
    group = os.stat(path).st_gid
    assert only(permissions.check(make_host(groups=(group,)))).level is Level.OK


def test_a_user_outside_the_group_is_told_how_to_join(tmp_path: Path, make_host: MakeHost) -> None:
    path = plug(tmp_path, "ttyACM0", "L1")
    os.chmod(path, 0o660)
    number = os.stat(path).st_gid
    found = only(permissions.check(make_host({"etc/group": f"dialout:x:{number}:bob\n"})))
    assert found.level is Level.ERROR
    assert found.message == "-rw-rw----, group dialout: ada may not open it"
    assert found.remedy == "sudo usermod -aG dialout ada, then log in again"
    found = only(permissions.check(make_host({"etc/group": f"dialout:x:{number}:bob,ada\n"})))
    assert found.remedy == "ada is in dialout already: log in again"


def test_a_port_that_lets_no_group_in_needs_a_rule(tmp_path: Path, make_host: MakeHost) -> None:
    os.chmod(plug(tmp_path, "ttyACM0", "L1"), 0o600)
    assert "joshua doctor --udev" in only(permissions.check(make_host())).remedy


def test_cameras_are_looked_at_too_and_no_port_is_a_note(tmp_path: Path, make_host: MakeHost) -> None:
    (tmp_path / "dev").mkdir()
    (tmp_path / "dev/video0").touch(0o600)
    note, camera = permissions.check(make_host())
    assert (note.level, camera.level) == (Level.NOTE, Level.ERROR)
    assert camera.subject.endswith("/dev/video0")


def test_a_slow_latency_timer_is_named_with_the_file(tmp_path: Path, make_host: MakeHost) -> None:
    plug(tmp_path, "ttyUSB0", "F1", "0403:6014", driver="ftdi_sio")
    file = "sys/bus/usb-serial/devices/ttyUSB0/latency_timer"
    found = only(latency_timer.check(make_host({file: "16\n"})))
    assert found.level is Level.WARNING
    assert "holds bytes back for up to 16 ms" in found.message
    assert found.remedy.startswith(f"echo 1 | sudo tee /{file}")
    assert only(latency_timer.check(make_host({file: "1\n"}))).level is Level.OK


def test_an_adapter_that_brltty_has_taken_is_found(tmp_path: Path, make_host: MakeHost) -> None:
    device = "sys/bus/usb/devices/1-4"
    host = make_host({f"{device}/idVendor": "1a86\n", f"{device}/idProduct": "7523\n"})
    assert list(brltty.check(host)) == []  # without brltty it is another fault
    host = make_host({"proc/77/comm": "brltty\n"})
    found = only(brltty.check(host))
    assert (found.level, found.subject) == (Level.ERROR, "USB device 1-4")
    assert "brltty takes it for a braille display" in found.message
    assert "sudo apt remove brltty" in found.remedy


def test_an_adapter_that_brltty_may_take_is_a_warning(tmp_path: Path, make_host: MakeHost) -> None:
    plug(tmp_path, "ttyUSB0", "", "1a86:7523")
    plug(tmp_path, "ttyACM0", "L1")
    host = make_host({"usr/lib/udev/rules.d/85-brltty.rules": 'ENV{PRODUCT}=="1a86/7523/*" RUN+="brltty"\n'})
    found = only(brltty.check(host))
    assert (found.level, Path(found.subject).name) == (Level.WARNING, "ttyUSB0")


def test_modem_manager_is_a_warning_unless_a_rule_keeps_it_off(tmp_path: Path, make_host: MakeHost) -> None:
    plug(tmp_path, "ttyACM0", "L1")
    assert list(modem_manager.check(make_host())) == []
    found = only(modem_manager.check(make_host({"proc/78/comm": "ModemManager\n"})))
    assert found.level is Level.WARNING
    assert "joshua doctor --udev" in found.remedy
    rule = 'ATTRS{idVendor}=="1a86", ATTRS{idProduct}=="55d3", ENV{ID_MM_DEVICE_IGNORE}="1"\n'
    found = only(modem_manager.check(make_host({"etc/udev/rules.d/72-joshua.rules": rule})))
    assert found.level is Level.OK


def test_cameras_on_one_bus_and_adapters_behind_hubs_are_notes(tmp_path: Path, make_host: MakeHost) -> None:
    plug(tmp_path, "ttyACM0", "L1", place="1-2.1.3")
    for number, place in enumerate(("1-1", "1-3", "2-1")):
        device = tmp_path / "sys/bus/usb/devices" / place
        node = device / f"{place}:1.0/video4linux/video{number}"
        node.mkdir(parents=True)
        (node / "device").symlink_to("../..")
        (device / "idVendor").write_text("046d\n")
        (device / "speed").write_text("480\n")
        (tmp_path / "sys/class/video4linux").mkdir(parents=True, exist_ok=True)
        (tmp_path / f"sys/class/video4linux/video{number}").symlink_to(node)
    cameras, hubs = usb.check(make_host())
    assert (cameras.subject, cameras.level) == ("bus 1", Level.NOTE)
    assert cameras.message.startswith("2 cameras share the 480 Mbit/s of one bus")
    assert "MJPG" in cameras.remedy
    assert hubs.message.startswith("2 hubs lie between the computer and this adapter (socket 1-2.1.3)")


@pytest.mark.parametrize(("granted", "level"), [("0", Level.NOTE), ("1", Level.OK), ("unlimited", Level.OK)])
def test_the_grant_of_real_time_priority(make_host: MakeHost, granted: str, level: Level) -> None:
    found = only(realtime.check(make_host({"proc/self/limits": LIMITS.format(granted, granted)})))
    assert found.level is level
    assert ("rtprio 1" in found.remedy) is (level is Level.NOTE)


def test_shared_memory_needs_a_place_and_room(tmp_path: Path, make_host: MakeHost) -> None:
    (tmp_path / "proc").mkdir()
    found = only(shared_memory.check(make_host()))
    assert (found.level, found.message) == (Level.ERROR, "is not there")
    (tmp_path / "dev/shm").mkdir(parents=True)
    assert only(shared_memory.check(make_host(), least_mib=0)).level is Level.OK
    found = only(shared_memory.check(make_host(), least_mib=1e12))
    assert found.level is Level.WARNING
    assert "docker run --shm-size" in found.remedy


def test_the_software_is_listed_with_its_versions(make_host: MakeHost) -> None:
    found = list(plugins.check(make_host()))
    assert found[0].subject == "joshua-core"
    assert " on Python 3." in found[0].message
    assert all(finding.level is Level.OK for finding in found if finding.subject == "joshua-sts3215")
    subjects = [finding.subject for finding in found]
    assert len(set(subjects)) == len(subjects), "each distribution once"


def test_every_check_bears_a_machine_without_any_of_its_files(make_host: MakeHost) -> None:
    assert all(finding.level in (Level.OK, Level.NOTE) for check in CHECKS for finding in check(make_host()))


def test_this_machine_can_be_looked_at() -> None:
    assert [finding for check in CHECKS for finding in check(Host())]
