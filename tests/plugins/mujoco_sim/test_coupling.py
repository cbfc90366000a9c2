"""``--emulate --sim``: the driver speaks to an emulated bus, and physics moves the joints."""

from __future__ import annotations

import io
import logging
import math
import socket
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from joshua_emulator import EmulatedBus, EmulatedCamera
from joshua_mujoco_sim.actuator_group import ActuatorGroup
from joshua_mujoco_sim.coupling import CouplingServer, ServoDrives
from joshua_mujoco_sim.model_file import load_model
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.rendering import CameraRenderer
from joshua_mujoco_sim.world import World, WorldSettings
from joshua_sts3215.actuator import Sts3215Actuator
from joshua_sts3215.settings import Sts3215Settings
from PIL import Image

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")


def wait(condition: Callable[[], bool], seconds: float = 60) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture
def world() -> Iterator[World]:
    made = World(WorldSettings("so_arm100/scene.xml"))
    made.start()
    yield made
    made.close()


@pytest.fixture
def group(world: World) -> ActuatorGroup:
    return world.physics.group(JOINTS)


def positions(world: World, group: ActuatorGroup) -> np.ndarray:
    with world.lock:
        return group.position_rad


@pytest.fixture
def bus(world: World, group: ActuatorGroup, tmp_path: Path) -> Iterator[EmulatedBus]:
    server = CouplingServer(world, tmp_path / "bus.sock", logging.getLogger("test"))
    start = positions(world, group) - group.middle_rad
    with EmulatedBus(
        arm="so_arm100",
        identity="ARM1",
        calibrated=True,
        physics=tmp_path / "bus.sock",
        physics_actuators=JOINTS,
        physics_start_rad=start.tolist(),
    ) as emulated:
        yield emulated
    server.close()


@pytest.fixture
def arm(bus: EmulatedBus) -> Iterator[Sts3215Actuator]:
    settings = Sts3215Settings.model_validate(
        {
            "serial_number": "ARM1",
            "device_root": str(bus.root),
            "motor_ids": [1, 2, 3, 4, 5, 6],
            "calibration": bus.calibration(),
        }
    )
    actuator = Sts3215Actuator(settings)
    actuator.connect()
    yield actuator
    actuator.disconnect()


def test_driver_reads_where_the_physics_has_the_joints(world, group, arm) -> None:
    """The middle of each range is zero for a calibrated servo."""
    world.pause()  # a joint without torque sinks
    expected = positions(world, group) - group.middle_rad
    wait(lambda: bool(np.abs(arm.read().position_rad - expected).max() < 0.02))


def test_command_travels_by_bus_and_physics(world, group, arm) -> None:
    arm.enable()
    goal = arm.read().position_rad
    goal[0] += 0.5
    goal[5] += 0.4
    end = time.monotonic() + 60
    while np.abs(positions(world, group) - group.middle_rad - goal).max() > 0.05:
        arm.write(goal)
        time.sleep(0.02)
        assert time.monotonic() < end
    assert arm.read().position_rad == pytest.approx(goal, abs=0.1)


def test_released_arm_sinks_by_gravity(world, group, arm) -> None:
    arm.enable()
    wait(lambda: bool(np.abs(arm.read().velocity_rad_s).max() < 0.02))
    held = positions(world, group)
    time.sleep(0.5)
    assert positions(world, group) == pytest.approx(held, abs=0.05)
    arm.release()
    wait(lambda: bool(np.abs(positions(world, group) - held).max() > 0.1))


def test_obstacle_in_the_model_shows_as_load(world, group, arm) -> None:
    """The arm is told to go through the table; the servos say how hard they push."""
    arm.enable()
    goal = arm.read().position_rad
    goal[1] += 1.2
    end = time.monotonic() + 60
    while np.abs(arm.read().effort).max() < 0.5:
        arm.write(goal)
        time.sleep(0.02)
        assert time.monotonic() < end


def test_bus_outlives_the_simulation_and_joins_the_next(bus, world, arm, tmp_path) -> None:
    world.pause()  # a joint without torque sinks
    expected = positions(world, world.physics.group(JOINTS)) - world.physics.group(JOINTS).middle_rad
    wait(lambda: bool(np.abs(arm.read().position_rad - expected).max() < 0.02))
    before = arm.read().position_rad
    for link in list((tmp_path / "bus.sock").parent.glob("bus.sock")):
        link.unlink()
    assert arm.read().position_rad == pytest.approx(before, abs=0.05)


def test_servos_answer_while_the_simulation_makes_them_wait(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as silent:
        silent.bind(str(tmp_path / "bus.sock"))
        silent.listen()
        options: dict[str, Any] = {
            "physics": tmp_path / "bus.sock",
            "physics_actuators": JOINTS,
            "physics_start_rad": [0.0] * 6,
        }
        with EmulatedBus(arm="so_arm100", calibrated=True, **options) as bus:
            silent.settimeout(60)
            link, _ = silent.accept()
            assert link.recv(4096)
            took_s = []
            for _ in range(5):
                begun_s = time.monotonic()
                assert bus.servo(1)["id"] == 1
                took_s.append(time.monotonic() - begun_s)
            assert min(took_s) < 1.0  # the answer of the simulation may take seconds
            link.close()


def test_unknown_actuator_is_refused_with_the_reason(world, tmp_path, caplog) -> None:
    server = CouplingServer(world, tmp_path / "s.sock", logging.getLogger("joshua.test"))
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as link:
        link.connect(str(tmp_path / "s.sock"))
        link.send(b'{"actuators": ["elbow"]}')
        assert b"did you mean elbow_flex" in link.recv(4096)
    server.close()
    assert "cannot join the simulation" in caplog.text


@pytest.fixture
def server(world: World, tmp_path: Path) -> Iterator[CouplingServer]:
    made = CouplingServer(world, tmp_path / "bus.sock", logging.getLogger("joshua.test"))
    yield made
    made.close()


@pytest.fixture
def camera(tmp_path: Path) -> Iterator[EmulatedCamera]:
    with EmulatedCamera(160, 120, 20, physics=tmp_path / "bus.sock", physics_camera="top") as emulated:
        yield emulated


def one_picture(camera: EmulatedCamera) -> np.ndarray:
    with urllib.request.urlopen(camera.picture, timeout=60) as answer:
        return np.asarray(Image.open(io.BytesIO(answer.read())).convert("RGB"), np.int16)


def drawn(camera: EmulatedCamera) -> np.ndarray:
    wait(lambda: bool(one_picture(camera).max() > 0))  # in the dark until the simulation answers
    return one_picture(camera)


def test_emulated_camera_sees_the_scene_and_what_moves_in_it(world, camera, tmp_path) -> None:
    assert one_picture(camera).max() == 0  # before there is a simulation
    world.pause()  # a camera goes on while time stands still
    server = CouplingServer(world, tmp_path / "bus.sock", logging.getLogger("joshua.test"))
    before = drawn(camera)
    renderer = CameraRenderer(world.physics.model, "top", 160, 120)
    renderer.look(world.physics.data)
    expected = renderer.draw().astype(np.int16)
    renderer.close()
    assert np.abs(before - expected).mean() < 6  # what JPEG takes away
    with world.lock:
        world.physics.data.qpos[0] += 1.0
        mujoco.mj_forward(world.physics.model, world.physics.data)
    wait(lambda: bool(np.abs(one_picture(camera) - before).max() > 60))
    server.close()


def test_emulated_camera_changes_its_size_and_ends_with_the_simulation(server, camera) -> None:
    drawn(camera)
    camera.fault("size", "200x160")
    wait(lambda: drawn(camera).shape == (160, 200, 3))
    stream = urllib.request.urlopen(camera.source, timeout=60)
    entry = camera.wait_for(["frame"], timeout_s=60)
    wait(lambda: len(camera.log("frame", since=entry["sequence"])) > 5)
    sent = camera.log("frame")
    assert [frame["number"] for frame in sent] == sorted({frame["number"] for frame in sent})
    server.close()

    def is_quiet() -> bool:  # no old picture passes as a new one
        last = camera.log("frame")[-1]["sequence"]
        time.sleep(0.5)
        return camera.log("frame", since=last) == []

    wait(is_quiet)
    stream.close()


def test_unknown_camera_is_refused_with_the_reason(server, tmp_path, caplog) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as link:
        link.connect(str(tmp_path / "bus.sock"))
        link.send(b'{"camera": "tap", "width": 64, "height": 48}')
        assert b"no camera named 'tap'; it has top" in link.recv(4096)
    assert "an emulated camera cannot join the simulation" in caplog.text


def test_drives_limit_speed_and_torque() -> None:
    physics = Physics(load_model("so_arm100/scene.xml"))
    drives = ServoDrives(physics, ["gripper"])
    start = physics.group(("gripper",)).position_rad[0]
    drives.want(np.array([start + 1.0, 0.4, 0.5]))
    for _ in range(500):  # one second
        drives.drive(physics)
        physics.step()
    assert physics.data.ctrl[5] == pytest.approx(start + 0.5, abs=0.01)
    assert physics.model.actuator_forcerange[5] == pytest.approx((-1.34, 1.34))
    with pytest.raises(ValueError, match="3 values for 1 joints, or one that is not finite"):
        drives.want(np.array([np.nan, 1, 1]))


def test_a_hand_moves_the_joints_where_no_physics_runs(tmp_path: Path) -> None:
    """A calibration starts no node, so that nobody answers at the socket."""
    with EmulatedBus(
        arm="so_arm100",
        identity="ARM1",
        physics=tmp_path / "nobody.sock",
        physics_actuators=JOINTS,
        physics_start_rad=[0.5] * 6,
    ) as emulated:
        before = [servo["angle"] for servo in emulated.servos()]
        emulated.guide(None, 0.2)
        way = pytest.approx([-0.5 * 4096 / math.tau] * 6, abs=3)
        wait(lambda: [s["angle"] - a for s, a in zip(emulated.servos(), before, strict=True)] == way)
        time.sleep(0.1)
        assert [s["angle"] - a for s, a in zip(emulated.servos(), before, strict=True)] == way
