"""``--sim``: assign actuators and cameras of the model to the devices of a file.

The first arm that has a commander becomes the arm of the scene. Each further arm is a separate SO-ARM100
beside it. A leader moves by itself because no user can move it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
from joshua.api.schema import block_values
from joshua.api.schema import config_pb2 as pb
from joshua.api.schema import data_type_pb2 as types
from joshua.api.schema import simulation_pb2 as sim
from joshua.api.simulation import Coupling, PhysicsCamera, PhysicsLink, RealDevice, SimAdapterError

from joshua_mujoco_sim.drivable import Drivables, drivables
from joshua_mujoco_sim.model_file import Attachment, ModelError, load_model
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.settings_parts import variation, variation_defaults
from joshua_mujoco_sim.summary import summarise

SCENE = "so_arm100/scene.xml"
ARM = "so_arm100/so_arm100.xml"

#: Positions of further arms: beside the first one, a table's width apart, on alternating sides.
ARM_SPACING_M = 0.45


def simulate(config: Any, devices: Sequence[RealDevice], emulated: bool) -> dict[str, Coupling]:
    """Replace real devices with simulated ones.

    Args:
        config: the file, modified in place; devices: to replace.
        emulated: devices are emulated. The physics moves the joints of every arm but the leaders, which a
            hand moves, and draws what the cameras see.

    Returns:
        The couplings of the emulated devices, by node name.

    Raises:
        SimAdapterError: the model does not fit.
    """
    if not config.HasField("simulation"):
        config.simulation.mode = sim.OFFSCREEN
        config.simulation.model_path = SCENE
    arms = [device for device in devices if device.joints]
    if emulated:
        arms = [device for device in arms if device.role != "ACTION_LEADER"]
    chosen_by_arm = {}
    free = _joints(config.simulation)
    # followers first, so the arm in the middle of the scene is an active one
    for device in sorted(arms, key=lambda arm: arm.role == "ACTION_LEADER"):
        prefix = ""
        if len(free) < len(device.joints):
            prefix = _attach_arm(config.simulation, device)
            free = [name for name in _joints(config.simulation) if name.startswith(prefix)]
        chosen = _actuators(device, free, prefix, drivables(_model(config.simulation)))
        free = [name for name in free if name not in chosen] if not prefix else []
        if emulated:
            chosen_by_arm[device.node_name] = chosen
        else:
            _replace_arm(device, chosen)
    coupled: dict[str, Coupling] = {
        name: PhysicsLink(tuple(chosen), _start_rad(config.simulation, chosen))
        for name, chosen in chosen_by_arm.items()
    }
    cameras = summarise(_model(config.simulation))["cameras"]
    known = [name for name in cameras if "/" not in name]
    for device in devices:
        if device.joints:
            continue
        camera = _camera(device, known)
        if emulated:
            coupled[device.node_name] = PhysicsCamera(camera)
        else:
            _replace_camera(device, camera)
    return coupled


def _start_rad(simulation: Any, actuators: Sequence[str]) -> tuple[float, ...]:
    """Return the initial joint positions about the middle of their ranges."""
    seed = simulation.seed if simulation.HasField("seed") else None
    amounts = block_values(simulation.variation) if simulation.HasField("variation") else variation_defaults()
    physics = Physics(_model(simulation), keyframe=simulation.keyframe, variation=variation(seed, amounts))
    group = physics.group(actuators)
    return tuple(float(value) for value in group.position_rad - group.middle_rad)


def _attach_arm(simulation: Any, device: RealDevice) -> str:
    number = len(simulation.attached)
    side = 1 if number % 2 == 0 else -1
    prefix = f"{device.node_name}/"
    simulation.attached.add(
        model_path=ARM, prefix=prefix, position_m=(side * (number // 2 + 1) * ARM_SPACING_M, 0.0, 0.0)
    )
    if len(device.joints) > len(_joints(simulation)):
        raise SimAdapterError(
            f"{device.node_name} has {len(device.joints)} joints, more than an arm of the simulation: "
            "name a model with that many actuators in simulation.model_path"
        )
    return prefix


def _actuators(device: RealDevice, free: Sequence[str], prefix: str, found: Drivables) -> list[str]:
    """Joints by their names, else in the order of the model, for a chain of motors or as many.

    Any other device is none that the model has, and some part of an arm would move in its place.
    """
    joints = found.by_name()
    meant = [joints.get(f"{prefix}{joint}") for joint in device.joints]
    named = [joint.name for joint in meant if joint is not None and joint.name in free]
    if len(set(named)) == len(device.joints):
        return named
    count = len(device.joints)
    if len(free) != count and not (device.in_chain and len(free) > count):
        raise SimAdapterError(
            f"the model has no actuators for {device.node_name}, whose joints are "
            f"{', '.join(device.joints)}: free are {', '.join(free) or 'none'}; name a model that has them "
            f"in simulation.model_path, or leave {device.node_name} out of the file"
        )
    return list(free[:count])


def _replace_arm(device: RealDevice, actuators: Sequence[str]) -> None:
    action = device.owner
    action.ClearField(device.block_name)
    further = [topic for topic in action.node.publishers if topic.data_type != types.JOINT_STATE]
    for topic in further:  # such as a hub's battery, which no model has
        action.node.publishers.remove(topic)
    action.sim_config.actuators.extend(actuators)
    if device.role == "ACTION_LEADER":
        action.sim_config.motion = pb.MOCK_MOTION_SINE
    elif device.role != "ACTION_FOLLOWER":
        action.action_type = pb.ACTION_SINGLE


def _camera(device: RealDevice, cameras: Sequence[str]) -> str:
    """Return the camera of the model whose name is a word of the node's name, else the first."""
    words = device.node_name.split("_")
    return next((name for name in cameras if name in words), cameras[0])


def _replace_camera(device: RealDevice, camera: str) -> None:
    block = device.owner.camera_config
    width, height, fps = block.width, block.height, block.fps
    device.owner.ClearField(device.block_name)
    simulated = device.owner.sim_camera_config
    simulated.camera = camera
    simulated.width, simulated.height, simulated.fps = width, height, fps


def _joints(simulation: Any) -> list[str]:
    return [joint.name for joint in drivables(_model(simulation)).joints]


def _model(simulation: Any) -> mujoco.MjModel:
    attached = tuple(
        Attachment(model.model_path, model.prefix, tuple(model.position_m), model.yaw_rad)
        for model in simulation.attached
    )
    try:
        return load_model(simulation.model_path, None, attached)
    except ModelError as error:
        raise SimAdapterError(str(error)) from error
