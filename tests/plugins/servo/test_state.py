"""The state of an arm and its time, on a bus that keeps its replies back."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from typing import Any

import pytest
from joshua_emulator import EmulatedBus
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
from joshua_servo.errors import NoReply
from joshua_servo.state import COHERENT_NS, StateReader
from servo_families import Kind

IDS = (1, 2, 3)
AMPLITUDE_RAD, FREQUENCY_HZ, PHASE_RAD = 1.0, 1.0, 0.7
FASTEST_TICKS_S = AMPLITUDE_RAD * FREQUENCY_HZ * 4096


def note_spreads(reader: StateReader) -> list[int]:
    """How long each reading takes from now on, in ns."""
    spreads_ns: list[int] = []
    timed = reader._timed

    def noted(within_s: float) -> Any:
        found = timed(within_s)
        spreads_ns.append(found[2])
        return found

    reader._timed = noted  # type: ignore[method-assign]
    return spreads_ns


def test_the_stamp_is_that_of_the_positions_after_a_silence(kind: Kind, emulator: EmulatedBus) -> None:
    emulator.ask("motion", kind="sine", amplitude_rad=AMPLITUDE_RAD, frequency_hz=FREQUENCY_HZ)
    start_s = emulator.log("motion")[-1]["t_ns"] / 1e9
    epoch_s = time.time() - time.monotonic()
    time.sleep(max(0.0, start_s + 1.0 - time.monotonic()))  # until it swings as far as it will
    with kind.open_bus(emulator) as bus:
        parse = kind.family.parse_feedback
        names = {servo_id: str(servo_id) for servo_id in IDS}
        reader = StateReader(bus, kind.family, names, lambda values: [parse(value) for value in values])
        spreads_ns = note_spreads(reader)
        deadline_s = time.monotonic() + 60
        while True:
            assert time.monotonic() < deadline_s, spreads_ns
            spreads_ns.clear()
            emulator.ask("set", silent=True)
            # The second attempt is lost, too, and the third comes before the reader gives up.
            timer = threading.Timer(0.03, lambda: emulator.ask("set", silent=False))
            timer.start()
            while True:
                with contextlib.suppress(NoReply):  # on a busy machine
                    readings, stamp_ns = reader.feedback()
                    break
            timer.join()
            first_ns, again_ns = [0, 0, *spreads_ns][-2:]
            if first_ns > COHERENT_NS > again_ns:  # unless a busy machine had it otherwise
                break
    time_s = stamp_ns / 1e9 - epoch_s - start_s
    phases = [math.tau * FREQUENCY_HZ * time_s + PHASE_RAD * index for index in range(3)]
    truth = [2048 + AMPLITUDE_RAD * math.sin(phase) * 4096 / math.tau for phase in phases]
    assert [reading.position for reading in readings] == pytest.approx(truth, abs=FASTEST_TICKS_S * 0.03)


def test_a_slow_line_is_read_once(kind: Kind) -> None:
    baudrate = 38_400 if kind.protocol == "feetech" else 57_600
    ids = (1, 2, 3, 4, 5, 6)
    with kind.emulated_bus(ids, baudrate=baudrate) as emulator:
        port = SerialPort(Endpoint(emulator.port), baudrate)
        port.open()
        bus = kind.bus(port)
        reader = StateReader(bus, kind.family, dict.fromkeys(ids, ""), list)  # type: ignore[arg-type]
        began_s = time.monotonic()
        reader.feedback()
        took_s = time.monotonic() - began_s
        assert took_s > 0.03, "the replies alone take longer than what counts as one moment"
        assert bus.counters.requests == 1 or took_s > 0.06, "a machine that was busy reads again"
        port.close()
