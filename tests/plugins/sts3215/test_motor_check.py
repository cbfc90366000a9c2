import re
from typing import Any

import pytest
from joshua_emulator import EmulatedBus
from joshua_servo.errors import MotorCheckFailed
from joshua_servo.motor_check import check_motors, find_baudrates
from patience import BRISK_S


def refusal(bus: Any, ids: tuple[int, ...]) -> str:
    bus.reply_margin_s = min(bus.reply_margin_s, BRISK_S)
    with pytest.raises(MotorCheckFailed) as caught:
        check_motors(bus, dict.fromkeys(ids, "STS3215"))
    return str(caught.value)


def test_a_complete_bus_passes(emulator: EmulatedBus, open_bus: Any) -> None:
    with open_bus(emulator) as bus:
        motors = check_motors(bus, dict.fromkeys((1, 2, 3), "STS3215"))
        assert [str(motor) for motor in motors][:1] == ["1 (STS3215, firmware 3.10)"]


def test_a_broken_chain_is_located(open_bus: Any) -> None:
    with EmulatedBus(ids=(1, 2, 3, 4, 5)) as emulator:
        emulator.fault("break_after", 3)
        with open_bus(emulator) as bus:
            text = refusal(bus, (1, 2, 3, 4, 5))
    assert "missing ids: 4, 5\n  the chain breaks after id 3: check the cable between 3 and 4" in text
    assert "expected: 1 (STS3215), 2 (STS3215), 3 (STS3215), 4 (STS3215), 5 (STS3215)\n" in text
    assert "found: 1 (STS3215, firmware 3.10), 2 (" in text
    assert "joshua motors setup" in text
    assert "at 1000000 bit/s" in text


def test_a_missing_motor_in_between_breaks_no_chain(emulator: EmulatedBus, open_bus: Any) -> None:
    emulator.fault("silent", 2)
    with open_bus(emulator) as bus:
        text = refusal(bus, (1, 2, 3))
    assert "missing ids: 2" in text
    assert "chain" not in text


def test_a_stranger_is_listed(emulator: EmulatedBus, open_bus: Any) -> None:
    with open_bus(emulator) as bus:
        text = refusal(bus, (1, 2, 7))
    assert "missing ids: 7" in text
    assert re.search(r"found: 1 .*, 2 .*, 3 \(STS3215", text)


def test_two_motors_with_one_id(emulator: EmulatedBus, open_bus: Any) -> None:
    emulator.fault("duplicate", 2)
    with open_bus(emulator) as bus:
        text = refusal(bus, (1, 2, 3))
    assert "two motors share the id 2: connect one alone and change its id" in text
    assert "missing" not in text


def test_a_wrong_model(open_bus: Any) -> None:
    with EmulatedBus(ids=(1, 2), models=(777, 2825)) as emulator, open_bus(emulator) as bus:
        text = refusal(bus, (1, 2))
    assert "wrong model: id 2 is a STS3250, expected STS3215" in text


def test_another_line_speed_is_found(open_bus: Any) -> None:
    with EmulatedBus(ids=(1, 2), baudrate=115_200) as emulator, open_bus(emulator) as bus:
        text = refusal(bus, (1, 2))
        assert bus.port.baudrate == 1_000_000
        assert find_baudrates(bus, (1, 2)) == {115_200: [1, 2]}
    assert "no servo answers at 1000000 bit/s, but ids 1, 2 answer at 115200: set baudrate: 115200" in text
    assert "found: none" in text


def test_a_bus_without_supply(emulator: EmulatedBus, open_bus: Any) -> None:
    emulator.fault("silent")
    with open_bus(emulator, reply_margin_s=0.005) as bus:
        text = refusal(bus, (1,))
    assert "no servo answers at any line speed: check the supply, and the cable to the first servo" in text
