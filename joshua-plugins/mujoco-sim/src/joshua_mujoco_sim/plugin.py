"""Declares the plugins of this distribution."""

from __future__ import annotations

from joshua.api import ActuatorSpec, PluginSpec, SensorSpec, SimulatorSpec, hookimpl
from joshua.api.specs import Environment, EnvironmentSpec

#: Declared as data, so listing them imports neither Gymnasium nor MuJoCo.
ENVIRONMENTS = (
    Environment(
        "joshua/SoArm100Reach-v0", ("reach", "reach_sparse"), "the gripper moves to a goal before the arm"
    ),
    Environment(
        "joshua/SoArm100PickPlace-v0",
        ("pick_place", "pick_place_sparse"),
        "the arm puts the cube on the goal and releases it",
    ),
    Environment("joshua/Ant-v0", ("forward",), "the ant runs along x"),
)


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the simulator and the devices that are part of it."""
    return [
        SimulatorSpec(
            block="simulation",
            enum_values=("INTERACTIVE", "PASSIVE", "MIRROR", "OFFSCREEN"),
            implementation="joshua_mujoco_sim.node:SimulatorNode",
            settings="joshua_mujoco_sim.settings:SimulationSettings",
            sim_adapter="joshua_mujoco_sim.sim_adapter:simulate",
            packaged_files="joshua_mujoco_sim.catalog:find_packaged",
            summary="MuJoCo physics: window, replay, digital twin, rendering without a window",
        ),
        ActuatorSpec(
            block="sim_config",
            enum_values=("ACTION_LEADER", "ACTION_FOLLOWER", "ACTION_SINGLE"),
            implementation="joshua_mujoco_sim.actuator:SimActuator",
            settings="joshua_mujoco_sim.settings:SimActuatorSettings",
            summary="actuators of the simulated model",
            virtual=True,
        ),
        SensorSpec(
            block="sim_camera_config",
            enum_values=("PERCEPTION_CAMERA",),
            implementation="joshua_mujoco_sim.camera:SimCamera",
            settings="joshua_mujoco_sim.settings:SimCameraSettings",
            summary="camera of the simulated model",
            virtual=True,
        ),
        EnvironmentSpec(
            block="training",
            enum_values=("BACKEND_MUJOCO", "BACKEND_MJX", "BACKEND_ISAAC"),
            implementation="joshua_mujoco_sim.envs:make_vector_environment",
            environments=ENVIRONMENTS,
            summary="tasks that trainers can learn: reaching, picking and placing, the ant",
        ),
    ]
