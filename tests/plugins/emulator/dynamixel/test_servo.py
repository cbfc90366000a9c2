import pytest
from joshua_emulator.dynamixel.models import MODELS
from joshua_emulator.dynamixel.packets import ProtocolError
from joshua_emulator.dynamixel.registers import BY_NAME, TABLE, Hardware, OperatingMode
from joshua_emulator.dynamixel.servo import Servo
from joshua_emulator.joint import Joint
from joshua_emulator.servo_bus.servo import Supply


def make(model: str = "xl330-m077", angle: float = 2048.0, mode: int = OperatingMode.POSITION) -> Servo:
    servo = Servo(MODELS[model], Joint(angle), Supply(MODELS[model].volts))
    servo.put("operating_mode", mode)
    servo.power_on()
    servo.advance(0.0)
    return servo


def write(servo: Servo, name: str, value: int, now_s: float = 0.0) -> ProtocolError:
    register = BY_NAME[name]
    raw = register.encode(value).to_bytes(register.width, "little")
    return servo.write(register.address, raw, now_s)


def run(servo: Servo, seconds: float, start_s: float = 0.0) -> float:
    for step in range(1, int(seconds * 100) + 1):
        servo.advance(start_s + step / 100)
    return start_s + seconds


def test_registers_do_not_overlap_and_defaults_are_in_range() -> None:
    end = 0
    for register in sorted(TABLE, key=lambda register: register.address):
        assert register.address >= end, register.name
        end = register.address + register.width
    for model in MODELS.values():
        for name, value in model.defaults.items():
            assert BY_NAME[name].minimum <= value <= BY_NAME[name].maximum, (model.name, name)


def test_the_eeprom_is_locked_while_torque_is_on() -> None:
    servo = make()
    assert write(servo, "max_temperature", 60) == ProtocolError.NONE
    write(servo, "torque_enable", 1)
    assert write(servo, "max_temperature", 50) == ProtocolError.ACCESS
    assert servo.get("max_temperature") == 60
    write(servo, "torque_enable", 0)
    assert write(servo, "max_temperature", 50) == ProtocolError.NONE


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("present_position", 5, ProtocolError.ACCESS),
        ("torque_enable", 2, ProtocolError.DATA_RANGE),
        ("goal_position", 4096, ProtocolError.DATA_LIMIT),
        ("profile_velocity", 1621, ProtocolError.DATA_LIMIT),
        ("profile_velocity", 1620, ProtocolError.NONE),
    ],
)
def test_a_write_is_refused_with_its_reason(name: str, value: int, error: ProtocolError) -> None:
    assert write(make(), name, value) == error


def test_a_write_that_is_refused_in_part_changes_nothing() -> None:
    servo = make()
    data = (100).to_bytes(4, "little") + (2000).to_bytes(4, "little") + (9999).to_bytes(4, "little")
    assert servo.write(108, data, 0.0) == ProtocolError.DATA_LIMIT
    assert servo.get("profile_acceleration") == 0
    assert servo.write(116, b"\x01\x02", 0.0) == ProtocolError.DATA_LENGTH


def test_a_goal_is_reached_at_the_profile_velocity_and_only_with_torque() -> None:
    servo = make()
    write(servo, "goal_position", 3000)
    run(servo, 1.0)
    assert servo.present() == 2048
    write(servo, "profile_velocity", 20, 1.0)  # 312 ticks/s
    write(servo, "torque_enable", 1, 1.0)
    run(servo, 1.0, 1.0)
    assert 2340 < servo.present() < 2370
    run(servo, 4.0, 2.0)
    assert servo.present() == 3000


def test_the_homing_offset_is_added_and_limited_in_position_mode() -> None:
    joint_mode, multi_turn = make(), make(mode=OperatingMode.EXTENDED_POSITION)
    write(multi_turn, "homing_offset", -1500)
    assert multi_turn.present() == 548
    write(joint_mode, "homing_offset", -1024)
    assert joint_mode.present() == 1024
    write(joint_mode, "homing_offset", -1500)
    assert joint_mode.present() == 2048  # ignored
    assert multi_turn.calibration()["homing_offset"] == 1500


def test_turns_are_counted_until_the_power_goes() -> None:
    servo = make(mode=OperatingMode.EXTENDED_POSITION)
    servo.joint.angle = 5000.0
    assert servo.present() == 5000
    servo.power_on(1.0)
    assert servo.present() == 5000 - 4096


def test_torque_in_position_mode_forgets_turns() -> None:
    servo = make()
    servo.joint.angle = 5000.0
    assert servo.present() == 5000
    write(servo, "torque_enable", 1)
    assert servo.present() == 904


def test_a_shutdown_takes_the_torque_until_a_reboot() -> None:
    servo = make()
    write(servo, "torque_enable", 1)
    servo.overload(0.1)
    assert (servo.energised, servo.get("torque_enable"), servo.status) == (False, 0, Hardware.OVERLOAD)
    assert servo.alert == 0x80
    assert write(servo, "torque_enable", 1, 0.2) == ProtocolError.RESULT_FAIL
    servo.power_on(0.3)
    assert servo.status == 0
    assert write(servo, "torque_enable", 1, 0.4) == ProtocolError.NONE


def test_a_blocked_joint_overloads_after_a_while() -> None:
    servo = make()
    write(servo, "torque_enable", 1)
    servo.joint.blocked = True
    write(servo, "goal_position", 4000)
    run(servo, 0.5)
    assert servo.status == 0
    run(servo, 1.0, 0.5)
    assert servo.status == Hardware.OVERLOAD


@pytest.mark.parametrize(("model", "keeps_torque"), [("xl330-m077", False), ("xm430-w350", True)])
def test_a_low_supply_is_reported_and_shuts_some_models_down(model: str, keeps_torque: bool) -> None:
    servo = make(model)
    write(servo, "torque_enable", 1)
    servo.supply.volts = servo.low_volts
    servo.advance(0.1)
    assert servo.status & Hardware.VOLTAGE
    assert servo.energised == keeps_torque


def test_the_load_is_a_current_or_a_share() -> None:
    loads = {}
    for model in ("xl330-m077", "xl430-w250", "xm430-w350"):
        servo = make(model)
        servo.joint.load = -0.5
        servo._measure()
        loads[model] = servo.get("present_load")
    assert loads == {"xl330-m077": -735, "xl430-w250": -500, "xm430-w350": -428}


def test_there_is_nothing_to_read_where_there_is_no_register() -> None:
    servo = make()
    assert servo.read(660, 3, 0.0) == (ProtocolError.ACCESS, b"")
    assert servo.read(64, 3, 0.0) == (ProtocolError.ACCESS, b"")  # nothing at 66
    assert servo.read(0, 2, 0.0) == (ProtocolError.NONE, (1190).to_bytes(2, "little"))
