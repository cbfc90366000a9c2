"""Every failure that a user can reach: the message names the hub, the cause and the remedy."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bleak.exc import BleakBluetoothNotAvailableError, BleakBluetoothNotAvailableReason, BleakDBusError
from joshua_emulator.spike.process import EmulatedHub
from joshua_spike import link, session
from joshua_spike.actuator import SpikeActuator
from joshua_spike.adapters import adapter_problem
from joshua_spike.errors import (
    AdapterUnusable,
    HubNotFound,
    HubUnreachable,
    LinkLost,
    MotorCheckFailed,
    ProgramFailed,
    WrongFirmware,
)
from joshua_spike.hub.program import HubProgram, pack
from mpy_cross_v6 import mpy_cross_compile

MakeActuator = Callable[..., SpikeActuator]

on_linux = pytest.mark.skipif(sys.platform != "linux", reason="BlueZ is a service of Linux")


def refusal(actuator: SpikeActuator, kind: type[Exception]) -> str:
    """The message of a connect that fails; the device stays closed, and nothing is left behind."""
    with pytest.raises(kind) as caught:
        actuator.connect()
    assert not actuator.connected
    return str(caught.value)


def read_on(actuator: SpikeActuator) -> None:
    """Reads for a while, as a node does."""
    end_s = time.monotonic() + 60
    while time.monotonic() < end_s:
        actuator.read()


def test_a_hub_that_is_off(
    hub: EmulatedHub, make_actuator: MakeActuator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link, "FIND_TIMEOUT_S", 1.0)
    hub.fault("unplug")
    text = refusal(make_actuator(), HubNotFound)
    assert "hub 'Pybricks Hub': not found within 1 s; found: nothing" in text
    assert "Switch the hub on and move it closer" in text


def test_a_hub_with_another_name(
    hub: EmulatedHub, make_actuator: MakeActuator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link, "FIND_TIMEOUT_S", 3.0)
    text = refusal(make_actuator(device_name="Pybrick Hub"), HubNotFound)
    assert "found: 'Pybricks Hub'" in text
    assert "Write device_name: 'Pybricks Hub'" in text


def test_a_hub_that_is_connected_elsewhere(
    hub: EmulatedHub, make_actuator: MakeActuator, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_actuator().connect()
    monkeypatch.setattr(link, "FIND_TIMEOUT_S", 1.0)
    text = refusal(make_actuator(), HubNotFound)
    assert "connected elsewhere, such as to Pybricks Code" in text
    assert "disconnect it there" in text


def test_a_connection_that_fails_is_tried_again(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    hub.fault("flaky", 2)
    actuator = make_actuator()
    actuator.connect()
    actuator.read()
    assert len(hub.log("connected")) == 3


def test_a_hub_that_keeps_no_connection(
    hub: EmulatedHub, make_actuator: MakeActuator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link, "FIRST_BACK_OFF_S", 0.05)
    hub.fault("flaky", 100)
    text = refusal(make_actuator(), HubUnreachable)
    assert "was found, but 3 attempts to connect failed" in text
    assert "Move closer" in text


def test_a_hub_with_legos_firmware(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    hub.fault("firmware", "lego")  # type: ignore[arg-type]
    text = refusal(make_actuator(), WrongFirmware)
    assert "offers no Pybricks service" in text
    assert "LEGO's firmware" in text
    assert "Install Pybricks at https://code.pybricks.com" in text


def test_a_hub_with_an_old_pybricks(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    hub.fault("firmware", "old")  # type: ignore[arg-type]
    text = refusal(make_actuator(), WrongFirmware)
    assert "without support for .mpy version 6" in text
    assert "update it to 3.3 or newer" in text


@pytest.mark.parametrize(
    ("fault", "problem"),
    [
        ("motor_off", "port B: nothing is plugged in"),
        ("sensor", "port B: a colour sensor is plugged in, which is not a motor"),
    ],
)
def test_a_port_without_motor(
    hub: EmulatedHub, make_actuator: MakeActuator, fault: str, problem: str
) -> None:
    hub.fault(fault, "B")  # type: ignore[arg-type]
    text = refusal(make_actuator(), MotorCheckFailed)
    assert problem in text
    assert "expected: a motor on A, B" in text
    assert "or correct port_names" in text
    hub.ask("clear_faults")
    make_actuator().connect()  # the program looks at its ports anew


def test_a_motor_that_is_unplugged_shows_what_the_program_said(
    hub: EmulatedHub, make_actuator: MakeActuator
) -> None:
    actuator = make_actuator()
    actuator.connect()
    actuator.enable()
    hub.fault("motor_off", "B")  # type: ignore[arg-type]
    with pytest.raises(ProgramFailed) as caught:
        read_on(actuator)
    text = str(caught.value)
    assert "the program on the hub has ended. Its output:" in text
    assert "OSError: [Errno 19] ENODEV" in text
    assert "joshua_hub.py" in text
    assert [motor["powered"] for motor in hub.state()["motors"].values()] == [False, False]
    actuator.release()  # the firmware has done it already


def compiled(source: str) -> HubProgram:
    process, code = mpy_cross_compile("joshua_hub.py", source, small_number_bits=31)
    assert code is not None, process.stderr
    return HubProgram("0badc0de", pack(code))


@pytest.mark.parametrize(
    ("source", "what"),
    [
        ("raise ValueError('not on this firmware')", "ValueError: not on this firmware"),
        ("print('hello')\nwhile True:\n    pass", "does not become ready. Its output:\n  hello"),
    ],
)
def test_a_program_that_does_not_get_ready_shows_what_it_said(
    make_actuator: MakeActuator, monkeypatch: pytest.MonkeyPatch, source: str, what: str
) -> None:
    monkeypatch.setattr("joshua_spike.client.load_program", lambda: compiled(source))
    monkeypatch.setattr(link, "COMMAND_TIMEOUT_S", 3.0)
    monkeypatch.setattr(session, "READY_TIMEOUT_S", 3.0)
    text = refusal(make_actuator(), ProgramFailed)
    assert what in text
    assert "hub 'Pybricks Hub'" in text


def test_a_program_that_is_too_large_is_not_uploaded(
    hub: EmulatedHub, make_actuator: MakeActuator, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = HubProgram("0badc0de", bytes(300_000))
    monkeypatch.setattr("joshua_spike.client.load_program", lambda: program)
    text = refusal(make_actuator(), ProgramFailed)
    assert "accepts programs of at most 258048 bytes, and the program of JOSHUA has 300000" in text
    assert hub.log("upload") == []


def test_the_button_of_the_hub(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    actuator = make_actuator()
    actuator.connect()
    hub.fault("button")
    with pytest.raises(ProgramFailed, match="hub's button may have been pressed"):
        read_on(actuator)
    actuator.disconnect()
    actuator.connect()  # starts it again
    actuator.read()


def test_a_hub_that_is_switched_off_meanwhile(hub: EmulatedHub, make_actuator: MakeActuator) -> None:
    actuator = make_actuator()
    actuator.connect()
    hub.fault("unplug")
    with pytest.raises(LinkLost, match="switched off, is out of range, or its battery is empty"):
        read_on(actuator)
    actuator.disconnect()
    hub.fault("replug")
    actuator.connect()


def test_an_emulated_adapter_that_does_not_run(make_actuator: MakeActuator) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    text = refusal(make_actuator(adapter=f"tcp-client:127.0.0.1:{port}"), AdapterUnusable)
    assert f"adapter tcp-client:127.0.0.1:{port}: cannot be opened" in text
    assert "omit adapter to use the system's own" in text


def test_an_adapter_that_does_not_answer(
    make_actuator: MakeActuator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("joshua_spike.bumble_backend.OPEN_TIMEOUT_S", 0.3)
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp-client:127.0.0.1:{server.getsockname()[1]}"
        text = refusal(make_actuator(adapter=address), AdapterUnusable)
    assert "the adapter does not answer" in text


def test_bumble_that_is_not_installed(make_actuator: MakeActuator, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "joshua_spike.bumble_backend", raising=False)
    monkeypatch.setitem(sys.modules, "bumble", None)
    text = refusal(make_actuator(adapter="usb:0"), AdapterUnusable)
    assert "run --with 'spike[bumble]'" in text


@on_linux
def test_a_machine_without_system_bus(make_actuator: MakeActuator, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nonexistent/bus")
    text = refusal(make_actuator(adapter=""), AdapterUnusable)
    assert "the default adapter: the system's Bluetooth service (BlueZ, by D-Bus) is not running" in text
    assert "systemctl start bluetooth" in text


@pytest.fixture
def empty_bus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A system bus without any service on it."""
    program = shutil.which("dbus-daemon")
    if program is None:
        pytest.skip("needs dbus-daemon")
    config = tmp_path / "bus.conf"
    path = tmp_path / "bus"
    config.write_text(
        f"<busconfig><listen>unix:path={path}</listen><auth>EXTERNAL</auth><policy context='default'>"
        "<allow send_destination='*'/><allow eavesdrop='true'/><allow own='*'/></policy></busconfig>"
    )
    monkeypatch.setenv("DBUS_SYSTEM_BUS_ADDRESS", f"unix:path={path}")
    command = [program, f"--config-file={config}", "--nofork", "--print-address"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline()  # from now on it listens
        yield
        process.terminate()


@on_linux
@pytest.mark.parametrize("adapter", ["", "hci3"])
def test_a_machine_without_bluez(make_actuator: MakeActuator, empty_bus: None, adapter: str) -> None:
    text = refusal(make_actuator(adapter=adapter), AdapterUnusable)
    assert text.startswith("adapter hci3: " if adapter else "the default adapter: ")
    assert "Bluetooth" in text
    assert "systemctl start bluetooth" in text or "bluetoothctl list" in text


@pytest.mark.parametrize(
    ("error", "cause", "remedy"),
    [
        (
            BleakBluetoothNotAvailableError("off", BleakBluetoothNotAvailableReason.POWERED_OFF),
            "Bluetooth is switched off",
            "bluetoothctl power on",
        ),
        (
            BleakBluetoothNotAvailableError("none", BleakBluetoothNotAvailableReason.NO_BLUETOOTH),
            "this machine has no working Bluetooth adapter",
            "bluetoothctl list",
        ),
        (
            BleakBluetoothNotAvailableError("no", BleakBluetoothNotAvailableReason.DENIED_BY_USER),
            "does not permit this program to use Bluetooth",
            "privacy settings",
        ),
        (BleakDBusError("org.bluez.Error.NotReady", []), "Bluetooth is switched off", "rfkill"),
        (BleakDBusError("org.freedesktop.DBus.Error.AccessDenied", []), "does not permit", "group bluetooth"),
    ],
)
def test_what_bleak_says_of_an_adapter_gets_a_remedy(error: Exception, cause: str, remedy: str) -> None:
    problem = adapter_problem("adapter hci0", error)
    assert str(problem).startswith("adapter hci0: ")
    assert cause in str(problem)
    assert remedy in str(problem)


def test_an_error_of_the_link_is_no_error_of_the_adapter() -> None:
    assert adapter_problem("adapter hci0", BleakDBusError("org.bluez.Error.Failed", ["le-abort"])) is None
