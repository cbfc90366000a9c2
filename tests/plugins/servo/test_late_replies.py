"""Delayed, lost, duplicated and foreign replies: none is ever taken as the answer to another request.

The servos are emulated ones behind their real protocol. The line between them and the bus is in virtual time,
so that hypothesis can try thousands of requests.
"""

from __future__ import annotations

import itertools
from functools import partial
from typing import Any

import pytest
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule, run_state_machine_as_test
from joshua.devices.errors import DeviceError
from joshua.guardian.silence import Patience
from joshua_dynamixel import registers as dynamixel
from joshua_dynamixel.bus import Bus as DynamixelBus
from joshua_emulator.dynamixel.packets import status_packet as dynamixel_packet
from joshua_emulator.feetech.packets import status_packet as feetech_packet
from joshua_servo import bus as servo_bus
from joshua_servo.register import Register
from joshua_sts3215 import registers as sts
from joshua_sts3215.bus import Bus as Sts3215Bus
from stepped_time import SteppedTime
from virtual_families import virtual_servos
from virtual_line import STRANGER, Line

IDS = (1, 2, 3)

#: What happens to a reply: lost, late by seconds, sent twice, or preceded by one of another servo.
FATES = st.one_of(
    st.just(("good", 0.0)),
    st.just(("good", 0.0)),
    st.just(("lost", 0.0)),
    st.just(("request lost", 0.0)),
    st.just(("twice", 0.0)),
    st.just(("foreign", 0.0)),
    st.tuples(st.just("late"), st.floats(0.001, 0.24)),
)


class LateReplies(RuleBasedStateMachine):
    """Requests of all kinds on a line where anything may happen to a reply."""

    bus_type: type[Any]
    #: Registers that a test may write, with their largest value.
    registers: tuple[tuple[Register, int], ...]

    def __init__(self) -> None:
        super().__init__()
        self.clock = SteppedTime()
        self.clock._monotonic_ns = 10**12  # the same rounding in every run
        self.patch = pytest.MonkeyPatch()
        self.patch.setattr(servo_bus, "time", self.clock)
        self.patch.setattr(
            servo_bus, "Patience", partial(Patience, clock=self.clock.monotonic, waited=lambda: 0.0)
        )
        self.servos, self.line = self.make()
        self.bus = self.bus_type(self.line)
        self.values = itertools.count(1)

    def make(self) -> tuple[dict[int, Any], Line]:
        raise NotImplementedError

    def teardown(self) -> None:
        self.patch.undo()

    def fresh(self, servo_id: int, which: int) -> tuple[Register, int]:
        """A register, and a value that it did not have for long."""
        register, largest = self.registers[which % len(self.registers)]
        return register, (next(self.values) * 7 + servo_id) % (largest + 1)

    def held(self, servo_id: int, register: Register) -> int:
        memory = self.servos[servo_id].memory
        return register.decode(bytes(memory[register.address : register.end]))

    def put(self, servo_id: int, register: Register, value: int) -> None:
        self.servos[servo_id].memory[register.address : register.end] = register.encode(value)

    @rule(servo_id=st.sampled_from(IDS), which=st.integers(0, 9), fates=st.lists(FATES, max_size=12))
    def read(self, servo_id: int, which: int, fates: list[tuple[str, float]]) -> None:
        register, value = self.fresh(servo_id, which)
        self.put(servo_id, register, value)
        self.line.fates = iter(fates)
        try:
            assert self.bus.read(servo_id, register) == value
        except DeviceError:
            assert any(kind != "good" for kind, _ in fates)

    @rule(
        ids=st.sampled_from([IDS, (1, 3), (2,), (3, 1)]),
        which=st.integers(0, 9),
        fates=st.lists(FATES, max_size=16),
        within_s=st.sampled_from([None, 0.0, 0.06]),
    )
    def sync_read(
        self, ids: tuple[int, ...], which: int, fates: list[tuple[str, float]], within_s: float | None
    ) -> None:
        register = self.registers[which % len(self.registers)][0]
        for servo_id in ids:
            self.put(servo_id, register, self.fresh(servo_id, which)[1])
        self.line.fates = iter(fates)
        found = self.bus.sync_read(register.address, register.width, ids, within_s=within_s)
        assert {i: register.decode(data) for i, data in found.items()} == {
            i: self.held(i, register) for i in found
        }

    @rule(servo_id=st.sampled_from(IDS), which=st.integers(0, 9), fates=st.lists(FATES, max_size=12))
    def write(self, servo_id: int, which: int, fates: list[tuple[str, float]]) -> None:
        register, value = self.fresh(servo_id, which)
        self.line.fates = iter(fates)
        try:
            self.bus.write(servo_id, register, value)
        except DeviceError:
            assert any(kind != "good" for kind, _ in fates)
        else:
            assert self.held(servo_id, register) == value

    @rule(servo_id=st.sampled_from((*IDS, STRANGER)), fates=st.lists(FATES, max_size=4))
    def ping(self, servo_id: int, fates: list[tuple[str, float]]) -> None:
        self.line.fates = iter(fates)
        if self.bus.ping(servo_id):
            assert servo_id in IDS or any(kind == "foreign" for kind, _ in fates)

    @rule(servo_id=st.sampled_from(IDS), fates=st.lists(FATES, max_size=12))
    def identify(self, servo_id: int, fates: list[tuple[str, float]]) -> None:
        self.line.fates = iter(fates)
        try:
            motor = self.bus.identify(servo_id)
        except DeviceError:
            assert any(kind != "good" for kind, _ in fates)
        else:
            assert motor.model in ("STS3215", "xl330-m077")

    @rule(seconds=st.floats(0.0, 0.3))
    def wait(self, seconds: float) -> None:
        self.clock.sleep(seconds)


class FeetechReplies(LateReplies):
    bus_type = Sts3215Bus
    registers = (
        (sts.ACCELERATION, 254),
        (sts.GOAL_SPEED, 3000),
        (sts.GOAL_TIME, 999),
        (sts.TORQUE_LIMIT, 1000),
    )

    def make(self) -> tuple[dict[int, Any], Line]:
        servos, emulated = virtual_servos("feetech", IDS)
        return servos, Line(emulated, self.clock, feetech_packet)


class DynamixelReplies(LateReplies):
    bus_type = DynamixelBus
    registers = (
        (dynamixel.PROFILE_ACCELERATION, 30000),
        (dynamixel.POSITION_P, 16000),
        (dynamixel.POSITION_I, 16000),
    )

    def make(self) -> tuple[dict[int, Any], Line]:
        servos, emulated = virtual_servos("dynamixel", IDS)
        return servos, Line(emulated, self.clock, dynamixel_packet)


@pytest.mark.parametrize("machine", [FeetechReplies, DynamixelReplies])
def test_no_reply_is_taken_as_the_answer_to_another_request(machine: type[LateReplies]) -> None:
    run_state_machine_as_test(
        machine,
        settings=settings(
            max_examples=100,
            stateful_step_count=30,
            deadline=None,
            phases=[Phase.explicit, Phase.generate],  # to shrink hundreds of fates would take minutes
        ),
    )
