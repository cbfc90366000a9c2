"""The checks of serial ports, on real file trees."""

from __future__ import annotations

import os
from pathlib import Path

from joshua.cli.doctor.result import DoctorResult, Level
from joshua_serial.doctor import CHECKS, brltty, latency_timer, modem_manager, permissions, usb
from usb_host import MakeHost, plug


def only(results: object) -> DoctorResult:
    (result,) = list(results)  # type: ignore[call-overload]
    return result


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
    assert found.remedy == "run `sudo usermod -aG dialout ada`, then log in again"
    found = only(permissions.check(make_host({"etc/group": f"dialout:x:{number}:bob,ada\n"})))
    assert found.remedy == "log in again: ada is already in dialout"


def test_a_port_that_lets_no_group_in_needs_a_rule(tmp_path: Path, make_host: MakeHost) -> None:
    os.chmod(plug(tmp_path, "ttyACM0", "L1"), 0o600)
    assert "joshua doctor --udev" in only(permissions.check(make_host())).remedy


def test_no_port_is_a_note(make_host: MakeHost) -> None:
    assert only(permissions.check(make_host())).level is Level.NOTE


def test_a_slow_latency_timer_is_named_with_the_file(tmp_path: Path, make_host: MakeHost) -> None:
    plug(tmp_path, "ttyUSB0", "F1", "0403:6014", driver="ftdi_sio")
    file = "sys/bus/usb-serial/devices/ttyUSB0/latency_timer"
    found = only(latency_timer.check(make_host({file: "16\n"})))
    assert found.level is Level.WARNING
    assert "holds bytes back for up to 16 ms" in found.message
    assert found.remedy.startswith(f"run `echo 1 | sudo tee /{file}")
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


def test_an_adapter_behind_hubs_is_a_note(tmp_path: Path, make_host: MakeHost) -> None:
    plug(tmp_path, "ttyACM0", "L1", place="1-2.1.3")
    hubs = only(usb.check(make_host()))
    assert hubs.level is Level.NOTE
    assert hubs.message.startswith("2 hubs are between the computer and this adapter (socket 1-2.1.3)")


def test_every_check_bears_a_machine_without_any_of_its_files(make_host: MakeHost) -> None:
    assert all(result.level in (Level.OK, Level.NOTE) for check in CHECKS for result in check(make_host()))
