import contextlib
import fcntl
import os
import struct
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from joshua_emulator import EmulatedBus
from joshua_serial import port as serial_port
from joshua_serial.errors import PortBusy, PortDisconnected, PortForbidden, PortNotFound, PortUnusable
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint


def ping(servo_id: int) -> bytes:
    body = bytes((servo_id, 2, 1))
    return b"\xff\xff" + body + bytes((~sum(body) & 0xFF,))


@pytest.fixture
def emulator() -> Iterator[EmulatedBus]:
    """Three servos of a kind that answers a ping."""
    with EmulatedBus(ids=(1, 2, 3)) as emulator:
        yield emulator


def port_of(emulator: EmulatedBus, baudrate: int = 1_000_000) -> SerialPort:
    return SerialPort(Endpoint(emulator.port, device_root=str(emulator.root)), baudrate)


def await_bytes(port: SerialPort, count: int) -> None:
    """Waits until so many bytes lie in the port, and are not read yet."""
    waiting = b""
    deadline_s = time.monotonic() + 30
    while waiting != struct.pack("i", count):
        assert time.monotonic() < deadline_s, waiting
        time.sleep(0.005)
        waiting = fcntl.ioctl(port._fd, termios.FIONREAD, bytes(4))


@contextmanager
def as_other_user() -> Iterator[None]:
    """Runs as a user without rights where the tests run as root."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


@pytest.mark.parametrize("baudrate", [1_000_000, 250_000, 128_000])
def test_bytes_go_out_and_come_back_at_usual_and_unusual_speeds(baudrate: int) -> None:
    with EmulatedBus(ids=(1,), baudrate=baudrate) as emulator:
        port = port_of(emulator, baudrate)
        port.open()
        port.send(ping(1))
        assert port.receive(6, time.monotonic() + 30) == bytes.fromhex("ffff010200fc")
        port.close()
        port.close()


def test_a_read_ends_at_its_deadline_with_what_there_is(emulator: EmulatedBus) -> None:
    port = port_of(emulator)
    port.open()
    port.send(ping(1))
    await_bytes(port, 6)
    assert len(port.receive(50, time.monotonic() + 0.1)) == 6
    assert port.receive(50, time.monotonic() - 1) == b""
    port.close()


def test_a_line_that_is_full_for_a_moment_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial_port, "FULL_LINE_S", 60.0)
    device, line = os.openpty()
    try:
        port = SerialPort(Endpoint(os.ttyname(line)), 1_000_000)
        port.open()
        os.set_blocking(line, False)
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(line, bytes(1000))
        reader = threading.Timer(0.1, lambda: os.read(device, 65536))
        reader.start()
        port.send(b"x")
        reader.join()
        port.close()
    finally:
        os.close(device)
        os.close(line)


def test_sending_drops_what_came_before(emulator: EmulatedBus) -> None:
    port = port_of(emulator)
    port.open()
    port.send(ping(1))
    await_bytes(port, 6)
    port.receive(1, time.monotonic() + 30)  # five bytes stay behind
    port.send(ping(2))
    assert port.receive(6, time.monotonic() + 30) == bytes.fromhex("ffff020200fb")
    port.close()


def test_a_wrong_path_is_named_with_the_ports_that_there_are(emulator: EmulatedBus) -> None:
    port = SerialPort(Endpoint(str(emulator.root / "dev/ttyACM9"), device_root=str(emulator.root)), 1_000_000)
    with pytest.raises(
        PortNotFound, match=r"ttyACM9: no such serial port\. Ports here: .*ttyACM0 .*EMULATED0"
    ):
        port.open()
    assert not port.is_open


def test_a_file_is_no_serial_port(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(
        PortUnusable, match=r"is not a serial port\. Ports here: none.*Correct comm\.serial\.port"
    ):
        SerialPort(Endpoint(str(tmp_path / "file"), device_root=str(tmp_path)), 1_000_000).open()


def test_a_port_belongs_to_one_process(emulator: EmulatedBus) -> None:
    program = (
        "import sys, time\nfrom joshua_serial.port import SerialPort\n"
        "from joshua_serial.usb_ports import Endpoint\nport = SerialPort(Endpoint(sys.argv[1]), 1000000)\n"
        "port.open()\nprint('open', flush=True)\ntime.sleep(60)\n"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", program, emulator.port], stdout=subprocess.PIPE, text=True
    )
    assert other.stdout is not None
    assert other.stdout.readline() == "open\n"
    port = port_of(emulator)
    with pytest.raises(
        PortBusy, match=rf"the port is in use by \S+ \(process {other.pid}\)\. .*Two programs"
    ):
        port.open()
    other.kill()
    other.wait()
    other.stdout.close()
    port.open()  # a killed owner leaves no lock behind
    with pytest.raises(PortBusy, match=rf"the port is in use by \S+ \(process {os.getpid()}, this one\)"):
        port_of(emulator).open()
    port.close()


def test_a_port_of_a_foreign_group_names_group_and_remedy(tmp_path: Path) -> None:
    path = tmp_path / "ttyACM0"
    path.touch()
    tmp_path.chmod(0o755)
    for folder in tmp_path.parents:
        if folder.stat().st_uid == os.geteuid() and not folder.stat().st_mode & 0o001:
            folder.chmod(folder.stat().st_mode | 0o011)  # the path leads to the file for everybody
    if os.geteuid() == 0:
        os.chown(path, -1, 65534)
    path.chmod(0o060)
    group = path.group()
    port = SerialPort(Endpoint(str(path), device_root=str(tmp_path)), 1_000_000)
    with (
        as_other_user(),
        pytest.raises(
            PortForbidden,
            match=rf"belongs to the group {group}: run `sudo usermod -a -G {group} \$USER`.*log in again",
        ),
    ):
        port.open()
    path.chmod(0o000)
    with (
        as_other_user(),
        pytest.raises(PortForbidden, match=r"gives no group access: install the udev rules"),
    ):
        port.open()


def test_an_unplugged_adapter_is_reported_as_gone(emulator: EmulatedBus) -> None:
    port = port_of(emulator)
    port.open()
    emulator.fault("unplug")
    with pytest.raises(
        PortDisconnected,
        match=r"ttyACM0 \(usb:EMULATED0\): the adapter is gone.*plug and cable. JOSHUA finds it "
        r"again under this path only; with serial_number, under any path \(joshua find-port --write\)",
    ):
        port.receive(6, time.monotonic() + 30)
    with pytest.raises(PortDisconnected):
        port.send(b"x")
    port.close()


def test_a_speed_that_no_adapter_runs_at_is_refused(
    emulator: EmulatedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = port_of(emulator)
    port.open()
    monkeypatch.setattr("joshua_serial.port._IS_LINUX", False)
    with pytest.raises(PortUnusable, match=r"cannot run at 250000 bit/s.*such as 115200"):
        port.set_baudrate(250_000)
    port.close()


def test_an_adapter_with_a_lasting_name_is_found_again(emulator: EmulatedBus) -> None:
    port = SerialPort(Endpoint(serial_number="EMULATED0", device_root=str(emulator.root)), 1_000_000)
    port.open()
    emulator.fault("unplug")
    with pytest.raises(PortDisconnected, match=r"finds it again by its identity, under any path"):
        port.receive(6, time.monotonic() + 30)
    emulator.fault("replug", name="ttyUSB3")
    port.open()
    assert port.entry.path.endswith("ttyUSB3")
    port.close()


def test_waiting_bytes_are_dropped_on_request(emulator: EmulatedBus) -> None:
    port = port_of(emulator)
    port.open()
    port.send(ping(1))
    await_bytes(port, 6)
    port.discard_input()
    assert port.receive(6, time.monotonic() + 0.1) == b""
    port.close()


@pytest.mark.parametrize(("raised", "request_code"), [(True, termios.TIOCMBIS), (False, termios.TIOCMBIC)])
@pytest.mark.parametrize("drop_on_close", [True, False])
def test_dtr_is_switched_and_dropped_on_close_only_where_that_is_asked(
    emulator: EmulatedBus,
    monkeypatch: pytest.MonkeyPatch,
    raised: bool,
    request_code: int,
    drop_on_close: bool,
) -> None:
    port = port_of(emulator)
    port.open()
    asked: list[tuple[int, bytes]] = []
    monkeypatch.setattr(fcntl, "ioctl", lambda _, code, value: asked.append((code, value)))
    port.set_dtr(raised, drop_on_close=drop_on_close)
    monkeypatch.undo()
    assert asked == [(request_code, struct.pack("I", termios.TIOCM_DTR))]
    assert bool(termios.tcgetattr(port._fd)[2] & termios.HUPCL) == drop_on_close
    port.set_dtr(raised)  # a pseudo-terminal has no such line, which is no error
    port.close()
