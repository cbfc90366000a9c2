"""Calibrating simulated arms: encoders and frames, the hand, and the whole way by the program."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joshua.devices.calibration import ArmCalibration, MotorCalibration
from joshua.devices.context import ActuatorContext
from joshua.devices.errors import DeviceError
from joshua.plan import ActuatorFacts
from joshua.planner.amend import take_calibrations
from joshua.planner.pipeline import check_file
from joshua.planner.request import Request
from joshua.plugins.block_context import BlockContext
from joshua.testing import check_actuator
from joshua.testing.domain import reserved_domain
from joshua.tools import calibration_place
from joshua_calibration.arm_file import ArmFile
from joshua_calibration.testing import check_calibration_target
from joshua_mujoco_sim.actuator import SimActuator
from joshua_mujoco_sim.calibration import encoder_ticks, frames, misfits
from joshua_mujoco_sim.calibration_target import SimCalibrationTarget
from joshua_mujoco_sim.settings import SimActuatorSettings
from pydantic import ValidationError
from sim_configs import simulation_file

CONFIGS = Path(__file__).resolve().parents[3] / "configs"
LIFT = {"name": "shoulder_lift", "min_rad": -3.32, "max_rad": 0.174, "by_hand": True}
WHEEL = {"name": "wheel", "min_rad": -math.tau, "max_rad": math.tau, "by_hand": False}
RAD_PER_TICK = math.tau / 4096


def context(model_path: str = "so_arm100/scene.xml", **more: Any) -> BlockContext:
    simulation = {
        "mode": "OFFSCREEN",
        "model_path": model_path,
        "mirror_topic_mappings": (),
        "real_time_factor": 1.0,
        "keyframe": "",
        "on_divergence": "DIVERGENCE_RESET",
        "joint_state_rate_hz": 50.0,
        "folder": "",
        "trajectory_path": "",
        "replay_speed": 1.0,
    }
    return BlockContext(simulation=simulation, **more)


def settings(facts: BlockContext, *names: str) -> SimActuatorSettings:
    values = {
        "actuators": list(names),
        "motion": "none",
        "motion_amplitude_rad": 0.3,
        "motion_frequency_hz": 1.0,
        "motion_file": "",
    }
    return SimActuatorSettings.model_validate(SimActuatorSettings.si_values(values, None, facts))


def actuator(facts: BlockContext, *names: str) -> SimActuator:
    context = ActuatorContext(ActuatorFacts(simulation=facts.simulation))
    return SimActuator(settings(facts, *names), context)


def calibration(*motors: MotorCalibration, identity: str = "simulation") -> BlockContext:
    made = ArmCalibration(motors=motors, device_identity=identity)
    return context(calibration=made.to_block("arm"))


@pytest.mark.parametrize(("angle", "ticks"), [(0.0, 2048), (math.pi / 2, 3072), (-math.pi, 0), (math.pi, 0)])
def test_an_encoder_has_its_middle_at_the_models_zero(angle: float, ticks: int) -> None:
    assert encoder_ticks(angle) == ticks


@pytest.mark.parametrize("middle", [-1.573, -3.0, 3.1, 0.4])
@pytest.mark.parametrize("inverted", [False, True])
def test_a_calibrated_joint_counts_from_the_middle_pose(middle: float, inverted: bool) -> None:
    """Also where the middle pose is beyond the end of the encoder's turn."""
    joint = {"name": "j", "min_rad": middle - 1.5, "max_rad": middle + 1.2, "by_hand": True}
    offset = encoder_ticks(middle) - 2048
    motor = MotorCalibration(
        id=1, joint_name="elbow", homing_offset=offset, range_min=1071, range_max=2830, inverted=inverted
    )
    (frame,) = frames([joint], ArmCalibration(motors=(motor,)))
    assert (frame.name, frame.sign) == ("elbow", -1.0 if inverted else 1.0)
    assert frame.zero_rad == pytest.approx(middle, abs=RAD_PER_TICK)
    ends = (-1.2, 1.5) if inverted else (-1.5, 1.2)
    assert (frame.min_rad, frame.max_rad) == pytest.approx(ends, abs=2 * RAD_PER_TICK)
    assert list(misfits([joint], ArmCalibration(motors=(motor,)))) == []


def test_a_joint_without_calibration_keeps_the_models_zero() -> None:
    motor = MotorCalibration(id=1, joint_name="lift", homing_offset=-1026, range_min=910, range_max=3186)
    lift, wheel = frames([LIFT, WHEEL], ArmCalibration(motors=(motor,)))
    assert lift.zero_rad == pytest.approx(-1.574, abs=0.001)
    assert (wheel.name, wheel.zero_rad, wheel.max_rad) == ("wheel", 0.0, math.tau)


def test_what_does_not_fit_the_model_is_said() -> None:
    foreign = MotorCalibration(id=1, joint_name="lift", homing_offset=500, range_min=1000, range_max=3000)
    on_a_wheel = MotorCalibration(id=2, joint_name="wheel", range_max=4095)
    found = list(misfits([LIFT, WHEEL], ArmCalibration(motors=(foreign, on_a_wheel))))
    assert found == [
        "lift (id 1): calibrated from -48° to 128° of the model's joint, which goes from -190° to 10°",
        "wheel (id 2): the model has no such joint to calibrate",
    ]


def test_a_calibration_of_a_real_arm_is_refused() -> None:
    motor = MotorCalibration(id=1, joint_name="pan", range_min=700, range_max=3300)
    facts = calibration(motor, identity="usb:ARM1")
    with pytest.raises(ValidationError, match="the calibration is for usb:ARM1, but this arm is simulated"):
        settings(facts, "shoulder_pan")


def test_a_calibration_of_another_model_is_refused() -> None:
    motor = MotorCalibration(id=1, joint_name="pan", homing_offset=900, range_min=700, range_max=3300)
    with pytest.raises(ValidationError) as refused:
        settings(calibration(motor), "shoulder_pan", "elbow_flex")
    assert "does not fit the model: pan (id 1): calibrated from -39° to 189°" in str(refused.value)
    assert "elbow_flex (id 2) is not calibrated" in str(refused.value)


def test_a_calibrated_arm_keeps_the_contract_of_actuators() -> None:
    facts = calibration(
        MotorCalibration(id=1, joint_name="lift", homing_offset=-959, range_min=1000, range_max=3100),
        MotorCalibration(
            id=2, joint_name="elbow", homing_offset=1024, range_min=1100, range_max=3000, inverted=True
        ),
    )
    check_actuator(lambda: actuator(facts, "shoulder_lift", "elbow_flex"), timeout_s=30)


def test_a_calibrated_arm_says_where_its_joints_are_about_its_own_zero() -> None:
    plain = actuator(context(), "elbow_flex")
    turned = actuator(
        calibration(
            MotorCalibration(
                id=1, joint_name="elbow", homing_offset=1024, range_min=1100, range_max=3000, inverted=True
            )
        ),
        "elbow_flex",
    )
    plain.connect()
    turned.connect()  # the same physics
    try:
        turned.enable()
        turned.write(np.array([0.5]))
        deadline_s = time.monotonic() + 60
        while abs(turned.read().position_rad[0] - 0.5) > 0.02:
            assert time.monotonic() < deadline_s
            time.sleep(0.02)
        assert plain.read().position_rad[0] == pytest.approx(1024 * RAD_PER_TICK - 0.5, abs=0.03)
    finally:
        turned.disconnect()
        plain.disconnect()


def test_simulated_arms_keep_the_contract_of_calibration_targets() -> None:
    facts = context()
    check_calibration_target(lambda: actuator(facts, "shoulder_pan", "gripper").calibration_target())


def test_the_hand_waits_while_nobody_looks() -> None:
    """However late the reader is, it sees both ends of the range."""
    target = actuator(context(), "gripper").calibration_target()
    target.connect()
    try:
        target.release()
        (start,) = target.raw_positions()
        assert target.hand(0, 1.0)
        time.sleep(0.4)
        seen = [target.raw_positions()[0]]
        assert abs(seen[0] - start) < 150  # of 1434
        deadline_s = time.monotonic() + 60
        while max(seen) - min(seen) < 1430:
            assert time.monotonic() < deadline_s, (min(seen), max(seen))
            time.sleep(0.04)
            seen.append(target.raw_positions()[0])
    finally:
        target.disconnect()


def test_wheels_have_nothing_to_calibrate() -> None:
    base = actuator(context("lekoch/scene.xml"))
    target = base.calibration_target()
    assert isinstance(target, SimCalibrationTarget)
    assert [motor.joint_name for motor in target.motors] == [
        "shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"
    ]  # fmt: skip
    wheels = [name for name, joint in zip(base.settings.actuators, base.settings.joint_ranges, strict=True)
              if not joint["by_hand"]]  # fmt: skip
    with pytest.raises(NotImplementedError, match="cannot be calibrated"):
        actuator(context("lekoch/scene.xml"), *wheels).calibration_target()


def test_a_target_that_is_not_open_says_so() -> None:
    target = actuator(context(), "gripper").calibration_target()
    with pytest.raises(DeviceError, match=r"SimCalibrationTarget\.hand: the device is not open"):
        target.hand(None, 1.0)


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    with reserved_domain() as domain:
        variables = {"ROS_DOMAIN_ID": str(domain), "XDG_STATE_HOME": str(folder / "state")}
        return subprocess.run(
            [sys.executable, "-m", "joshua.cli.main", *arguments],
            capture_output=True, text=True, env=os.environ | variables, timeout=200, stdin=subprocess.DEVNULL,
        )  # fmt: skip


def calibrated_spans(path: Path) -> list[float]:
    """Ranges in degrees, as the file has them."""
    text = path.read_text()
    low, high = ([int(n) for n in re.findall(rf"range_{end}: (\d+)", text)] for end in ("min", "max"))
    return [(b - a) * 360 / 4096 for a, b in zip(low, high, strict=True)]


def robot(folder: Path, name: str) -> Path:
    """A preset whose arms have one joint, which takes a sixth of the time."""
    path = folder / f"{name}.pbtxt"
    text = (CONFIGS / path.name).read_text()
    path.write_text(re.sub(r"motor_ids: \[[^]]*\]", "motor_ids: [1]", text))
    return path


def test_calibrating_with_sim_and_then_teleoperating_by_it(tmp_path: Path) -> None:
    motor = 'motors { id: 1 joint_name: "pan" range_min: 9 range_max: 99 }'
    real = f'calibration {{ arms {{ node_name: "leader_arm" device_identity: "usb:ARM1" {motor} }} }}'
    (tmp_path / "calibration").mkdir()
    (tmp_path / "calibration" / "so-arm100.pbtxt").write_text(real)
    calibrate = str(robot(tmp_path, "calibrate_so_arm100"))
    done = run(tmp_path, "--config", calibrate, "--sim")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "the simulated arms perform all steps by themselves" in done.stdout
    assert "calibrated: leader_arm, follower_arm" in done.stdout
    assert (tmp_path / "calibration" / "so-arm100.pbtxt").read_text() == real, "that of the real arms"
    (file,) = (tmp_path / "state").rglob("so-arm100.pbtxt")
    assert calibrated_spans(file) == pytest.approx(
        [191.5, 252.1], abs=1.0
    )  # the first two joints of the model
    checked = run(tmp_path, "calibrate", "--check", "--sim", "--config", calibrate)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert checked.stdout.count("EQUAL  ") == 2
    file.write_text(file.read_text().replace('joint_name: "shoulder_', 'joint_name: "'))
    teleop = str(robot(tmp_path, "teleop_so_arm100"))
    ended = run(tmp_path, "--config", teleop, "--sim", "--duration", "1")
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "follows /leader_arm: lift → pan" in ended.stderr, "both go by their calibration"


def test_an_arm_that_the_file_calls_simulated_is_calibrated_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    text = simulation_file(arm='actuators: ["gripper"]')
    path.write_text(text.replace("MODE_SIMULATION", "MODE_CALIBRATION"))
    done = run(tmp_path, "--config", str(path))
    assert done.returncode == 0, done.stdout + done.stderr
    file = tmp_path / "calibration" / "sim-test.pbtxt"
    assert calibrated_spans(file) == pytest.approx([126.1], abs=1.0)
    path.write_text(text)
    file.write_text(file.read_text().replace("homing_offset: ", "homing_offset: 1"))
    refused = run(tmp_path, "--config", str(path), "--validate-only")
    assert refused.returncode == 2
    assert "gripper (id 1): calibrated from" in " ".join(refused.stderr.split())
    checked = run(tmp_path, "calibrate", "--check", "--config", str(path))
    assert checked.returncode == 1, checked.stdout + checked.stderr
    assert "DIFFERS  arm (simulation)" in checked.stdout
    assert "! gripper (id 1): calibrated from" in checked.stdout


def test_a_simulated_arm_of_the_file_keeps_its_calibration_until_sim_has_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    path = tmp_path / "robot.pbtxt"
    path.write_text(simulation_file(arm='actuators: ["gripper"]'))
    motor = MotorCalibration(id=1, joint_name="gripper", homing_offset=587, range_min=1400, range_max=2700)

    def calibrate(file: str, stamp: str) -> str:
        """Writes a calibration, and says whose a run with --sim takes."""
        arm = ArmCalibration(motors=(motor,), calibrated_at=stamp)
        ArmFile(file).prepare("arm", arm).commit()
        checked = check_file(Request(str(path)))
        take_calibrations(checked.loaded, (), calibration_place(False, simulate=True)(str(path), "sim-test"))
        (taken,) = checked.loaded.config.calibration.arms
        return str(taken.calibrated_at)

    beside = calibration_place(emulate=False)(str(path), "sim-test")
    assert calibrate(beside, "of the file") == "of the file"
    kept = calibration_place(emulate=False, simulate=True)(str(path), "sim-test")
    assert calibrate(kept, "of --sim") == "of --sim"
