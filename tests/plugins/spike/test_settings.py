"""Settings of the driver: what a file may say, and how a calibration makes degrees into radians."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from joshua_spike.joint_map import JointMap
from joshua_spike.settings import SERVICE, SpikeSettings
from pydantic import ValidationError


def settings(**values: Any) -> SpikeSettings:
    return SpikeSettings.model_validate({"device_name": "Pybricks Hub", "port_names": ["A", "C"], **values})


def problem(**values: Any) -> str:
    with pytest.raises(ValidationError) as caught:
        settings(**values)
    error = caught.value.errors()[0]["ctx"]["error"]
    return f"{error.field}: {error} [{', '.join(error.allowed)}] {error.remedy}"


@pytest.mark.parametrize(
    "adapter", ["", "hci0", "hci12", "tcp-client:127.0.0.1:4711", "usb:0", "serial:/dev/x"]
)
def test_adapters_of_the_system_and_of_bumble_are_taken(adapter: str) -> None:
    assert settings(adapter=adapter).adapter == adapter


@pytest.mark.parametrize("adapter", ["hci", "bluetooth0", "tcp:127.0.0.1:4711", "00:11:22:33:44:55"])
def test_another_adapter_is_refused(adapter: str) -> None:
    text = problem(adapter=adapter)
    assert text.startswith("comm.ble.adapter: ")
    assert adapter in text
    assert "[hci0, tcp-client:127.0.0.1:4711, " in text
    assert "omit adapter" in text


def test_another_service_is_refused() -> None:
    text = problem(service_uuid="00001623-1212-efde-1623-785feabcd123")
    assert text.startswith("comm.ble.service_uuid: ")
    assert SERVICE in text


def test_a_port_stands_there_once() -> None:
    text = problem(port_names=["A", "B", "A"])
    assert "port A is listed twice; each port has one motor" in text
    assert "[C, D, E, F]" in text


CALIBRATION = {
    "motors": [
        {"id": 1, "joint_name": "lift", "homing_offset": 512, "range_min": 1024, "range_max": 3072},
        {
            "id": 3,
            "joint_name": "turn",
            "homing_offset": -1024,
            "range_min": 2048,
            "range_max": 3072,
            "inverted": True,
        },
    ]
}


def test_a_calibration_names_joints_and_their_ranges() -> None:
    made = settings(calibration=CALIBRATION)
    assert made.joint_names == ("lift", "turn")
    assert [joint.name for joint in made.joints()] == ["lift", "turn"]
    assert made.range_rad("A") == pytest.approx((-math.pi / 2, math.pi / 2))
    assert made.range_rad("C") == pytest.approx((-math.pi / 2, 0.0))


def test_a_calibration_without_a_port_is_refused() -> None:
    text = problem(port_names=["A", "B"], calibration=CALIBRATION)
    assert "no motor on port B" in text
    assert "[A, C]" in text


def test_without_calibration_the_mark_is_zero_and_half_a_turn_is_allowed() -> None:
    joints = JointMap(settings(), [90, -170])
    assert settings().joint_names == ("joint_a", "joint_c")
    assert joints.radians([90, -170]) == pytest.approx(np.radians([90, -170]))
    assert [joint.max_rad for joint in settings().joints()] == pytest.approx([math.pi, math.pi])
    assert joints.degrees(np.array([4.0, -4.0])) == (180, -180)


def test_zero_is_the_calibrated_one_and_turns_before_the_start_do_not_count() -> None:
    made = settings(calibration=CALIBRATION)
    zero_deg = (2048 + 512) * 360 / 4096  # 225 degrees: the motor says -135 there, or 585 after two turns
    for turns in (-720, 0, 360):
        start = (round(zero_deg) - 360 + 10 + turns, 90 + turns)
        joints = JointMap(made, start)
        assert joints.radians(start) == pytest.approx([math.radians(10), 0.0], abs=1e-9)
        assert joints.degrees(np.array([math.radians(10), 0.0])) == start


def test_whole_degrees_never_leave_the_range() -> None:
    values = {"motors": [{"id": 1, "joint_name": "j", "range_min": 1000, "range_max": 3001}]}
    made = settings(port_names=["A"], calibration=values)
    joints, (joint,) = JointMap(made, [170]), made.joints()
    for goal in np.linspace(-4, 4, 400):
        back = joints.radians(joints.degrees(np.array([goal])))[0]
        assert joint.min_rad <= back <= joint.max_rad
