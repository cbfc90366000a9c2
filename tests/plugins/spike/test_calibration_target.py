"""What a calibration sees of a hub: absolute angles of motors that turn freely. The hub keeps nothing."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from eventually import eventually
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua_calibration.target import StoredMotor
from joshua_emulator.spike.process import EmulatedHub
from joshua_spike.actuator import SpikeActuator
from joshua_spike.calibration_target import SpikeCalibrationTarget
from joshua_spike.settings import SpikeSettings


def ticks(degrees: float) -> int:
    return round(degrees % 360 * 4096 / 360)


@pytest.fixture
def target(hub: EmulatedHub) -> Iterator[SpikeCalibrationTarget]:
    settings = {"device_name": "Pybricks Hub", "adapter": hub.adapter, "port_names": ["A", "B"]}
    made = SpikeActuator(SpikeSettings.model_validate(settings)).calibration_target()
    assert isinstance(made, SpikeCalibrationTarget)
    yield made
    made.disconnect()


def test_motors_are_known_without_a_connection(target: SpikeCalibrationTarget) -> None:
    assert [(motor.id, motor.joint_name) for motor in target.motors] == [(1, "joint_a"), (2, "joint_b")]
    assert (target.identity, target.connected) == ("", False)
    with pytest.raises(DeviceError, match="call connect first"):
        target.raw_positions()


def test_positions_are_absolute_and_follow_the_hand(hub: EmulatedHub, target: SpikeCalibrationTarget) -> None:
    target.connect()
    target.release()
    assert target.identity == f"ble:{hub.address}"
    assert target.raw_positions() == pytest.approx((ticks(12), ticks(-25)), abs=12)
    for angle in (90, 179, -170, -5, 0):
        hub.hand("A", angle)

        def shown(expected: int = ticks(angle)) -> bool:
            return target.raw_positions()[0] == pytest.approx(expected, abs=12)

        eventually(shown, f"{angle} degrees")  # states that were on their way already come first
    assert [motor["powered"] for motor in hub.state()["motors"].values()] == [False, False]


def test_the_hub_keeps_nothing(target: SpikeCalibrationTarget) -> None:
    target.connect()
    target.store(1, StoredMotor(5, 10, 20))
    assert target.stored() is None


def test_a_lost_hub_is_reported(hub: EmulatedHub, target: SpikeCalibrationTarget) -> None:
    target.connect()
    hub.fault("unplug")

    def read_on() -> None:
        while True:
            target.raw_positions()

    with pytest.raises(DeviceDisconnected, match="the link was lost"):
        read_on()
