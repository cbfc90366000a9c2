"""What goes wrong with encoders, and what the user is told."""

from __future__ import annotations

import errno
import itertools
import os
import signal
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
from eventually import eventually
from joshua.devices.context import SensorContext
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua.guardian.silence import AwakeClock
from joshua.node.errors import Cancelled
from joshua.plan import SensorFacts
from joshua_emulator import EmulatedEncoder, EmulatedLidar
from joshua_encoder.encoder import SerialEncoder
from joshua_encoder.sources import STALE_S, Amt21Source
from joshua_serial.errors import PortBusy, PortNotFound
from joshua_serial.port import SerialPort

Start = Callable[..., EmulatedEncoder]
Make = Callable[..., SerialEncoder]


def refusal(encoder: SerialEncoder, kind: type[DeviceError] = DeviceError) -> str:
    with pytest.raises(kind) as caught:
        encoder.connect()
    assert not encoder.connected
    return str(caught.value)


def loss(encoder: SerialEncoder, timeout_s: float = 60.0) -> str:
    deadline_s = time.monotonic() + timeout_s
    while time.monotonic() < deadline_s:
        try:
            encoder.read(0.2)
        except DeviceDisconnected as error:
            return str(error)
    raise AssertionError("the loss was not noticed")


def not_9600(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets the adapter be one that cannot run at every line speed."""
    apply_speed = SerialPort._apply_speed

    def apply(port: SerialPort, baudrate: int) -> None:
        if baudrate == 9_600:
            raise OSError(errno.EINVAL, "Invalid argument")
        apply_speed(port, baudrate)

    monkeypatch.setattr(SerialPort, "_apply_speed", apply)


def test_no_such_port(encoder_at: Make) -> None:
    assert "/dev/ttyACM_none: no such serial port" in refusal(encoder_at("/dev/ttyACM_none"), PortNotFound)


def test_a_port_in_use(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("line")
    first = encoder_at(emulator.port)
    first.connect()
    text = refusal(encoder_at(emulator.port), PortBusy)
    assert f"(process {os.getpid()}, this one)" in text


@pytest.mark.parametrize(("kind", "baudrate"), [("line", 115_200), ("amt21", 2_000_000)])
def test_a_run_that_ends_is_not_kept_waiting(
    emulator_of: Start, encoder_at: Make, kind: str, baudrate: int
) -> None:
    emulator = emulator_of(kind, baudrate=baudrate, fault=["silent"])
    encoder = encoder_at(emulator.port, kind, baudrate)
    asked = itertools.count()
    encoder.context = SensorContext(SensorFacts(), stopping=lambda: next(asked) > 2)
    with pytest.raises(Cancelled):
        encoder.connect()
    assert not encoder.connected
    assert not encoder._port.is_open


def test_nothing_comes(emulator_of: Start, encoder_at: Make) -> None:
    text = refusal(encoder_at(emulator_of("line", fault=["silent"]).port))
    assert (
        "the encoder sends nothing: check cable and power, that the program on its microcontroller runs"
        in text
    )


def test_the_wrong_line_speed(emulator_of: Start, encoder_at: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    not_9600(monkeypatch)
    text = refusal(encoder_at(emulator_of("line", baudrate=57_600).port))
    assert "no line is valid at 115200 bit/s, but lines are at 57600: set baudrate: 57600" in text


def test_what_comes_is_something_else(encoder_at: Make) -> None:
    with EmulatedLidar("ld19") as scanner:
        text = refusal(encoder_at(scanner.port, "", 230_400))
    assert "the data are not lines of counts" in text
    assert "a line is COUNT, or COUNT,MICROSECONDS" in text


def test_counts_are_no_angles(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("line", resolution=1_000_000)
    while abs(emulator.ask("state")["angle_rad"]) < 0.5:  # well beyond 4095 counts
        time.sleep(0.01)
    emulator.fault("stall")
    text = refusal(encoder_at(emulator.port, "as5600"))
    assert "the data are not lines of angles from 0 to 4095, such as " in text


def test_no_magnet(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("as5600", fault=["no_magnet"])
    encoder = encoder_at(emulator.port, "as5600")
    assert "the AS5600 detects no magnet: place the magnet 0.5 to 3 mm" in refusal(encoder)
    emulator.ask("clear_faults")
    encoder.connect()
    emulator.fault("no_magnet")
    assert "the AS5600 detects no magnet" in loss(encoder)


def test_an_encoder_that_falls_silent(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("line")
    encoder = encoder_at(emulator.port)
    encoder.connect()
    emulator.fault("silent")
    assert "the encoder has sent nothing for 1 s" in loss(encoder)


@pytest.mark.parametrize(("kind", "baudrate"), [("line", 115_200), ("amt21", 2_000_000)])
def test_a_machine_that_gives_nobody_its_time_is_no_silence(
    emulator_of: Start, encoder_at: Make, kind: str, baudrate: int
) -> None:
    emulator = emulator_of(kind, baudrate=baudrate)
    encoder = encoder_at(emulator.port, kind, baudrate)
    encoder.connect()
    emulator.fault("silent")
    encoder.read(0.1)
    held_up_s = 0.0
    source = encoder._source
    assert source is not None
    source._awake = AwakeClock(lambda: time.monotonic() + held_up_s)
    source._good_s = source._byte_s = source._awake.now_s()  # type: ignore[attr-defined]
    held_up_s = 30.0  # the encoder has said nothing meanwhile, for its process was held up, too
    encoder.read(0.1)
    emulator.ask("clear_faults")
    assert encoder.read(30.0) is not None


def test_the_same_line_again_and_again_is_stale(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("line")
    encoder = encoder_at(emulator.port)
    encoder.connect()
    # The last line that was sent is repeated: it must be one at the speed of the port.
    assert encoder.read(30.0) is not None
    emulator.fault("freeze")
    assert "the encoder repeats the same time" in loss(encoder)


def test_a_line_speed_that_changes(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("line")
    encoder = encoder_at(emulator.port)
    encoder.connect()
    emulator.fault("rate", 9600)
    text = loss(encoder)
    assert "no valid line received for 1 s" in text or "has sent nothing for 1 s" in text


def test_a_shaft_that_is_held_is_no_fault(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("as5600")
    encoder = encoder_at(emulator.port, "as5600")
    encoder.connect()
    emulator.fault("stall")

    def speeds(count: int) -> set[tuple[float, ...]]:
        found = [encoder.read(0.2) for _ in range(count)]
        return {reading.data.velocity_rad_s for reading in found if reading is not None}

    eventually(lambda: speeds(30) == {(0.0,)}, "a shaft at rest")
    end_s = time.monotonic() + 2 * STALE_S
    while time.monotonic() < end_s:
        assert speeds(30) <= {(0.0,)}


def test_unplug_and_replug(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("line")
    encoder = encoder_at(emulator.by_id)
    encoder.connect()
    emulator.fault("unplug")
    assert "the adapter is gone" in loss(encoder)
    encoder.disconnect()
    assert "no such serial port" in refusal(encoder)
    emulator.fault("replug")
    encoder.connect()
    assert encoder.read(30.0) is not None


def test_an_amt21_at_another_address(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("amt21", baudrate=2_000_000, resolution=16384, addresses=[88, 120])
    text = refusal(encoder_at(emulator.port, "amt21", 2_000_000, resolution=16384))
    assert "no AMT21 answers at address 84 (0x54); those at 88, 120 do: correct address" in text


def test_an_amt21_that_answers_only_at_times(
    emulator_of: Start, encoder_at: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    emulator = emulator_of("amt21", baudrate=2_000_000, resolution=16384)
    answers, refused = Amt21Source._answers, [84]

    def missed(source: Amt21Source, address: int, *arguments: Any, **named: Any) -> bool:
        if address in refused:
            refused.remove(address)
            return False
        return answers(source, address, *arguments, **named)

    monkeypatch.setattr(Amt21Source, "_answers", missed)
    text = refusal(encoder_at(emulator.port, "amt21", 2_000_000, resolution=16384))
    assert "the AMT21 at address 84 (0x54) answers only intermittently: check its power" in text


def test_an_amt21_whose_first_answers_come_late_together(emulator_of: Start, encoder_at: Make) -> None:
    """As where a busy machine holds it up: a second question is under way when the first is answered."""
    emulator = emulator_of("amt21", baudrate=2_000_000, resolution=16384)
    encoder = encoder_at(emulator.port, "amt21", 2_000_000, resolution=16384)
    os.kill(emulator.pid, signal.SIGSTOP)
    threading.Timer(0.06, os.kill, (emulator.pid, signal.SIGCONT)).start()
    encoder.connect()
    assert encoder.read(30.0) is not None


def test_an_amt21_at_another_line_speed(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("amt21", baudrate=2_000_000, resolution=16384)
    text = refusal(encoder_at(emulator.port, "amt21", 115_200, resolution=16384))
    assert "at 115200 bit/s, but one does at 2000000: set baudrate: 2000000" in text


def test_no_amt21(emulator_of: Start, encoder_at: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    not_9600(monkeypatch)
    emulator = emulator_of("amt21", baudrate=2_000_000, resolution=16384, fault=["silent"])
    text = refusal(encoder_at(emulator.port, "amt21", 2_000_000, resolution=16384))
    assert "no AMT21 answers at address 84 (0x54), nor at any other: check power" in text


def test_an_amt21_that_falls_silent(emulator_of: Start, encoder_at: Make) -> None:
    emulator = emulator_of("amt21", baudrate=2_000_000, resolution=16384)
    encoder = encoder_at(emulator.port, "amt21", 2_000_000, resolution=16384)
    encoder.connect()
    emulator.fault("silent")
    assert "the AMT21 at address 84 has not answered for 1 s" in loss(encoder)
