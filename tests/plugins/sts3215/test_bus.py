from typing import Any

import pytest
from joshua_emulator import EmulatedBus
from joshua_servo.errors import NoReply
from joshua_sts3215 import registers as reg
from patience import BRISK_S

IDS = (1, 2, 3)


def word(data: bytes) -> int:
    return int.from_bytes(data[:2], "little")


def test_registers_are_written_and_read(emulator: EmulatedBus, open_bus: Any) -> None:
    with open_bus(emulator) as bus:
        bus.write(1, reg.ACCELERATION, 20)
        assert bus.read(1, reg.ACCELERATION) == 20
        assert bus.read(2, reg.MODEL) == 777
        assert all(bus.ping(servo_id) for servo_id in (1, 2, 3))
        bus.reply_margin_s = BRISK_S
        assert not bus.ping(4)


def test_eeprom_is_unlocked_written_read_back_and_locked(emulator: EmulatedBus, open_bus: Any) -> None:
    with open_bus(emulator) as bus:
        with pytest.raises(NoReply, match=r"id 1 keeps max_temperature at 70 instead of 60\."):
            bus.write(1, reg.MAX_TEMPERATURE, 60)  # locked: dropped without a word
        assert bus.read(1, reg.MAX_TEMPERATURE) == 70
        bus.write_eeprom(1, {reg.MAX_TEMPERATURE: 60, reg.HOMING_OFFSET: -300})
        assert emulator.ask("registers", id=1)["registers"]["homing_offset"] == -300
        assert emulator.servo(1)["lock"] == 1
        with pytest.raises(NoReply, match=r"id 1 keeps mode at 0 instead of 7\. Check the supply"):
            bus.write_eeprom(1, {reg.MODE: 7})
        assert emulator.servo(1)["lock"] == 1


def test_status_bits_of_replies_are_kept(emulator: EmulatedBus, open_bus: Any) -> None:
    emulator.fault("overload", 2)
    with open_bus(emulator) as bus:
        bus.sync_read(56, 2, IDS)
        assert bus.status == {1: 0, 2: 1 << 5, 3: 0}


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
