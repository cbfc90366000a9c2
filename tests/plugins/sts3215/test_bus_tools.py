from __future__ import annotations

from dataclasses import replace
from functools import partial

import pytest
from joshua_emulator import EmulatedBus
from joshua_serial.errors import PortDisconnected
from joshua_servo.bus_tools import AssignmentFailed, FoundMotor
from joshua_servo.servo_bus_tools import ServoBusTools
from joshua_sts3215.bus import Bus
from joshua_sts3215.bus_tools import Sts3215BusTools
from patience import PATIENT_S
from servo_families import STS3215_KIND

tools_on = STS3215_KIND.open_tools


def only(tools: ServoBusTools) -> FoundMotor:
    found: list[FoundMotor] = []
    for _ in range(3):  # a machine that gives the emulator no time for a second hides its servos as long
        found = found or list(tools.scan())
    (motor,) = found
    return motor


def registers(emulator: EmulatedBus, slot: int = 0) -> dict[str, int]:
    return dict(emulator.ask("registers", slot=slot)["registers"])


def test_all_servos_of_a_chain_are_found_and_described(arm_emulator: EmulatedBus) -> None:
    with tools_on(arm_emulator) as tools:
        found = list(tools.scan((1_000_000,)))
    assert [motor.motor_id for motor in found] == [1, 2, 3, 4, 5, 6]
    first = found[0]
    assert (first.model, first.firmware, first.baudrate) == ("STS3215", "3.10", 1_000_000)
    assert first.voltage_v == pytest.approx(12.0, abs=0.2)
    assert first.temperature_c is not None
    assert 15 < first.temperature_c < 40
    assert (first.status, first.shared) == ("", False)


@pytest.mark.parametrize(("servo_id", "baudrate"), [(1, 1_000_000), (77, 57_600), (253, 250_000)])
def test_a_lone_servo_is_found_at_any_speed_and_id(servo_id: int, baudrate: int) -> None:
    with (
        EmulatedBus(ids=(servo_id,), baudrate=baudrate) as emulator,
        tools_on(emulator) as tools,
    ):
        motor = only(tools)
        assert (motor.motor_id, motor.baudrate) == (servo_id, baudrate)
        assert tools.port.baudrate == 1_000_000  # put back


def test_servos_with_high_ids_are_found_among_others() -> None:
    with EmulatedBus(ids=(3, 200)) as emulator, tools_on(emulator) as tools:
        assert [motor.motor_id for motor in tools.scan((1_000_000,))] == [3, 200]


def test_servos_at_different_speeds_are_found_each_at_its_own() -> None:
    with EmulatedBus(ids=(1, 2)) as emulator, tools_on(emulator) as tools:
        emulator.ask("set_register", slot=1, name="baudrate", value=4)
        tools.set_up = replace(tools.set_up, quiet_s=0.5)  # type: ignore[misc]  # a busy machine is slow
        found = tools.scan((1_000_000, 115_200, 38_400))
        assert [(motor.motor_id, motor.baudrate) for motor in found] == [(1, 1_000_000), (2, 115_200)]


def test_a_silent_bus_and_an_adapter_with_echo() -> None:
    with EmulatedBus(ids=(1,)) as emulator, tools_on(emulator) as tools:
        emulator.fault("silent")
        assert list(tools.scan()) == []
    with EmulatedBus(ids=(4, 5), echo=True) as emulator, tools_on(emulator) as tools:
        tools.make_bus = partial(Bus, reply_margin_s=PATIENT_S)  # type: ignore[assignment, misc]
        assert [motor.motor_id for motor in tools.scan((1_000_000,))] == [4, 5]


def test_a_fault_of_a_servo_is_named(emulator: EmulatedBus) -> None:
    emulator.fault("overload", 2)
    with tools_on(emulator) as tools:
        assert [motor.status for motor in tools.scan((1_000_000,))] == ["", "overloaded", ""]


def test_a_servo_gets_id_and_speed_and_the_factory_way_of_working() -> None:
    with EmulatedBus(ids=(1,), baudrate=115_200) as emulator, tools_on(emulator) as tools:
        for name, value in (("mode", 1), ("status_level", 0), ("return_delay", 250), ("torque_enable", 1)):
            emulator.ask("set_register", slot=0, name=name, value=value)
        motor = tools.assign(only(tools), 6, 1_000_000)
        assert (motor.motor_id, motor.baudrate) == (6, 1_000_000)
        kept = registers(emulator)
        assert (kept["id"], kept["baudrate"], kept["lock"]) == (6, 0, 1)
        assert (kept["mode"], kept["status_level"], kept["return_delay"]) == (0, 1, 0)
        assert kept["torque_enable"] == 0
        assert tools.assign(motor, 6, 1_000_000) == motor  # again: nothing changes


def test_an_id_that_another_servo_has_is_refused(emulator: EmulatedBus) -> None:
    with tools_on(emulator) as tools:
        motor = next(tools.scan((1_000_000,)))
        with pytest.raises(AssignmentFailed, match=r"id 2 is taken by another motor at 1000000 bit/s"):
            tools.assign(motor, 2, 1_000_000)
        with pytest.raises(AssignmentFailed, match=r"300 is not a servo id: allowed 0 to 253"):
            tools.assign(motor, 300, 1_000_000)
        with pytest.raises(AssignmentFailed, match=r"no speed of 9600 bit/s: allowed 1000000, 500000"):
            tools.assign(motor, 9, 9600)
    assert [registers(emulator, slot)["id"] for slot in range(3)] == [1, 2, 3]


def test_a_servo_that_is_lost_midway_is_put_back() -> None:
    class Jammed(Sts3215BusTools):
        """The cable comes off between id and line speed."""

        def _put_baudrate(self, bus: object, servo_id: int, baudrate: int) -> None:
            if baudrate == 500_000:
                emulator.fault("silent")
                try:
                    super()._put_baudrate(bus, servo_id, baudrate)  # type: ignore[arg-type]
                finally:
                    emulator.ask("clear_faults")
            else:
                super()._put_baudrate(bus, servo_id, baudrate)  # type: ignore[arg-type]

    with EmulatedBus(ids=(1,)) as emulator, tools_on(emulator) as tools:
        jammed = Jammed(tools.port)
        with pytest.raises(
            AssignmentFailed,
            match=r"id 1 did not become id 4 at 500000 bit/s: .*does not answer at 500000 bit/s\. "
            r"It answers as id 1 at 1000000 bit/s as before\. Check its cable",
        ):
            jammed.assign(only(tools), 4, 500_000)
        kept = registers(emulator)
        assert (kept["id"], kept["baudrate"], kept["lock"]) == (1, 0, 1)


def test_an_adapter_that_is_pulled_out_ends_the_scan() -> None:
    with EmulatedBus(ids=(1,)) as emulator, tools_on(emulator) as tools:
        emulator.fault("unplug")
        with pytest.raises(PortDisconnected, match=r"the adapter is gone"):
            list(tools.scan())
