"""What this distribution provides to the host."""

from __future__ import annotations

from joshua.plugins.hooks import hookimpl
from joshua.plugins.provision import Provision, ProvisionKind

from joshua_mujoco_sim.environments import ENVIRONMENTS


@hookimpl
def joshua_provisions() -> list[Provision]:
    """Names the simulator and the devices that are part of it."""
    return [
        Provision(
            kind=ProvisionKind.SIMULATOR,
            block="simulation",
            enum_values=("INTERACTIVE", "PASSIVE", "MIRROR", "OFFSCREEN"),
            implementation="joshua_mujoco_sim.node:SimulatorNode",
            behaviour="joshua_mujoco_sim.node:SimulatorNode",
            settings="joshua_mujoco_sim.settings:SimulationSettings",
            stand_in="joshua_mujoco_sim.stand_in:stand_in",
            packaged_files="joshua_mujoco_sim.catalog:find_packaged",
            summary="MuJoCo physics: window, replay, digital twin, rendering without a window",
        ),
        Provision(
            kind=ProvisionKind.ACTUATOR,
            block="sim_config",
            enum_values=("ACTION_LEADER", "ACTION_FOLLOWER", "ACTION_SINGLE"),
            implementation="joshua_mujoco_sim.actuator:SimActuator",
            settings="joshua_mujoco_sim.settings:SimActuatorSettings",
            summary="actuators of the simulated model",
            virtual=True,
        ),
        Provision(
            kind=ProvisionKind.SENSOR,
            block="sim_camera_config",
            enum_values=("PERCEPTION_CAMERA",),
            implementation="joshua_mujoco_sim.camera:SimCamera",
            settings="joshua_mujoco_sim.settings:SimCameraSettings",
            summary="camera of the simulated model",
            virtual=True,
        ),
        Provision(
            kind=ProvisionKind.ENVIRONMENT,
            block="training",
            enum_values=("BACKEND_MJX",),
            implementation="joshua_mujoco_sim.envs:make_vector_environment",
            environments=ENVIRONMENTS,
            summary="tasks that trainers can learn: reaching, picking and placing, the ant",
        ),
    ]
