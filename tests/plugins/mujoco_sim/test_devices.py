"""Simulated actuators and cameras keep the contracts, and share one physics."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from joshua.devices.actuator import DeviceError
from joshua.devices.context import ActuatorContext, SensorContext
from joshua.plan import ActuatorFacts, SensorFacts
from joshua.plugins.block_context import BlockContext
from joshua.testing import check_actuator, check_sensor
from joshua_mujoco_sim.actuator import SimActuator
from joshua_mujoco_sim.camera import SimCamera
from joshua_mujoco_sim.model_file import load_model
from joshua_mujoco_sim.opengl import RenderingError, choose_gl
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.rendering import CameraRenderer
from joshua_mujoco_sim.settings import SimActuatorSettings, SimCameraSettings, SimulationSettings
from joshua_mujoco_sim.world import leave_world, shared_world


def context(model_path: str = "so_arm100/scene.xml", **more: Any) -> BlockContext:
    simulation = {
        "mode": "OFFSCREEN",
        "model_path": model_path,
        "folder": "",
        "mirror_topic_mappings": (),
        "real_time_factor": 1.0,
        "keyframe": "",
        "on_divergence": "DIVERGENCE_RESET",
        "joint_state_rate_hz": 50.0,
        "trajectory_path": "",
        "replay_speed": 1.0,
    }
    return BlockContext(simulation=simulation | more)


def actuator(facts: BlockContext, *names: str, motion: str = "none") -> SimActuator:
    values = {
        "actuators": list(names),
        "motion": motion,
        "motion_amplitude_rad": 0.3,
        "motion_frequency_hz": 1.0,
        "motion_file": "",
    }
    return SimActuator(
        SimActuatorSettings.model_validate(SimActuatorSettings.si_values(values, None, facts)),
        ActuatorContext(ActuatorFacts(simulation=facts.simulation)),
    )


def camera(facts: BlockContext, name: str = "top") -> SimCamera:
    values = {"camera": name, "width": 160, "height": 120, "fps": 20}
    return SimCamera(
        SimCameraSettings.model_validate(SimCameraSettings.si_values(values, None, facts)),
        SensorContext(SensorFacts(simulation=facts.simulation)),
    )


def wait(condition: Callable[[], bool], seconds: float = 60) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def settle(arm: SimActuator) -> None:
    """Waits until the joints hold still; simulated time may be far behind the clock."""
    wait(lambda: bool(np.abs(arm.read().velocity_rad_s).max() < 0.01))


@pytest.fixture
def rendering() -> None:
    try:
        choose_gl()
    except RenderingError as error:
        pytest.skip(f"no picture can be drawn here: {error}")


def test_arm_keeps_the_contract_of_actuators() -> None:
    facts = context()
    check_actuator(lambda: actuator(facts, "shoulder_pan", "wrist_flex"), timeout_s=30)


def test_camera_keeps_the_contract_of_sensors(rendering) -> None:
    facts = context()
    check_sensor(lambda: camera(facts), timeout_s=30)


def test_camera_sees_the_arm_move(rendering) -> None:
    facts = context()
    arm, eye = actuator(facts, "shoulder_pan"), camera(facts)
    arm.connect()
    eye.connect()
    try:
        arm.enable()
        before = eye.read(30)
        arm.write(np.array([1.0]))
        wait(lambda: bool(abs(arm.read().position_rad[0] - 1.0) <= 0.05))
        eye.read(30)
        after = eye.read(30)
        assert before is not None
        assert after is not None
        assert after.sequence > before.sequence
        changed = np.abs(after.data.astype(int) - before.data).max(axis=2) > 40
        assert changed.mean() > 0.005
        message = eye.message(after, "sensor_msgs/msg/CameraInfo", "top")
        assert message.k[0] == pytest.approx(60 / np.tan(np.deg2rad(50 / 2)))
    finally:
        eye.disconnect()
        arm.disconnect()


def test_pictures_show_the_time_at_which_they_were_due(rendering) -> None:
    """The same steps give the same pictures, however late the drawing thread is."""
    facts = context()
    world = shared_world(SimulationSettings.model_validate(facts.simulation).world())
    world.pause()
    eye = camera(facts)
    eye.connect()
    try:
        group = world.physics.group(())
        group.set_command(group.range_max_rad)
        world.step_paused(1)
        first = eye.read(30)
        world.step_paused(40)  # a frame is due after 25 steps
        second = eye.read(30)
    finally:
        eye.disconnect()
        leave_world(world)
    physics = Physics(load_model("so_arm100/scene.xml"))
    physics.group(()).set_command(physics.group(()).range_max_rad)
    renderer = CameraRenderer(physics.model, "top", 160, 120)
    for reading, steps in ((first, 1), (second, 24)):
        physics.step(steps)
        renderer.look(physics.data)
        assert np.array_equal(reading.data, renderer.draw())
    renderer.close()
    assert not np.array_equal(first.data, second.data)


def test_cameras_of_one_rate_take_their_pictures_at_the_same_moments(rendering) -> None:
    facts = context()
    world = shared_world(SimulationSettings.model_validate(facts.simulation).world())
    world.pause()
    eyes = [camera(facts), camera(facts, "front")]

    def step(count: int) -> None:
        until_s = world.physics.time_s + (count - 0.5) * world.physics.timestep_s
        world.step_paused(count)
        wait(lambda: world.physics.time_s >= until_s)

    try:
        for eye in eyes:  # the second one joins between two pictures of the first
            eye.connect()
            step(7)
        assert eyes[0].read(30) is not None
        step(10)  # 24 steps; a frame is due after 25
        assert [eye.read(0.1) for eye in eyes] == [None, None]
        step(1)
        assert all(eye.read(30) is not None for eye in eyes)
    finally:
        for eye in eyes:
            eye.disconnect()
        leave_world(world)


def test_devices_of_one_file_share_one_physics() -> None:
    facts = context()
    first, second = actuator(facts, "shoulder_pan"), actuator(facts, "gripper")
    first.connect()
    second.connect()
    world = shared_world(SimulationSettings.model_validate(facts.simulation).world())
    try:
        second.enable()
        second.write(np.array([0.8]))

        def gripper_rad() -> float:
            with world.lock:
                return float(world.physics.data.joint("gripper").qpos[0])

        wait(lambda: abs(gripper_rad() - 0.8) < 0.05)
    finally:
        first.disconnect()
        second.disconnect()
        leave_world(world)


def test_released_leader_follows_its_own_motion() -> None:
    arm = actuator(context(), "shoulder_pan", motion="sine")
    arm.connect()
    try:
        seen = []

        def moves() -> bool:
            seen.append(float(arm.read().position_rad[0]))
            return max(seen) - min(seen) > 0.3

        wait(moves)
    finally:
        arm.disconnect()


def test_an_arm_with_torque_stays_and_a_released_one_falls() -> None:
    arm = actuator(context(keyframe="home"), "shoulder_lift")
    arm.connect()
    try:
        arm.enable()
        time.sleep(0.3)
        settle(arm)
        start = arm.read().position_rad[0]
        time.sleep(0.3)
        assert arm.read().position_rad[0] == pytest.approx(start, abs=0.02)
        with pytest.raises(ValueError, match="shoulder_lift is nan"):
            arm.write(np.array([np.nan]))
        arm.release()
        wait(lambda: abs(arm.read().position_rad[0] - start) > 0.2)
        assert np.abs(arm.read().effort).max() < 0.05
    finally:
        arm.disconnect()


def test_shadows_are_drawn_unless_the_file_leaves_them_out(rendering) -> None:
    shown = []
    for shadows in (True, False):
        eye = camera(context(shadows=shadows))
        eye.connect()
        try:
            reading = eye.read(30)
            assert reading is not None
            shown.append(reading.data.astype(int))
        finally:
            eye.disconnect()
    darker = (shown[1] - shown[0]).max(axis=2) > 30
    assert 0.003 < darker.mean() < 0.3


def test_wheels_turn_to_their_angle() -> None:
    wheels = actuator(context("lekoch/scene.xml"), "wheel_left", "wheel_right", "wheel_back")
    wheels.connect()
    try:
        wheels.enable()
        start = wheels.read().position_rad
        wheels.write(start + 1.0)
        wait(lambda: bool(np.abs(wheels.read().position_rad - start - 1.0).max() < 0.1))
    finally:
        wheels.disconnect()


def test_a_motor_turns_to_its_angle() -> None:
    leg = actuator(context("ant/ant.xml"), "hip_1")
    leg.connect()
    try:
        leg.enable()
        leg.write(np.array([0.4]))
        wait(lambda: bool(abs(leg.read().position_rad[0] - 0.4) < 0.02))
    finally:
        leg.disconnect()


def test_without_a_simulation_nothing_connects() -> None:
    arm = SimActuator(actuator(context(), "gripper").settings)
    with pytest.raises(DeviceError, match="no simulation block"):
        arm.connect()


def test_unknown_gl_is_refused(monkeypatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "elg")
    with pytest.raises(RenderingError, match="'elg', which MuJoCo does not know: unset MUJOCO_GL, or"):
        choose_gl()


def test_a_window_library_needs_a_display(monkeypatch) -> None:
    monkeypatch.setattr("joshua_mujoco_sim.opengl.sys.platform", "linux")
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    monkeypatch.setenv("DISPLAY", ":0")
    assert choose_gl() == "glfw"
    monkeypatch.delenv("DISPLAY")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(RenderingError, match="names a display: unset MUJOCO_GL, or set MUJOCO_GL=egl"):
        choose_gl()


def test_a_display_that_cannot_be_opened_ends_the_connection_at_once(monkeypatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    monkeypatch.setenv("DISPLAY", ":9999")
    warnings.simplefilter("ignore")  # GLFW warns of the same
    started = r"OpenGL cannot be started with MUJOCO_GL=glfw: .*try MUJOCO_GL=egl"
    with pytest.raises(DeviceError, match=started):
        camera(context()).connect()


def test_missing_gl_names_the_packages(monkeypatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr("joshua_mujoco_sim.opengl.sys.platform", "linux")

    def nothing(name: str) -> None:
        raise OSError(name)

    monkeypatch.setattr("joshua_mujoco_sim.opengl.ctypes.CDLL", nothing)
    with pytest.raises(RenderingError, match=r"sudo apt install libegl1 libgl1-mesa-dri or libosmesa6"):
        choose_gl()
