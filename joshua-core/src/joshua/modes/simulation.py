"""MODE_SIMULATION: a simulation block, and mappings where the model mirrors a robot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from joshua.config.checks import Context
from joshua.config.checks.device_table import type_text
from joshua.config.names import topic_fault
from joshua.modes.queries import lacks
from joshua.modes.services import DATA_STORE, SIMULATION
from joshua.modes.spec import ModeSpec
from joshua.plan import Diagnostic
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2 as types
from joshua.schema import simulation_pb2 as sim
from joshua.textproto.nearest import nearest

_MAPPINGS = "simulation.mirror_topic_mappings"


def check(context: Context) -> Iterator[Diagnostic]:
    """Require the simulation block and what its mode needs."""
    simulation = context.config.simulation
    if not context.config.HasField("simulation"):
        what = "the block simulation, which names the model and how it is shown"
        remedy = "Add simulation { mode: INTERACTIVE model_path: ... }"
        yield lacks(context, "mode-lacks-block", what, "simulation", remedy=remedy)
        return
    stored = context.config.ai.HasField("data_store")
    if simulation.mode == sim.PASSIVE and not stored and not simulation.trajectory_path:
        yield context.error(
            "mode-lacks-block",
            "PASSIVE replays a recording, but neither simulation.trajectory_path nor ai.data_store names one",
            "ai.data_store",
            position=context.position("simulation.mode"),
            remedy='Add trajectory_path: "recordings/wave.csv" to simulation, '
            "or ai { data_store { ... operation: DATA_STORE_REPLAY } }",
        )
    recording = simulation.trajectory_path or context.config.ai.data_store.local_path
    if simulation.mode == sim.PASSIVE and stored and not recording:
        message = "PASSIVE replays the data set of ai.data_store, but that has no local_path"
        remedy = 'Add local_path: "datasets/my_data"'
        yield context.error("mode-lacks-field", message, "ai.data_store.local_path", remedy=remedy)
    if simulation.HasField("generate") and not context.config.ai.data_store.local_path:
        message = "generate makes episodes, but no ai.data_store with a local_path says where to store them"
        remedy = (
            "Add ai { data_store { format: FORMAT_HUGGINGFACE storage: STORAGE_LOCAL "
            'dataset_name: ... local_path: "datasets/mine" task: ... } }'
        )
        yield context.error("mode-lacks-block", message, "ai.data_store", remedy=remedy)
    elif simulation.HasField("generate") and context.config.ai.data_store.storage == pb.STORAGE_CLOUD:
        message = "generate writes episodes to this machine and uploads none"
        folder = context.config.ai.data_store.local_path
        remedy = (
            f"Set storage: STORAGE_LOCAL, and upload with `joshua dataset upload {folder} URL` afterwards"
        )
        path = "ai.data_store.storage"
        yield context.error("not-allowed", message, path, allowed=("STORAGE_LOCAL",), remedy=remedy)
    if simulation.mode == sim.MIRROR:
        yield from _mirror(context, simulation)
    elif simulation.mirror_topic_mappings and simulation.mode in sim.SimulationMode.values()[1:]:
        message = (
            f"mirror_topic_mappings have an effect only with mode: MIRROR, but the mode is "
            f"{sim.SimulationMode.Name(simulation.mode)}"
        )
        remedy = "Remove them, or set mode: MIRROR in simulation"
        related = context.see("simulation.mode", "mode")
        yield context.note("block-unused", message, f"{_MAPPINGS}[0]", remedy=remedy, related=related)


def _mirror(context: Context, simulation: sim.SimulationConfig) -> Iterator[Diagnostic]:
    if not simulation.mirror_topic_mappings:
        yield context.error(
            "mode-lacks-block",
            "MIRROR needs mirror_topic_mappings, which say what moves the model",
            _MAPPINGS,
            position=context.position("simulation.mode"),
            remedy='Add mirror_topic_mappings { ros_topic: "/follower/joint_states" '
            'mujoco_actuator: "gripper" } for each actuator of the model',
        )
    published = context.graph.published
    first: dict[str, int] = {}
    noted: set[str] = set()
    for index, mapping in enumerate(simulation.mirror_topic_mappings):
        path = f"{_MAPPINGS}[{index}]"
        name = mapping.mujoco_actuator
        if name and first.setdefault(name, index) != index:
            message = f"The actuator {name} of the model is driven twice"
            related = context.see(f"{_MAPPINGS}[{first[name]}].mujoco_actuator", "first mapping")
            yield context.error("mapping-duplicate", message, f"{path}.mujoco_actuator", related=related)
        yield from _topic(context, f"{path}.ros_topic", mapping.ros_topic, published, noted)


def _topic(
    context: Context, path: str, topic: str, published: dict[str, int], noted: set[str]
) -> Iterator[Diagnostic]:
    """A mirror may follow a robot of another file, so a topic without a publisher is only a note."""
    if not topic or topic_fault(topic) is not None:
        return
    name = topic if topic.startswith("/") else f"/{topic}"
    if name not in published:
        similar = nearest(name, published)
        if not similar and name in noted:
            return
        noted.add(name)
        make = context.warning if similar else context.note
        message = f"No node of this file publishes {name}; the mirror waits for a robot that runs elsewhere"
        remedy = f"Did you mean {similar[0]}?" if similar else "Start the robot's own file beside this one"
        yield make("mapping-unpublished", message, path, allowed=tuple(similar), remedy=remedy)
    elif published[name] not in (types.JOINT_STATE, types.DATA_TYPE_UNSPECIFIED):
        yield context.error(
            "mapping-type",
            f"A mirror follows JOINT_STATE topics, and {name} is {type_text(published[name])}",
            path,
            allowed=tuple(other for other, number in published.items() if number == types.JOINT_STATE),
        )


def _for_file(spec: ModeSpec, config: pb.Config) -> ModeSpec:
    """A mirror has a separate name, because it may follow a simulation in the same domain."""
    if config.simulation.mode != sim.MIRROR:
        return spec
    return replace(spec, services=(DATA_STORE, replace(SIMULATION.needed(), node_name="twin")))


SPEC = ModeSpec("MODE_SIMULATION", check, services=(DATA_STORE, SIMULATION.needed()), for_file=_for_file)
