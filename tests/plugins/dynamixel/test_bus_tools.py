from __future__ import annotations

import pytest
from joshua_emulator import EmulatedBus
from joshua_servo.bus_tools import AssignmentFailed, FoundMotor
from joshua_servo.servo_bus_tools import ServoBusTools
from servo_families import DYNAMIXEL_KIND

tools_on = DYNAMIXEL_KIND.open_tools


def registers(emulator: EmulatedBus, slot: int = 0) -> dict[str, int]:
    return dict(emulator.ask("registers", slot=slot)["registers"])


def first(tools: ServoBusTools, baudrate: int) -> FoundMotor:
    return next(tools.scan((baudrate,)))


def test_all_servos_of_a_chain_are_found_and_described(emulator: EmulatedBus) -> None:
    emulator.fault("overload", 2)
    with tools_on(emulator) as tools:
        found = list(tools.scan((1_000_000,)))
    assert [str(motor) for motor in found] == [
        "1 (xl330-m077, firmware 46)",
        "2 (xl430-w250, firmware 46)",
        "3 (xl430-w250, firmware 46)",
    ]
    assert (found[0].voltage_v, found[0].min_voltage_v, found[0].max_voltage_v) == (5.0, 3.5, 7.0)
    assert (found[1].max_temperature_c, found[1].status, found[0].status) == (72.0, "overloaded", "")


@pytest.mark.parametrize(("servo_id", "baudrate"), [(1, 57_600), (77, 1_000_000), (252, 4_000_000)])
def test_a_lone_servo_is_found_at_any_speed_and_id(servo_id: int, baudrate: int) -> None:
    with (
        EmulatedBus("dynamixel", ids=(servo_id,), baudrate=baudrate) as emulator,
        tools_on(emulator) as tools,
    ):
        motor = first(tools, baudrate)
        assert (motor.motor_id, motor.baudrate) == (servo_id, baudrate)


def test_a_servo_fresh_from_the_factory_gets_id_speed_and_mode() -> None:
    with EmulatedBus("dynamixel", ids=(1,), baudrate=57_600, return_delay_s=500e-6) as emulator:
        emulator.ask("set_register", slot=0, name="torque_enable", value=1)
        emulator.ask("set_register", slot=0, name="status_level", value=1)
        with tools_on(emulator) as tools:
            motor = tools.assign(first(tools, 57_600), 6, 1_000_000)
            assert (motor.motor_id, motor.baudrate) == (6, 1_000_000)
            kept = registers(emulator)
            assert (kept["id"], kept["baudrate"], kept["torque_enable"]) == (6, 3, 0)
            assert (kept["operating_mode"], kept["status_level"], kept["return_delay"]) == (4, 2, 0)
            assert tools.assign(motor, 6, 1_000_000) == motor  # again: nothing changes


def test_what_cannot_be_assigned_is_refused(emulator: EmulatedBus) -> None:
    with tools_on(emulator) as tools:
        motor = first(tools, 1_000_000)
        with pytest.raises(AssignmentFailed, match=r"id 2 is taken by another motor at 1000000 bit/s"):
            tools.assign(motor, 2, 1_000_000)
        with pytest.raises(AssignmentFailed, match=r"253 is not a servo id: allowed 0 to 252"):
            tools.assign(motor, 253, 1_000_000)
        with pytest.raises(AssignmentFailed, match=r"no speed of 500000 bit/s: allowed 1000000, 9600"):
            tools.assign(motor, 9, 500_000)
    assert [registers(emulator, slot)["id"] for slot in range(3)] == [1, 2, 3]
