"""Stalls of the machine at any point of a request: no servo is blamed for them, but a silent one is.

The servos are emulated ones behind their real protocol, on a line in virtual time. A stall delays this
process alone, or the servos' replies, too, as it does where an emulator runs on the same machine. The process
waits in a run queue meanwhile, which the system tells, or is stopped, which it does not.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joshua.guardian.silence import LEAST_MISSES, PATIENCE_FACTOR, SILENCE_LIMIT_S, Patience
from joshua_servo import bus as servo_bus
from joshua_servo import motor_check, torque
from joshua_servo.errors import NoReply
from joshua_servo.motor_check import check_motors
from joshua_servo.torque import TorqueSwitch
from servo_families import KINDS, Kind
from stalling_line import STALLS, StallingLine
from stepped_time import SteppedTime
from virtual_families import virtual_servos

IDS = (1, 2, 3)
MODELS = {"feetech": "STS3215", "dynamixel": "xl330-m077"}

FAMILIES = st.sampled_from([kind.protocol for kind in KINDS])


def kind_of(protocol: str) -> Kind:
    return next(kind for kind in KINDS if kind.protocol == protocol)


@contextmanager
def stalling(kind: Kind) -> Iterator[tuple[Any, StallingLine, dict[int, Any]]]:
    """A bus on a line that may stall, the line, and the servos by their id."""
    clock = SteppedTime()
    with pytest.MonkeyPatch.context() as patch:
        servos, emulated = virtual_servos(kind.protocol, IDS)
        line = StallingLine(emulated, clock)
        patient = partial(Patience, clock=clock.monotonic, waited=lambda: line.waited_s)
        patch.setattr(servo_bus, "time", clock)
        for module in (servo_bus, motor_check, torque):
            patch.setattr(module, "Patience", patient)
        yield kind.bus(line), line, servos  # type: ignore[arg-type]


def read(kind: Kind, bus: Any) -> None:
    assert bus.read(2, kind.family.present_position) >= 0


def write(kind: Kind, bus: Any) -> None:
    bus.write(2, kind.family.speed, 7)
    assert bus.read(2, kind.family.speed) == 7


def sync_read(kind: Kind, bus: Any) -> None:
    assert set(bus.sync_read(*kind.family.feedback, IDS)) == set(IDS)


def check(kind: Kind, bus: Any) -> None:
    assert len(check_motors(bus, dict.fromkeys(IDS, MODELS[kind.protocol]))) == len(IDS)


def switch_off(kind: Kind, bus: Any) -> None:
    TorqueSwitch(bus, kind.family, dict.fromkeys(IDS, "")).switch_off()


OPERATIONS = pytest.mark.parametrize("operation", [read, write, sync_read, check, switch_off])


@OPERATIONS
@settings(max_examples=60, deadline=None)
@given(stalls=st.lists(STALLS, max_size=4), protocol=FAMILIES)
def test_sound_servos_are_never_blamed(
    operation: Callable[[Kind, Any], None], stalls: list[tuple[int, float, bool, bool]], protocol: str
) -> None:
    kind = kind_of(protocol)
    with stalling(kind) as (bus, line, _):
        line.stalls = {at: rest for at, *rest in stalls}  # type: ignore[misc]
        operation(kind, bus)


@settings(max_examples=150, deadline=None)
@given(
    stalls=st.lists(STALLS, max_size=6),
    operation=st.sampled_from([read, write]),
    protocol=FAMILIES,
)
def test_a_silent_servo_is_blamed_for_awake_time_only(
    operation: Callable[[Kind, Any], None], stalls: list[tuple[int, float, bool, bool]], protocol: str
) -> None:
    kind = kind_of(protocol)
    with stalling(kind) as (bus, line, servos):
        line.stalls = {at: rest for at, *rest in stalls}  # type: ignore[misc]
        servos[2].silent = True
        began_s = line.awake_s()
        with pytest.raises(NoReply) as caught:
            operation(kind, bus)
        awake_s, text = line.awake_s() - began_s, str(caught.value)
        if "too busy" in text:
            assert line.stalled_s + awake_s >= SILENCE_LIMIT_S * PATIENCE_FACTOR
            assert re.search(r"delayed by \d\.\d s", text)
            return
        # A stop, and a wait before the first miss, count as much as a request.
        counted_s = (line.stopped + 1) * SILENCE_LIMIT_S / LEAST_MISSES
        assert awake_s >= SILENCE_LIMIT_S - counted_s
        assert awake_s <= SILENCE_LIMIT_S + 0.3, "as fast as without stalls"
        assert len(line.sent_s) >= LEAST_MISSES


@pytest.mark.parametrize("silent", [(2,), IDS])
def test_silent_servos_are_found_in_half_a_second(silent: tuple[int, ...], kind: Kind) -> None:
    with stalling(kind) as (bus, line, servos):
        for servo_id in silent:
            servos[servo_id].silent = True
        began_s = line.awake_s()
        found = motor_check._silent(bus, IDS)
        assert found == silent
        assert line.awake_s() - began_s <= SILENCE_LIMIT_S + 0.1


def test_waits_for_a_reply_grow(kind: Kind) -> None:
    """A busy host that delays every reply by 50 ms."""
    with stalling(kind) as (bus, line, _):
        line.fates = iter([("late", 0.05)] * 400)
        assert set(bus.sync_read(*kind.family.feedback, IDS)) == set(IDS)
        waits_s = [later - earlier for earlier, later in pairwise(line.sent_s)]
        assert waits_s == sorted(waits_s)
