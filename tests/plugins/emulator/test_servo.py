import pytest
from joshua_emulator.feetech.registers import BY_NAME, TABLE, Status
from joshua_emulator.feetech.servo import Servo
from joshua_emulator.joint import Joint
from joshua_emulator.servo_bus.registers import Area
from joshua_emulator.servo_bus.servo import Supply

LOCK, GOAL, TORQUE = 55, 42, 40


def word(value: int) -> bytes:
    return value.to_bytes(2, "little")


def make(angle: float = 2048.0, **arguments: object) -> Servo:
    return Servo(Joint(angle), Supply(), **arguments)  # type: ignore[arg-type]


def read_word(servo: Servo, address: int, now_s: float = 1.0) -> int:
    return int.from_bytes(servo.read(address, 2, now_s), "little")


def test_registers_do_not_overlap_and_defaults_are_in_range() -> None:
    taken: set[int] = set()
    for register in TABLE:
        addresses = set(range(register.address, register.address + register.width))
        assert not taken & addresses, register.name
        taken |= addresses
        if register.area in (Area.EEPROM, Area.RAM):
            assert register.minimum <= register.default <= register.maximum, register.name


@pytest.mark.parametrize(
    ("name", "value", "raw"), [("homing_offset", -5, 0x805), ("goal_position", -1, 0x8001)]
)
def test_signed_values_are_sign_and_magnitude(name: str, value: int, raw: int) -> None:
    assert BY_NAME[name].encode(value) == raw
    assert BY_NAME[name].decode(raw) == value


def test_eeprom_writes_are_dropped_silently_while_locked() -> None:
    servo = make()
    servo.write(9, word(100), 1.0)
    assert servo.get("min_position_limit") == 0
    servo.write(LOCK, b"\0", 1.1)
    servo.write(9, word(100), 1.2)
    assert servo.get("min_position_limit") == 100
    servo.write(LOCK, b"\1", 1.3)
    servo.write(9, word(200), 1.4)
    assert servo.get("min_position_limit") == 100


def test_read_only_registers_and_values_out_of_range_are_dropped() -> None:
    servo = make()
    servo.write(LOCK, b"\0", 1.0)
    servo.write(3, word(1), 1.1)
    servo.write(56, word(1), 1.2)
    servo.write(6, b"\x09", 1.3)
    assert (servo.get("model_number"), servo.get("baudrate")) == (777, 0)
    assert read_word(servo, 56) == 2048


def test_eeprom_changes_are_reported_once_each() -> None:
    images: list[bytes] = []
    servo = make(on_eeprom=images.append)
    servo.write(GOAL, word(2100), 1.0)
    servo.write(LOCK, b"\0", 1.1)
    servo.write(13, b"\x3c", 1.2)
    assert len(images) == 1
    again = make(eeprom=images[0])
    assert again.get("max_temperature") == 60


def test_a_goal_takes_the_motor_under_power() -> None:
    events: list[tuple[bool, float]] = []
    servo = make(on_torque=lambda _, on, now_s: events.append((on, now_s)))
    servo.write(GOAL, word(2500), 1.0)
    assert servo.get("torque_enable") == 1
    assert events == [(True, 1.0)]
    servo.advance(3.0)
    assert read_word(servo, 56, 3.0) == 2500
    servo.write(TORQUE, b"\0", 3.1)
    assert events[-1] == (False, 3.1)


def test_torque_on_moves_to_a_stale_goal() -> None:
    servo = make()
    servo.write(GOAL, word(2500), 1.0)
    servo.advance(3.0)
    servo.write(TORQUE, b"\0", 3.0)
    servo.joint.angle = 1000.0  # moved by hand
    servo.write(TORQUE, b"\1", 4.0)
    servo.advance(6.0)
    assert read_word(servo, 56, 6.0) == 2500


def test_the_goal_is_held_within_the_eeprom_limits() -> None:
    servo = make()
    servo.write(LOCK, b"\0", 1.0)
    servo.write(9, word(1900) + word(2200), 1.0)
    servo.write(GOAL, word(4000), 1.1)
    servo.advance(3.0)
    assert read_word(servo, 56, 3.0) == 2200


def test_goal_speed_limits_the_motion() -> None:
    servo = make(0.0)
    servo.write(41, bytes((50,)) + word(4000) + word(0) + word(500), 1.0)
    servo.advance(2.0)
    assert 350 < read_word(servo, 56, 2.0) <= 500
    assert read_word(servo, 58, 2.0) == 500


def test_homing_offset_shifts_positions_and_wraps() -> None:
    servo = make(100.0)
    servo.write(LOCK, b"\0", 1.0)
    servo.write(31, word(BY_NAME["homing_offset"].encode(300)), 1.0)
    assert read_word(servo, 56) == (100 - 300) % 4096


@pytest.mark.parametrize("angle", [5.0, 2048.0, 4095.0])
def test_torque_enable_128_makes_the_present_position_the_middle(angle: float) -> None:
    servo = make(angle)
    servo.write(TORQUE, b"\x80", 1.0)
    assert read_word(servo, 56) == 2048
    assert servo.get("torque_enable") == 0
    assert not servo.energised


def test_an_offset_beyond_the_register_is_cut() -> None:
    servo = make(0.0)
    servo.calibrate(2048, 1.0)
    assert abs(servo.get("homing_offset")) == 2047


@pytest.mark.parametrize(("goal", "sign"), [(3500, 0), (600, 1)])
def test_load_and_current_carry_their_direction_in_a_bit_of_their_own(goal: int, sign: int) -> None:
    servo = make()
    servo.joint.blocked = True
    servo.write(GOAL, word(goal), 1.0)
    servo.advance(1.5)
    load, current = read_word(servo, 60, 1.5), read_word(servo, 69, 1.5)
    assert (load >> 10, load & 0x3FF) == (sign, 1000)
    assert current >> 15 == sign
    assert 0 < current & 0x7FFF < 1000


def test_overload_cuts_the_torque_after_its_time_until_torque_is_set_again() -> None:
    servo = make()
    servo.joint.blocked = True
    servo.write(GOAL, word(3500), 1.0)
    servo.advance(1.5)
    servo.advance(2.0)
    assert servo.status == 0
    assert read_word(servo, 60, 2.0) == 1000
    for tenth in range(20, 45):
        servo.advance(tenth / 10)
    assert servo.status & Status.OVERLOAD
    assert read_word(servo, 60, 5.0) == 200
    servo.write(TORQUE, b"\1", 5.1)
    servo.advance(5.2)
    assert not servo.status & Status.OVERLOAD


def test_over_temperature_takes_the_power_off() -> None:
    servo = make()
    servo.write(GOAL, word(2500), 1.0)
    servo.joint.temperature_c = 80.0
    servo.advance(1.1)
    servo.advance(1.2)
    assert servo.status & Status.TEMPERATURE
    assert servo.get("torque_enable") == 1
    assert not servo.energised


def test_a_power_cut_keeps_the_eeprom_and_nothing_else() -> None:
    servo = make()
    servo.write(LOCK, b"\0", 1.0)
    servo.write(13, b"\x3c", 1.0)
    servo.write(GOAL, word(2500), 1.1)
    servo.advance(2.0)
    servo.power_on(2.1)
    assert (servo.get("max_temperature"), servo.get("lock"), servo.get("torque_enable")) == (60, 1, 0)
    assert servo.get("goal_position") == 2500 == servo.present()
    assert servo.silent_until_s > 2.1


def test_step_mode_moves_by_the_goal_once() -> None:
    servo = make(1000.0)
    servo.write(LOCK, b"\0", 1.0)
    servo.write(33, b"\3", 1.0)
    servo.write(GOAL, word(BY_NAME["goal_position"].encode(-200)), 1.1)
    servo.write(48, word(900), 1.2)  # another register does not step again
    servo.advance(3.0)
    assert servo.joint.angle == pytest.approx(800.0)


def test_velocity_mode_turns_at_the_goal_speed() -> None:
    servo = make(1000.0)
    servo.write(LOCK, b"\0", 1.0)
    servo.write(33, b"\1", 1.0)
    servo.write(46, word(BY_NAME["goal_speed"].encode(-500)), 1.1)
    servo.write(TORQUE, b"\1", 1.1)
    servo.advance(2.1)
    assert servo.joint.velocity == pytest.approx(-500.0)
