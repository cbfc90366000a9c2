from typing import Any

import pytest
from joshua_dynamixel import registers as reg
from joshua_emulator import EmulatedBus
from joshua_servo.errors import NoReply, ServoRefused
from patience import BRISK_S, PATIENT_S

IDS = (1, 2, 3)


def position(data: bytes) -> int:
    return int.from_bytes(data[:4], "little", signed=True)


def test_registers_are_written_and_read(emulator: EmulatedBus, open_bus: Any) -> None:
    with open_bus(emulator) as bus:
        bus.write(1, reg.PROFILE_VELOCITY, 20)
        assert bus.read(1, reg.PROFILE_VELOCITY) == 20
        assert bus.read(2, reg.MODEL) == 1060
        assert all(bus.ping(servo_id) for servo_id in (1, 2, 3))
        assert str(bus.identify(1)) == "1 (xl330-m077, firmware 46)"
        assert bus.call_all(0.8) == ([1, 2, 3], False)
        bus.reply_margin_s = BRISK_S
        assert not bus.ping(4)


def test_several_servos_are_read_and_written_at_once(emulator: EmulatedBus, open_bus: Any) -> None:
    emulator.hand({1: 1000, 2: 1500, 3: 2000})
    with open_bus(emulator) as bus:
        values = bus.sync_read(132, 4, IDS)
        assert {servo_id: position(data) for servo_id, data in values.items()} == {1: 1000, 2: 1500, 3: 2000}
        bus.sync_write(116, 4, {1: b"\x00\x04\x00\x00", 3: b"\x00\x08\x00\x00"})
        bus.ping(1)  # answered after the write has been heard
        assert [servo["goal_position"] for servo in emulator.servos()] == [1024, 2048, 2048]
        assert (bus.counters.corrupt, bus.counters.stale, bus.counters.retries) == (0, 0, 0)


@pytest.mark.parametrize(
    ("register", "value", "reason"),
    [
        (reg.PRESENT_POSITION, 5, "read-only, absent, or locked while torque is on"),
        (reg.GOAL_POSITION, 5000, "exceeds a limit stored in the servo"),
        (reg.TORQUE_ENABLE, 2, "out of the register's range"),
    ],
)
def test_a_refused_write_names_servo_register_and_reason(
    register: Any, value: int, reason: str, emulator: EmulatedBus, open_bus: Any
) -> None:
    with (
        open_bus(emulator) as bus,
        pytest.raises(ServoRefused, match=rf"ttyACM0.*: id 1 refuses {register.name} = {value}: .*{reason}"),
    ):
        bus.write(1, register, value)


def test_stuffed_replies_are_read_at_once(emulator: EmulatedBus, open_bus: Any) -> None:
    """Offsets whose bytes are those of a header: the reply is longer than its data."""
    with open_bus(emulator) as bus:
        for servo_id in IDS:
            emulator.ask("set_register", id=servo_id, name="homing_offset", value=-131073)  # FF FF FD FF
        values = bus.sync_read(20, 4, IDS)
        assert {i: position(data) for i, data in values.items()} == dict.fromkeys(IDS, -131073)
        assert (bus.counters.retries, bus.counters.lost) == (0, {})
        bus.write(1, reg.HOMING_OFFSET, -131073 - 256)  # and so is the request
        assert bus.read(1, reg.HOMING_OFFSET) == -131329


def test_a_silent_servo_is_left_out_or_named(emulator: EmulatedBus, open_bus: Any) -> None:
    emulator.fault("silent", 2)
    with open_bus(emulator, reply_margin_s=BRISK_S) as bus:
        assert set(bus.sync_read(132, 4, IDS)) == {1, 3}
        with pytest.raises(
            NoReply,
            match=r"ttyACM0.*: id 2 does not answer a read: no reply to \d+ requests in .*Check its cable",
        ):
            bus.read(2, reg.MODEL)


@pytest.mark.parametrize(("address", "length"), [(0, 12), (20, 4), (31, 5), (64, 1), (126, 21), (132, 4)])
def test_padding_stays_where_there_are_registers(
    address: int, length: int, emulator: EmulatedBus, open_bus: Any
) -> None:
    with open_bus(emulator) as bus:
        sizes = set()
        for padding in range(16):
            start, size, skip = bus.padded(address, length, padding)
            assert start + skip == address
            assert length <= size - skip
            assert size <= length + padding
            bus.read_block(1, start, size)
            sizes.add(size)
        assert len(sizes) > 2


def test_a_reboot_ends_a_hardware_error(emulator: EmulatedBus, open_bus: Any) -> None:
    with open_bus(emulator) as bus:
        bus.write(1, reg.TORQUE_ENABLE, 1)
        emulator.fault("overload", 1)
        bus.sync_read(132, 4, IDS)
        assert bus.alerted(IDS) == (1,)
        assert bus.read(1, reg.HARDWARE_ERROR) == 1 << 5
        with pytest.raises(ServoRefused, match="id 1 refuses torque_enable = 1: the servo cannot execute it"):
            bus.write(1, reg.TORQUE_ENABLE, 1)
        bus.reply_margin_s = BRISK_S  # it is silent while it boots
        bus.reboot((1,))
        bus.write(1, reg.TORQUE_ENABLE, 1)
        assert emulator.servo(1)["energised"]
        assert bus.alerted(IDS) == ()
        emulator.fault("silent", 1)
        with pytest.raises(NoReply, match="id 1 does not reply after a reboot"):
            bus.reboot((1,))


def test_servos_boot_at_the_same_time(emulator: EmulatedBus, open_bus: Any) -> None:
    with open_bus(emulator) as bus:
        bus.reply_margin_s = BRISK_S
        bus.reboot(IDS)
        bus.reply_margin_s = PATIENT_S
        events = [entry["event"] for entry in emulator.log() if entry["event"] in ("reboot", "ping")]
        assert events[:3] == ["reboot"] * 3
        assert all(bus.ping(servo_id) for servo_id in IDS)


def test_an_adapter_that_echoes(open_bus: Any) -> None:
    with (
        EmulatedBus("dynamixel", ids=(1, 2), echo=True) as emulator,
        open_bus(emulator, reply_margin_s=PATIENT_S) as bus,
    ):
        emulator.hand({1: 568})
        assert bus.read(1, reg.PRESENT_POSITION) == 568
        assert position(bus.sync_read(132, 4, (1, 2))[1]) == 568
        assert bus.counters.lost == {}
