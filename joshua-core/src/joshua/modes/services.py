"""The services that several modes share: data store, trainer and simulator."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from joshua.config.checks.device_table import value_name
from joshua.modes.spec import ServiceSpec
from joshua.plan.graph import RobotGraph, ServiceTopic
from joshua.plugins import SimulatorSpec, StoreSpec, TrainerSpec
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2, data_types
from joshua.schema import simulation_pb2 as sim

#: The process in which one physics simulates any number of devices.
PHYSICS_GROUP = "simulation"


def makes_episodes(config: pb.Config) -> bool:
    """Whether the simulator writes the data set."""
    return config.general.mode == pb.MODE_SIMULATION and config.simulation.HasField("generate")


def _data_store(config: pb.Config) -> Any | None:
    """The block, unless the simulator itself replays or writes the data set."""
    replays = config.general.mode == pb.MODE_SIMULATION and config.simulation.mode == sim.PASSIVE
    there = config.ai.HasField("data_store") and not replays and not makes_episodes(config)
    return config.ai.data_store if there else None


def _recorded(graph: RobotGraph, config: pb.Config) -> Iterator[ServiceTopic]:
    """A recorder subscribes to what the run publishes; a replay publishes commands and reads states."""
    if graph.replays:
        topics = {item.topic: item for item in graph.usable if item.is_command}
        for name, item in topics.items():
            yield ServiceTopic(name, data_types.type_name(item.block.data_type), is_publisher=True)
        states = (item for item in graph.usable if item.is_publisher and item.entry.is_actuator)
        for name in dict.fromkeys(item.topic for item in states if item.topic not in topics):
            yield ServiceTopic(name, data_types.type_name(data_type_pb2.JOINT_STATE))
    elif config.ai.data_store.operation != pb.DATA_STORE_UPLOAD:
        for name, number in graph.published.items():
            if number in data_type_pb2.DataType.values() and number:
                yield ServiceTopic(name, data_types.type_name(number))


DATA_STORE = ServiceSpec(
    "ai.data_store",
    _data_store,
    StoreSpec,
    value=lambda config: value_name(pb.DataFormat, config.ai.data_store.format),
    is_chosen=lambda config: bool(config.ai.data_store.format),
    topics=_recorded,
)


def _trainer(config: pb.Config) -> str:
    """The simulator selects a reinforcement learner, the method every other trainer."""
    training = config.ai.training
    if training.method == pb.METHOD_RL and training.simulator_backend:
        return value_name(pb.SimulatorBackend, training.simulator_backend)
    return value_name(pb.TrainingMethod, training.method)


def _trainer_is_chosen(config: pb.Config) -> bool:
    training = config.ai.training
    if _trainer(config) == "METHOD_RL":
        return bool(training.environment == pb.ENV_REAL)  # else its simulator decides
    return bool(training.method)


def judges_robot(config: pb.Config) -> bool:
    """Whether a model drives the robot in episodes that a person marks."""
    training = config.ai.training
    judges = training.method in (pb.METHOD_EVAL, pb.METHOD_IMITATION)
    return bool(training.environment == pb.ENV_REAL and judges)


def awaits_weights(config: pb.Config) -> bool:
    """Whether a training provides the weights of the model that drives the robot."""
    return judges_robot(config) and bool(config.ai.training.method == pb.METHOD_IMITATION)


def _judged(graph: RobotGraph, config: pb.Config) -> Iterator[ServiceTopic]:
    """An evaluation on the robot reads the episodes of the models, and the joints of their arms."""
    models = graph.models if judges_robot(config) else ()
    for model in models:
        yield ServiceTopic(f"{model.full_name}/episode", "diagnostic_msgs/msg/DiagnosticStatus")
    arms = {arm.path for model in models for arm in graph.driven_by(model)}
    for item in (item for item in graph.usable if item.is_publisher and item.entry.path in arms):
        if item.block.data_type == data_type_pb2.JOINT_STATE:
            yield ServiceTopic(item.topic, data_types.type_name(data_type_pb2.JOINT_STATE))
    block = config.ai.training.eval_config
    if models and not awaits_weights(config) and (block.videos or not block.HasField("videos")):
        for item in graph.pictures(block.camera)[:1]:
            yield ServiceTopic(item.topic, data_types.type_name(item.block.data_type))


TRAINING = ServiceSpec(
    "ai.training",
    lambda config: config.ai.training if config.ai.HasField("training") else None,
    TrainerSpec,
    value=_trainer,
    is_chosen=_trainer_is_chosen,
    topics=_judged,
    restart="stop-run",  # a trainer that begins again does not continue its run: resume_run does
)


def _simulation(config: pb.Config) -> Any | None:
    """The part of the block that the mode uses. Only MODE_SIMULATION generates episodes by itself."""
    if not config.HasField("simulation"):
        return None
    block = config.simulation
    if config.general.mode != pb.MODE_SIMULATION and block.HasField("generate"):
        block = sim.SimulationConfig()
        block.CopyFrom(config.simulation)
        block.ClearField("generate")
        block.ClearField("trajectory_path")  # which drives the episodes
    return block


def _mirrored(graph: RobotGraph, config: pb.Config) -> Iterator[ServiceTopic]:
    """A mirror follows the topics of its mappings, with the quality of service of their publishers."""
    if config.simulation.mode != sim.MIRROR:
        return
    names = (mapping.ros_topic for mapping in config.simulation.mirror_topic_mappings)
    for name in dict.fromkeys(name if name.startswith(("/", "~")) else f"/{name}" for name in names):
        yield ServiceTopic(name, "sensor_msgs/msg/JointState")


SIMULATION = ServiceSpec(
    "simulation",
    _simulation,
    SimulatorSpec,
    value=lambda config: value_name(sim.SimulationMode, config.simulation.mode),
    is_chosen=lambda config: bool(config.simulation.mode),
    topics=_mirrored,
    process_group=PHYSICS_GROUP,
    # a restarted physics begins from scratch and loses the state of the run
    restart="stop-run",
)
