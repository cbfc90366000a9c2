"""``--sim``: which part of the model stands for which device, and whole runs of ordinary presets."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from google.protobuf import text_format
from joshua.config import LoadedConfig
from joshua.planner.amend import NoSimulatorError, Simulated, simulate
from joshua.plugins import load_registry
from joshua.plugins.emulator import PhysicsCamera, SimAdapterError
from joshua.schema import config_pb2 as pb
from joshua.testing.domain import reserved_domain
from joshua.textproto.positions import Positions

CONFIGS = Path(__file__).resolve().parents[3] / "configs"


@pytest.fixture(autouse=True)
def _from_a_package(monkeypatch: pytest.MonkeyPatch) -> None:
    """The core is installed from a package, so that plugins are named by their distribution."""
    monkeypatch.setattr("joshua.plan.installing.clone", lambda: None)
    monkeypatch.setattr("joshua.plan.installing.origin", lambda *_: "")


def loaded(preset: str, more: str = "") -> LoadedConfig:
    text = (CONFIGS / preset).read_text() + more
    return LoadedConfig(preset, text_format.Parse(text, pb.Config()), Positions())


def result(preset: str, more: str = "") -> Simulated:
    """The simulated file; the one that was given stays as it is."""
    given = loaded(preset, more)
    before = given.config.SerializeToString(deterministic=True)
    found = simulate(given, load_registry())
    assert given.config.SerializeToString(deterministic=True) == before
    return found


def simulated(preset: str, more: str = "") -> pb.Config:
    return result(preset, more).loaded.config


def test_follower_is_the_arm_of_the_scene_and_the_leader_stands_beside_it() -> None:
    config = simulated("teleop_so_arm100.pbtxt")
    leader, follower = config.robot.actions
    assert follower.sim_config.actuators[0] == "shoulder_pan"
    assert not follower.sim_config.motion
    assert leader.sim_config.actuators[0] == "leader_arm/shoulder_pan"
    assert leader.sim_config.motion == pb.MOCK_MOTION_SINE
    assert [model.prefix for model in config.simulation.attached] == ["leader_arm/"]
    assert config.simulation.model_path == "so_arm100/scene.xml"


def test_cameras_go_by_the_words_of_their_name() -> None:
    config = simulated("teleop_so_arm100_camera.pbtxt")
    cameras = {p.node.node_name: p.sim_camera_config.camera for p in config.robot.perceptions}
    assert cameras == {"camera_top": "top", "camera_wrist": "wrist"}
    assert config.robot.perceptions[0].sim_camera_config.width == 640


def test_emulated_cameras_keep_their_driver_and_see_the_scene() -> None:
    given = loaded("teleop_so_arm100_camera.pbtxt")
    found = simulate(given, load_registry(), emulated=True)
    assert found.names == ("follower_arm", "camera_top", "camera_wrist")
    assert found.coupled["camera_wrist"] == PhysicsCamera("wrist")
    assert found.loaded.config.robot.perceptions == given.config.robot.perceptions


HUB = """<mujoco><worldbody>
<body><geom size="1"/><joint name="joint_a"/><joint name="joint_b"/></body></worldbody>
<actuator><position name="joint_a" joint="joint_a" ctrlrange="-1 1"/>
<position name="joint_b" joint="joint_b" ctrlrange="-1 1"/></actuator></mujoco>"""


def test_hub_that_the_model_has_is_simulated_without_a_battery(tmp_path: Path) -> None:
    (tmp_path / "hub.xml").write_text(HUB)
    hub = simulated(
        "test_spike_ble.pbtxt", f'simulation {{ mode: OFFSCREEN model_path: "{tmp_path}/hub.xml" }}'
    ).robot.actions[0]
    assert list(hub.sim_config.actuators) == ["joint_a", "joint_b"]
    assert [topic.topic_name for topic in hub.node.publishers] == ["/spike/joint_states"]


def test_actuators_that_the_model_has_not_are_refused() -> None:
    with pytest.raises(SimAdapterError, match="no actuators for spike_hub, whose joints are joint_a"):
        simulated("test_spike_ble.pbtxt")


def test_devices_that_stay_real_are_named() -> None:
    given = loaded("teleop_so_arm100.pbtxt")
    lidar = given.config.robot.perceptions.add(perception_type=pb.PERCEPTION_LIDAR)
    lidar.node.node_name = "lidar_front"
    lidar.lidar_config.SetInParent()
    assert simulate(given, load_registry()).real == ("lidar_front",)
    assert result("teleop_so_arm100.pbtxt").real == ()


def test_actuator_of_unknown_joints_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("joshua.planner.amend.joints_of", lambda *_: [])
    with pytest.raises(SimAdapterError, match="spike_hub: its block does not say which joints it has"):
        simulated("test_spike_ble.pbtxt")


def test_device_whose_emulator_is_no_part_of_the_physics_is_not_called_simulated() -> None:
    with pytest.raises(SimAdapterError, match="whose emulator can be part of the simulation"):
        simulate(loaded("test_spike_ble.pbtxt"), load_registry(), emulated=True)


def test_two_pairs_are_four_arms() -> None:
    config = simulated("teleop_dual_arm.pbtxt")
    assert len(config.simulation.attached) == 3
    places = [tuple(model.position_m) for model in config.simulation.attached]
    assert len(set(places)) == 3
    used = [name for action in config.robot.actions for name in action.sim_config.actuators]
    assert len(used) == len(set(used)) == 24


def test_own_scene_is_kept() -> None:
    config = simulated(
        "teleop_so_arm100.pbtxt", 'simulation { mode: MIRROR model_path: "so_arm100/pick_place.xml" }'
    )
    assert config.simulation.model_path == "so_arm100/pick_place.xml"


def test_model_with_too_few_actuators_gets_arms_beside_it(tmp_path: Path) -> None:
    (tmp_path / "cart.xml").write_text(
        "<mujoco><worldbody><body><geom size='1'/><joint name='j'/></body></worldbody></mujoco>"
    )
    config = simulated(
        "teleop_so_arm100.pbtxt", f'simulation {{ mode: OFFSCREEN model_path: "{tmp_path}/cart.xml" }}'
    )
    assert len(config.simulation.attached) == 2


def test_file_without_real_devices_has_nothing_to_replace() -> None:
    with pytest.raises(SimAdapterError, match="--sim has nothing to replace"):
        simulated("test_mock_hardware.pbtxt")


def test_missing_simulator_is_named() -> None:
    with pytest.raises(NoSimulatorError, match="pip install joshua-mujoco-sim"):
        simulate(loaded("teleop_so_arm100.pbtxt"), load_registry(blocked=("joshua-mujoco-sim",)))


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    with reserved_domain() as domain:
        return subprocess.run(
            [sys.executable, "-m", "joshua.cli.main", *arguments],
            capture_output=True,
            text=True,
            env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
            timeout=200,
        )


def test_teleoperation_runs_against_physics() -> None:
    ended = run("--config", str(CONFIGS / "teleop_so_arm100.pbtxt"), "--sim", "--duration", "4")
    assert ended.returncode == 0, ended.stderr
    assert "simulated: leader_arm, follower_arm" in ended.stdout
    assert "follows /leader_arm: shoulder_pan, shoulder_lift" in ended.stderr
    assert "/follower_arm/applied_command" in ended.stdout


def test_camera_on_the_wire_shows_the_simulation() -> None:
    small = "robot.perceptions[0].camera_config.width=160", "robot.perceptions[0].camera_config.height=120"
    arguments = ("--emulate", "--sim", "--set", small[0], "--set", small[1])
    for duration in ("2", "60"):  # a late machine has not drawn the scene in two seconds
        ended = run("--config", str(CONFIGS / "test_camera.pbtxt"), *arguments, "--duration", duration)
        if re.search("^PASS +/camera +picture has content", ended.stdout + ended.stderr, re.MULTILINE):
            break
    assert "simulated: camera" in ended.stdout
    assert "emulated: camera at http://127.0.0.1:" in ended.stdout
    for row in ("readings in order", "picture has content"):
        assert re.search(rf"^PASS +/camera +{row}", ended.stdout + ended.stderr, re.MULTILINE), ended.stderr


def test_nothing_to_replace_starts_nothing() -> None:
    ended = run("--config", str(CONFIGS / "test_mock_hardware.pbtxt"), "--sim")
    assert ended.returncode == 2
    assert "nothing was started" in ended.stderr
