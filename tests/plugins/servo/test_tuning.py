"""Settings of single servos: written before torque, read back, and restored where they are in the EEPROM."""

from __future__ import annotations

from typing import Any

import pytest
from joshua_emulator import EmulatedBus
from joshua_servo.errors import NoReply
from patience import BRISK_S
from servo_families import DYNAMIXEL_KIND, STS3215_KIND, Kind

#: Registers of a gripper with the defaults, and of a servo whose settings a file names, by protocol.
GRIPPER = {
    "feetech": {"torque_limit": 500, "protection_current": 250, "overload_torque": 25, "position_p": 16},
    "dynamixel": {"goal_pwm": 442},
}
NAMED: dict[str, tuple[dict[str, float], dict[str, int]]] = {
    "feetech": (
        {
            "torque_limit_percent": 80, "protection_current_ma": 1300, "overload_torque_percent": 60,
            "overload_time_s": 1.5, "position_p": 20, "position_i": 1, "position_d": 30, "acceleration": 40,
        },
        {
            "torque_limit": 800, "protection_current": 200, "overload_torque": 60, "protection_time": 150,
            "position_p": 20, "position_i": 1, "position_d": 30, "acceleration": 40,
        },
    ),
    "dynamixel": (
        {
            "torque_limit_percent": 80, "current_limit_ma": 300, "position_p": 400, "position_i": 10,
            "position_d": 20, "acceleration": 40,
        },
        {
            "goal_pwm": 708, "goal_current": 300, "position_p": 400, "position_i": 10, "position_d": 20,
            "profile_acceleration": 40,
        },
    ),
}  # fmt: skip


def registers(emulator: EmulatedBus, servo_id: int, names: Any) -> dict[str, int]:
    held = emulator.ask("registers", id=servo_id)["registers"]
    return {name: held[name] for name in names}


def test_a_gripper_has_safe_defaults_and_the_other_servos_keep_their_own(
    kind: Kind, arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    expected = GRIPPER[kind.protocol]
    factory = registers(arm_emulator, 5, expected)
    arm = make_arm(arm_emulator)
    arm.connect()
    assert registers(arm_emulator, 6, expected) == factory, "connecting writes nothing"
    arm.enable()
    assert registers(arm_emulator, 6, expected) == expected
    assert registers(arm_emulator, 5, expected) == factory


def test_settings_of_a_servo_go_before_those_of_all_and_before_the_defaults(
    kind: Kind, arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    values, expected = NAMED[kind.protocol]
    factory = registers(arm_emulator, 2, ["position_i"])
    arm = make_arm(arm_emulator, joint=[{"position_p": 77, "position_d": 11}, {"motor_id": 6, **values}])
    arm.connect()
    arm.enable()
    assert registers(arm_emulator, 6, expected) == expected
    assert registers(arm_emulator, 2, ["position_p", "position_d"]) == {"position_p": 77, "position_d": 11}
    assert registers(arm_emulator, 2, ["position_i"]) == factory


def test_a_servo_that_is_no_gripper_by_the_file_keeps_its_values(
    kind: Kind, arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    names = GRIPPER[kind.protocol]
    factory = registers(arm_emulator, 6, names)
    arm = make_arm(arm_emulator, joint=[{"motor_id": 6, "gripper": False}, {"motor_id": 1, "gripper": True}])
    arm.connect()
    arm.enable()
    assert registers(arm_emulator, 6, names) == factory
    assert registers(arm_emulator, 1, names) == GRIPPER[kind.protocol]


def test_a_dry_run_writes_no_settings(kind: Kind, arm_emulator: EmulatedBus, make_arm: Any) -> None:
    factory = registers(arm_emulator, 6, GRIPPER[kind.protocol])
    arm = make_arm(arm_emulator, {"dry_run": True})
    arm.connect()
    arm.enable()
    assert registers(arm_emulator, 6, GRIPPER[kind.protocol]) == factory


@pytest.fixture
def feetech_arm() -> Any:
    with STS3215_KIND.emulated_arm() as emulator:
        yield emulator


EEPROM = ("protection_current", "overload_torque", "position_p")


def test_the_eeprom_is_restored_at_the_end_also_with_torque(feetech_arm: EmulatedBus) -> None:
    factory = registers(feetech_arm, 6, EEPROM)
    arm = STS3215_KIND.driver(feetech_arm)
    arm.connect()
    arm.enable()
    assert registers(feetech_arm, 6, EEPROM) != factory
    arm.hold()
    arm.disconnect()
    assert registers(feetech_arm, 6, EEPROM) == factory
    assert feetech_arm.servo(6)["lock"] == 1
    assert feetech_arm.servo(6)["energised"], "the torque stays as it is"


def test_a_servo_without_reply_keeps_its_settings_and_delays_nobody(
    feetech_arm: EmulatedBus, caplog: pytest.LogCaptureFixture
) -> None:
    arm = STS3215_KIND.driver(feetech_arm)
    arm.connect()
    arm.enable()
    feetech_arm.fault("silent", 6)
    arm.bus.reply_margin_s = BRISK_S
    with pytest.raises(NoReply):
        arm.read()
    requests = arm.bus.counters.requests
    arm.disconnect()
    assert arm.bus.counters.requests == requests
    assert "ids 6 keep the settings of this run in their EEPROM" in caplog.text


def test_the_guardian_restores_what_a_killed_driver_changed(feetech_arm: EmulatedBus) -> None:
    factory = registers(feetech_arm, 6, EEPROM)
    arm = STS3215_KIND.driver(feetech_arm)
    arm.connect()
    arm.enable()
    values = arm.safe_stop_request("HOLD").to_values()
    arm._port.close()  # as a driver that is killed
    report = STS3215_KIND.stop(STS3215_KIND.stop_request.from_values(values))
    assert report.complete
    assert registers(feetech_arm, 6, EEPROM) == factory


def test_a_servo_that_does_not_answer_the_read_of_its_settings_is_named(
    feetech_arm: EmulatedBus,
) -> None:
    arm = STS3215_KIND.driver(feetech_arm)
    arm.connect()
    feetech_arm.fault("silent", 6)
    arm.bus.reply_margin_s = BRISK_S
    try:
        with pytest.raises(NoReply, match="ids 6 do not answer a read of their settings"):
            arm._tuning.apply()
    finally:
        arm.disconnect()


@pytest.mark.parametrize("kind", [STS3215_KIND, DYNAMIXEL_KIND], ids=lambda kind: kind.protocol)
@pytest.mark.parametrize(
    ("joint", "problem"),
    [
        ([{"motor_id": 9}], r"the bus has no servo 9"),
        ([{"motor_id": 2}, {"motor_id": 2}], "servo 2 has an entry already"),
        ([{}, {}], "every servo has an entry already"),
    ],
)
def test_entries_that_do_not_fit_the_bus_are_refused(kind: Kind, joint: Any, problem: str) -> None:
    values = {"port": "/dev/ttyACM0", "motor_ids": [1, 2], "joint": joint, **kind.settings}
    with pytest.raises(ValueError, match=problem):
        kind.settings_type.model_validate(values)


def test_a_model_that_measures_no_current_has_no_current_limit() -> None:
    values = {
        "port": "/dev/ttyACM0",
        "motor_ids": [1],
        "models": ["xl430-w250"],
        "joint": [{"current_limit_ma": 300}],
    }
    with pytest.raises(
        ValueError, match="an xl430-w250 has no current limit, because it measures load instead of current"
    ):
        DYNAMIXEL_KIND.settings_type.model_validate(values)
