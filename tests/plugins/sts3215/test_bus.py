import math
import time
from typing import Any

import pytest
from joshua.devices.serial_errors import PortDisconnected
from joshua.devices.servo.errors import NoReply
from joshua_emulator import EmulatedBus
from joshua_sts3215 import registers as reg

IDS = (1, 2, 3)


def word(data: bytes) -> int:
    return int.from_bytes(data[:2], "little")


def test_registers_are_written_and_read(emulator: EmulatedBus, open_bus: Any) -> None:
    with open_bus(emulator) as bus:
        bus.write(1, reg.ACCELERATION, 20)
        assert bus.read(1, reg.ACCELERATION) == 20
        assert bus.read(2, reg.MODEL) == 777
        assert [bus.ping(servo_id) for servo_id in (1, 2, 3, 4)] == [True, True, True, False]


def test_several_servos_are_read_and_written_at_once(emulator: EmulatedBus, open_bus: Any) -> None:
    emulator.hand({1: 1000, 2: 1500, 3: 2000})
    with open_bus(emulator) as bus:
        values = bus.sync_read(56, 15, IDS)
        assert {servo_id: word(data) for servo_id, data in values.items()} == {1: 1000, 2: 1500, 3: 2000}
        assert all(len(data) == 15 for data in values.values())
        bus.sync_write(42, 2, {1: b"\x00\x04", 3: b"\x00\x08"})
        bus.ping(1)  # answered after the write has been heard
        assert [servo["goal_position"] for servo in emulator.servos()] == [1024, 2048, 2048]
        assert (bus.counters.corrupt, bus.counters.stale, bus.counters.retries) == (0, 0, 0)


def test_eeprom_is_unlocked_written_read_back_and_locked(emulator: EmulatedBus, open_bus: Any) -> None:
    with open_bus(emulator) as bus:
        bus.write(1, reg.MAX_TEMPERATURE, 60)  # locked: dropped without a word
        assert bus.read(1, reg.MAX_TEMPERATURE) == 70
        bus.write_eeprom(1, {reg.MAX_TEMPERATURE: 60, reg.HOMING_OFFSET: -300})
        assert emulator.ask("registers", id=1)["registers"]["homing_offset"] == -300
        assert emulator.servo(1)["lock"] == 1
        with pytest.raises(NoReply, match=r"id 1 keeps mode at 0 instead of 7\. Check the supply"):
            bus.write_eeprom(1, {reg.MODE: 7})
        assert emulator.servo(1)["lock"] == 1


@pytest.mark.parametrize("kind", ["drop", "drop_request", "corrupt"])
def test_lost_and_corrupt_packets_are_asked_for_again(
    kind: str, emulator: EmulatedBus, open_bus: Any
) -> None:
    emulator.hand({1: 1000, 2: 1500, 3: 2000})
    emulator.fault(kind, 0.3)
    with open_bus(emulator, retries=12) as bus:
        for _ in range(20):
            values = bus.sync_read(56, 2, IDS)
            assert {servo_id: word(data) for servo_id, data in values.items()} == {1: 1000, 2: 1500, 3: 2000}
        assert bus.counters.retries > 0
        assert sum(bus.counters.lost.values()) > 0
        assert bool(bus.counters.corrupt) == (kind == "corrupt")


@pytest.mark.parametrize("late_by_s", [0.004, 0.022, 0.06])
def test_a_late_reply_never_passes_for_the_next_one(
    late_by_s: float, emulator: EmulatedBus, open_bus: Any
) -> None:
    """The joints move; each accepted position must be one that its joint had since the request was sent."""
    emulator.fault("late", 0.05, late_by_s=late_by_s)
    emulator.fault("drop", 0.02)
    emulator.ask("motion", kind="sine", amplitude_rad=1.2, frequency_hz=0.8)
    start_s = emulator.log("motion")[-1]["t_ns"] / 1e9

    def position(servo_id: int, time_s: float) -> float:
        elapsed_s = max(0.0, time_s - start_s)
        phase = math.tau * 0.8 * elapsed_s + 0.7 * (servo_id - 1)
        return 2048 + min(1.0, elapsed_s) * 1.2 * math.sin(phase) * 4096 / math.tau

    with open_bus(emulator, retries=8) as bus:
        for _ in range(200):
            sent_s = time.monotonic()
            values = bus.sync_read(56, 2, IDS)
            span_s = time.monotonic() - sent_s + 0.002  # a request is carried out when its last byte is heard
            for servo_id in IDS:
                possible = [position(servo_id, sent_s + span_s * share / 20) for share in range(21)]
                assert min(possible) - 3 <= word(values[servo_id]) <= max(possible) + 3
        assert bus.counters.stale + sum(bus.counters.lost.values()) > 0


def test_a_servo_that_stays_silent_is_left_out_or_named(emulator: EmulatedBus, open_bus: Any) -> None:
    emulator.fault("silent", 2)
    with open_bus(emulator) as bus:
        assert set(bus.sync_read(56, 2, IDS)) == {1, 3}
        assert bus.counters.lost == {2: 5}
        with pytest.raises(
            NoReply, match=r"ttyACM0.*: id 2 does not answer a read in 5 attempts\. Check its cable"
        ):
            bus.read(2, reg.MODEL)
        with pytest.raises(NoReply, match="id 2 does not answer a write of lock"):
            bus.write(2, reg.LOCK, 0)


def test_an_adapter_that_echoes(open_bus: Any) -> None:
    with EmulatedBus(ids=(1, 2), echo=True) as emulator, open_bus(emulator) as bus:
        emulator.hand({1: 568})  # with an encoder fault its reply would equal the request
        assert bus.read(1, reg.PRESENT_POSITION) == 568
        assert word(bus.sync_read(56, 2, (1, 2))[1]) == 568
        bus.write(1, reg.ACCELERATION, 7)
        assert bus.read(1, reg.ACCELERATION) == 7
        assert bus.counters.lost == {}


def test_status_bits_of_replies_are_kept(emulator: EmulatedBus, open_bus: Any) -> None:
    emulator.fault("overload", 2)
    with open_bus(emulator) as bus:
        bus.sync_read(56, 2, IDS)
        assert bus.status == {1: 0, 2: 1 << 5, 3: 0}


def test_unplugging_ends_a_request_at_once(emulator: EmulatedBus, open_bus: Any) -> None:
    with open_bus(emulator) as bus:
        emulator.fault("unplug")
        emulator.wait_for(["unplug"])
        with pytest.raises(PortDisconnected):
            bus.sync_read(56, 2, IDS)


def test_requests_are_padded_for_a_while_after_a_loss_only(emulator: EmulatedBus, open_bus: Any) -> None:
    with open_bus(emulator) as bus:
        assert bus._next_padding() == 0
        bus.ping(9)
        assert [bus._next_padding() for _ in range(16)] == [*range(1, 16), 1]
        deadline_s = time.monotonic() + 10
        while bus._next_padding() and time.monotonic() < deadline_s:
            time.sleep(0.02)
        assert bus._next_padding() == 0
