"""The task in Isaac Lab: scene, actions, observations, rewards, terminations, events. Imports Isaac Lab.

Import this module only after ``AppLauncher`` has started Isaac Sim, which provides the modules below.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import isaaclab.sim as sim_utils
import torch
from isaaclab.actuators import ImplicitActuatorCfg
from isaaclab.assets import ArticulationCfg, AssetBaseCfg, RigidObjectCfg
from isaaclab.envs import ManagerBasedRLEnv, ManagerBasedRLEnvCfg, mdp
from isaaclab.managers import (
    ActionTerm,
    ActionTermCfg,
    EventTermCfg,
    ObservationGroupCfg,
    ObservationTermCfg,
    RewardTermCfg,
    SceneEntityCfg,
    TerminationTermCfg,
)
from isaaclab.scene import InteractiveSceneCfg
from isaaclab.sim.converters import UrdfConverter, UrdfConverterCfg
from isaaclab.utils import configclass
from isaaclab_rl.rsl_rl import RslRlVecEnvWrapper

from joshua_isaac_trainer import scene
from joshua_isaac_trainer.robot import drives, robot_bodies, write_urdf
from joshua_isaac_trainer.tasks import TensorState, TensorTask
from joshua_isaac_trainer.tensors import TensorArrays

#: Name of the action term, which holds the state of the task.
ACTION = "task"


class LabReadings:
    """Readings of the scene of an environment, in the frame of each copy."""

    def __init__(self, env: Any, joints: Sequence[str]) -> None:
        self._scene = env.scene
        self._robot = env.scene["robot"]
        self.joint_ids, _ = self._robot.find_joints(list(joints), preserve_order=True)
        self._bodies: dict[str, int] = {}

    def joints(self) -> tuple[torch.Tensor, torch.Tensor]:
        """See ``Readings``."""
        data = self._robot.data
        return data.joint_pos[:, self.joint_ids], data.joint_vel[:, self.joint_ids]

    def body(self, name: str) -> tuple[torch.Tensor, torch.Tensor]:
        """See ``Readings``."""
        origins = self._scene.env_origins
        if name in self._scene.rigid_objects:
            data = self._scene[name].data
            return data.root_link_pos_w - origins, data.root_link_quat_w
        if name not in self._bodies:
            self._bodies[name] = self._robot.find_bodies(name)[0][0]
        index, data = self._bodies[name], self._robot.data
        return data.body_link_pos_w[:, index] - origins, data.body_link_quat_w[:, index]

    def speed(self, name: str) -> torch.Tensor:
        """See ``Readings``."""
        speed: torch.Tensor = self._scene[name].data.root_link_vel_w
        return speed


class TaskAction(ActionTerm):  # type: ignore[misc,unused-ignore]
    """Turns actions into goals of the joints as the task says, and holds the state that all terms read."""

    cfg: TaskActionCfg

    def __init__(self, cfg: TaskActionCfg, env: Any) -> None:
        super().__init__(cfg, env)
        self.task = TensorTask(cfg.environment_id, cfg.reward_function)
        arrays = TensorArrays(str(env.device))
        self.readings = LabReadings(env, tuple(drives(self.task.model)))
        self.state: TensorState = self.task.state(self.readings, env.num_envs, arrays)
        self.generator = torch.Generator(device=arrays.device)
        self.generator.manual_seed(cfg.seed)
        self.potentials = self.task.potentials(self.state)

    @property
    def action_dim(self) -> int:
        """Length of an action."""
        return self.task.task.action_size

    @property
    def raw_actions(self) -> torch.Tensor:
        """What the policy wants."""
        return self.state.action

    @property
    def processed_actions(self) -> torch.Tensor:
        """Goals of the joints, rad."""
        return self.state.ctrl

    def process_actions(self, actions: torch.Tensor) -> None:
        """Take the actions of a step; potentials are those from before it, or from its start."""
        self.potentials = self.task.potentials(self.state)
        self.task.act(self.state, actions)

    def apply_actions(self) -> None:
        """Set the goals of the drives, in each physics step."""
        self._asset.set_joint_position_target(self.state.ctrl, joint_ids=self.readings.joint_ids)

    def begin(self, env_ids: torch.Tensor) -> None:
        """Start episodes: joints, objects and goals as the task draws them."""
        state, task, env = self.state, self.task, self._env
        start = task.begin(len(env_ids), state.xp, self.generator)
        count = len(self.readings.joint_ids)
        joints = self.readings.joint_ids
        self._asset.write_joint_state_to_sim(
            start.qpos[:, :count], start.qvel[:, :count], joint_ids=joints, env_ids=env_ids
        )
        goals = task.first_goals(start)
        self._asset.set_joint_position_target(goals, joint_ids=joints, env_ids=env_ids)
        origins = env.scene.env_origins[env_ids]
        for name, columns in scene.free_bodies(task.model).items():
            pose = start.qpos[:, columns].clone()
            pose[:, :3] += origins
            env.scene[name].write_root_link_pose_to_sim(pose, env_ids=env_ids)
            still = torch.zeros((len(env_ids), 6), device=pose.device)
            env.scene[name].write_root_com_velocity_to_sim(still, env_ids=env_ids)
        state.mocap_pos[env_ids] = start.mocap_pos
        state.ctrl[env_ids] = goals
        state.action[env_ids] = state.last_action[env_ids] = 0.0


@configclass
class TaskActionCfg(ActionTermCfg):  # type: ignore[misc,unused-ignore]
    """Configuration of ``TaskAction``."""

    class_type: type = TaskAction
    environment_id: str = ""
    reward_function: str = ""
    seed: int = 0


def _held(env: Any) -> TaskAction:
    found: TaskAction = env.action_manager.get_term(ACTION)
    return found


def observed(env: Any, name: str) -> torch.Tensor:
    """Observation term of Isaac Lab: a part of the observation of the task."""
    held = _held(env)
    return held.task.observe(held.state, name)


def rewarded(env: Any, name: str) -> torch.Tensor:
    """Reward term of Isaac Lab: a term of the task, without its weight."""
    held = _held(env)
    return held.task.reward(held.state, name, held.potentials)


def ended(env: Any, name: str) -> torch.Tensor:
    """Termination term of Isaac Lab: a reason of the task."""
    held = _held(env)
    return held.task.ended(held.state, name)


def begun(env: Any, env_ids: torch.Tensor) -> None:
    """Event of Isaac Lab at a reset: how the task starts."""
    _held(env).begin(env_ids)


def environment_config(job: Mapping[str, Any], folder: Path) -> Any:
    """Return the configuration of the environments.

    Args:
        job: ``environment_id``, ``reward_function``, ``num_envs``, ``seed``, ``randomise``, ``device``.
        folder: for the robot's files.
    """
    task = TensorTask(job["environment_id"], job["reward_function"])
    parts = scene.parts(task.model)
    config = ManagerBasedRLEnvCfg()
    config.seed = job["seed"]
    config.decimation = scene.decimation(task.step_s)
    config.episode_length_s = task.task.max_steps * task.step_s
    config.sim = sim_utils.SimulationCfg(
        device=job["device"],
        dt=task.step_s / config.decimation,
        render_interval=config.decimation,
        physics_material=sim_utils.RigidBodyMaterialCfg(
            static_friction=scene.FRICTION, dynamic_friction=scene.FRICTION
        ),
    )
    config.scene = InteractiveSceneCfg(num_envs=job["num_envs"], env_spacing=scene.SPACING_M)
    config.scene.robot = _robot(task, folder)
    config.scene.light = AssetBaseCfg(
        prim_path="/World/light", spawn=sim_utils.DomeLightCfg(intensity=2500.0, color=(0.75, 0.75, 0.75))
    )
    for box in parts:
        setattr(config.scene, box.name, _box(box))
    config.actions = {
        ACTION: TaskActionCfg(
            asset_name="robot",
            environment_id=job["environment_id"],
            reward_function=job["reward_function"],
            seed=job["seed"],
        )
    }
    group = ObservationGroupCfg(concatenate_terms=True, enable_corruption=False)
    for term in task.task.observations:
        setattr(group, term.name, ObservationTermCfg(func=observed, params={"name": term.name}))
    config.observations = {"policy": group}
    # Isaac Lab multiplies rewards by the time of a step, and the task's weights are those of a step
    config.rewards = {
        name: RewardTermCfg(func=rewarded, weight=weight / task.step_s, params={"name": name})
        for name, weight in task.weights.items()
    }
    config.terminations = {
        term.name: TerminationTermCfg(func=ended, params={"name": term.name})
        for term in task.task.terminations
    }
    config.terminations["time_out"] = TerminationTermCfg(func=mdp.time_out, time_out=True)
    config.events = {"begin": EventTermCfg(func=begun, mode="reset")}
    if job["randomise"]:
        events = scene.randomisation(task.task, task.model)
        config.events |= {name: _event(event) for name, event in events.items()}
    return config


def make_environment(job: Mapping[str, Any], folder: Path) -> tuple[Any, TensorTask]:
    """Make the environments for rsl_rl. Returns them and their task."""
    env = ManagerBasedRLEnv(cfg=environment_config(job, folder))
    task = _held(env).task
    return LabVecEnv(env, task.success_terms), task


class LabVecEnv(RslRlVecEnvWrapper):  # type: ignore[misc,unused-ignore]
    """Environments for rsl_rl, with ``success`` in the extras of a step if the task judges it."""

    def __init__(self, env: Any, success_terms: Sequence[str]) -> None:
        super().__init__(env, clip_actions=None)
        self._success_terms = tuple(success_terms)

    def step(self, actions: torch.Tensor) -> tuple[Any, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Step all environments."""
        seen, rewards, dones, extras = super().step(actions)
        manager = self.unwrapped.termination_manager
        won = [manager.get_term(name) for name in self._success_terms]
        if won:
            extras["success"] = torch.stack(won).any(dim=0)
        return seen, rewards, dones, extras


def _robot(task: TensorTask, folder: Path) -> Any:
    model = task.model
    urdf = write_urdf(model, "robot", folder)
    gains = UrdfConverterCfg.JointDriveCfg.PDGainsCfg(stiffness=0.0, damping=0.0)  # the actuators set them
    usd = UrdfConverter(
        UrdfConverterCfg(
            asset_path=str(urdf),
            usd_dir=str(folder / urdf.stem),
            fix_base=True,
            merge_fixed_joints=False,
            self_collision=False,
            joint_drive=UrdfConverterCfg.JointDriveCfg(gains=gains, target_type="position"),
        )
    ).usd_path
    found = drives(model)
    home = model.key(task.task.keyframe).qpos
    base = robot_bodies(model)[0]
    return ArticulationCfg(
        prim_path="{ENV_REGEX_NS}/Robot",
        spawn=sim_utils.UsdFileCfg(
            usd_path=usd,
            articulation_props=sim_utils.ArticulationRootPropertiesCfg(
                enabled_self_collisions=False,
                solver_position_iteration_count=16,
                solver_velocity_iteration_count=1,
            ),
        ),
        init_state=ArticulationCfg.InitialStateCfg(
            pos=tuple(float(v) for v in model.body_pos[base]),
            rot=tuple(float(v) for v in model.body_quat[base]),
            joint_pos={name: float(home[model.joint(name).qposadr[0]]) for name in found},
        ),
        actuators={
            "servos": ImplicitActuatorCfg(
                joint_names_expr=list(found),
                stiffness={name: drive.stiffness for name, drive in found.items()},
                damping={name: drive.damping for name, drive in found.items()},
                effort_limit_sim={name: drive.effort for name, drive in found.items()},
                armature={name: drive.armature for name, drive in found.items()},
                friction={name: drive.friction for name, drive in found.items()},
            )
        },
    )


def _box(box: scene.Box) -> Any:
    look = sim_utils.PreviewSurfaceCfg(diffuse_color=box.colour)
    material = sim_utils.RigidBodyMaterialCfg(static_friction=box.friction, dynamic_friction=box.friction)
    shape = sim_utils.CuboidCfg(
        size=box.size_m,
        visual_material=look,
        physics_material=material,
        collision_props=sim_utils.CollisionPropertiesCfg(),
    )
    path = f"{{ENV_REGEX_NS}}/{box.name}"
    if box.mass_kg is None:
        return AssetBaseCfg(
            prim_path=path, spawn=shape, init_state=AssetBaseCfg.InitialStateCfg(pos=box.position_m)
        )
    shape.rigid_props = sim_utils.RigidBodyPropertiesCfg()
    shape.mass_props = sim_utils.MassPropertiesCfg(mass=box.mass_kg)
    state = RigidObjectCfg.InitialStateCfg(pos=box.position_m)
    return RigidObjectCfg(prim_path=path, spawn=shape, init_state=state)


def _event(event: scene.Event) -> Any:
    asset = SceneEntityCfg(event.asset, **event.parts)
    params = {"asset_cfg": asset, **event.parameters}
    return EventTermCfg(func=getattr(mdp, event.function), mode=event.mode, params=params)
