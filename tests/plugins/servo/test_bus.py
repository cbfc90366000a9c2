"""What holds for the buses of all families: no reply is believed that is not the answer."""

import math
import time
from typing import Any

import pytest
from joshua_emulator import EmulatedBus
from joshua_serial.errors import PortDisconnected
from joshua_servo import bus as servo_bus
from joshua_servo.errors import NoReply
from servo_families import Kind
from stepped_time import SteppedTime

IDS = (1, 2, 3)


def positions(kind: Kind, bus: Any) -> dict[int, int]:
    """Positions in ticks of the servos that answer."""
    present = kind.family.present_position
    values = bus.sync_read(present.address, present.width, IDS)
    return {servo_id: kind.position(data) for servo_id, data in values.items()}


@pytest.mark.parametrize("fault", ["drop", "drop_request", "corrupt"])
def test_lost_and_corrupt_packets_are_asked_for_again(fault: str, kind: Kind, emulator: EmulatedBus) -> None:
    emulator.hand({1: 1000, 2: 1500, 3: 2000})
    emulator.fault(fault, 0.3)
    with kind.open_bus(emulator, patience_s=10.0) as bus:
        for _ in range(20):
            assert positions(kind, bus) == {1: 1000, 2: 1500, 3: 2000}
        assert bus.counters.retries > 0
        assert sum(bus.counters.lost.values()) > 0
        assert bool(bus.counters.corrupt) == (fault == "corrupt")


def test_a_roll_call_hears_those_whose_answer_comes_while_the_next_one_is_asked(
    kind: Kind, emulator: EmulatedBus
) -> None:
    emulator.fault("late", 1.0, late_by_s=0.03)
    with kind.open_bus(emulator) as bus:
        heard: set[int] = set()
        for _ in range(5):  # bytes that come between two requests are dropped, here as anywhere
            heard |= bus.roll_call(range(1, 25), 0.008)
    assert heard == set(IDS)


@pytest.mark.parametrize("late_by_s", [0.004, 0.022, 0.06])
def test_a_late_reply_never_passes_for_the_next_one(
    late_by_s: float, kind: Kind, emulator: EmulatedBus
) -> None:
    """The joints move; each accepted position must be one that its joint had since the request was sent."""
    emulator.fault("late", 0.05, late_by_s=late_by_s)
    emulator.fault("drop", 0.02)
    emulator.ask("motion", kind="sine", amplitude_rad=1.2, frequency_hz=0.8)
    start_s = emulator.log("motion")[-1]["t_ns"] / 1e9

    def truth(servo_id: int, time_s: float) -> float:
        elapsed_s = max(0.0, time_s - start_s)
        phase = math.tau * 0.8 * elapsed_s + 0.7 * (servo_id - 1)
        return 2048 + min(1.0, elapsed_s) * 1.2 * math.sin(phase) * 4096 / math.tau

    with kind.open_bus(emulator, patience_s=1.0) as bus:
        accepted = 0
        while accepted < 450:
            sent_s = time.monotonic()
            found = positions(kind, bus)
            accepted += len(found)
            span_s = time.monotonic() - sent_s + 0.002  # a request is carried out when its last byte is heard
            if len(found) < len(IDS):  # a busy machine: what it has kept back would outlast all lengths
                time.sleep(0.5)
            for servo_id in found:
                steps = 20 + round(span_s / 0.002)
                possible = [truth(servo_id, sent_s + span_s * step / steps) for step in range(steps + 1)]
                assert min(possible) - 3 <= found[servo_id] <= max(possible) + 3
        assert bus.counters.stale + sum(bus.counters.lost.values()) > 0


def test_a_servo_that_stays_silent_is_left_out_or_named(kind: Kind, emulator: EmulatedBus) -> None:
    emulator.fault("silent", 2)
    with kind.open_bus(emulator, reply_margin_s=0.1) as bus:
        assert set(positions(kind, bus)) == {1, 3}
        assert bus.counters.lost[2] >= 4, "asked for as long as the patience lasts"
        with pytest.raises(
            NoReply,
            match=r"ttyACM0.*: id 2 does not answer a read: no reply to \d+ requests in .*Check its cable",
        ):
            bus.read(2, kind.family.present_position)
        with pytest.raises(NoReply, match="id 2 does not answer a write of torque_enable"):
            bus.write(2, kind.family.torque_enable, 0)


def test_an_adapter_that_echoes(kind: Kind) -> None:
    with kind.emulated_bus(IDS, echo=True) as emulator, kind.open_bus(emulator, reply_margin_s=5.0) as bus:
        emulator.hand({1: 568})  # in one protocol, with an encoder fault, its reply would equal the request
        assert bus.read(1, kind.family.present_position) == 568
        assert positions(kind, bus)[1] == 568
        bus.write(1, kind.family.speed, 7)
        assert bus.read(1, kind.family.speed) == 7
        assert bus.counters.lost == {}


def test_unplugging_ends_a_request_at_once(kind: Kind, emulator: EmulatedBus) -> None:
    with kind.open_bus(emulator) as bus:
        emulator.fault("unplug")
        emulator.wait_for(["unplug"])
        with pytest.raises(PortDisconnected):
            positions(kind, bus)


def test_lengths_are_claimed_for_a_while_after_a_loss_only(
    kind: Kind, emulator: EmulatedBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    present = kind.family.present_position
    read = (present.address, present.width, IDS)
    with kind.open_bus(emulator) as bus:
        assert bus._free_length(*read) == (present.address, present.width, 0)
        clock = SteppedTime()
        monkeypatch.setattr(servo_bus, "time", clock)
        for _ in range(3):
            found = bus._free_length(*read)
            assert found is not None
            bus._lose(2, found[1], b"")
        sizes = {size for _, size in bus._claims if size}
        assert sizes == {present.width, present.width + 1, present.width + 2}
        clock.sleep(servo_bus.LATE_HORIZON_S + 0.01)
        assert bus._free_length(*read) == (present.address, present.width, 0)


def test_a_look_that_may_not_wait_for_a_free_length_finds_nothing(kind: Kind, emulator: EmulatedBus) -> None:
    present = kind.family.present_position
    with kind.open_bus(emulator) as bus:
        for size in range(64):
            bus._lose(2, size, b"")
        requests = bus.counters.requests
        assert bus.sync_read(present.address, present.width, IDS, within_s=0.0) == {}
        assert bus.counters.requests == requests
        assert set(bus.sync_read(present.address, present.width, IDS)) == set(IDS), "this one waits"
