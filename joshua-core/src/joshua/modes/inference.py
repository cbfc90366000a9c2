"""MODE_INFERENCE: models get observations and drive actuators."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.config.checks import Context
from joshua.config.checks.identity import title
from joshua.config.checks.topics import unpublished
from joshua.modes.queries import lacks
from joshua.modes.services import DATA_STORE, SIMULATION
from joshua.modes.spec import ModeSpec
from joshua.plan import Diagnostic
from joshua.plan.graph import COMMAND_TYPES, NodeEntry
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2 as types
from joshua.schema.rules import value_rule

_MOST_NAMES = 50


def check(context: Context) -> Iterator[Diagnostic]:
    """Check the path from observations through each model to an actuator."""
    if not context.graph.models:
        yield lacks(
            context, "mode-lacks-model", "a model that drives the robot", "ai.models", allowed=_model_types()
        )
    if not context.graph.actuators:
        what = "an actuator that a model can drive"
        remedy = "Add robot { actions { ... } } with a node that subscribes to the model's topic"
        yield lacks(context, "mode-lacks-actuator", what, "robot.actions", remedy=remedy)
    yield from _commands(context)
    commands = {item.topic for entry in context.graph.actuators for item in context.graph.commands(entry)}
    cameras = tuple(item.topic for item in context.graph.pictures()[:_MOST_NAMES])
    for entry in context.graph.models:
        yield from _actions_out(context, entry, commands)
        if value_rule(pb.ModelType.DESCRIPTOR, entry.owner.model_type).needs_images:
            yield from _observations_in(context, entry, cameras)


def _model_types() -> tuple[str, ...]:
    """Types of models, those with weights first, a third party's last."""
    enum = pb.ModelType.DESCRIPTOR
    names = {
        value.name: (value.name.endswith("_PLUGIN"), value_rule(enum, value.number).weights)
        for value in enum.values
        if value.number
    }
    return tuple(sorted(names, key=lambda name: names[name]))


def _commands(context: Context) -> Iterator[Diagnostic]:
    """Report actuators without a commander, unless the cause is a model that drives nothing."""
    sources = context.graph.command_sources
    driving = [topic for topic, group in sources.items() if any(item.entry.is_model for item in group)]
    heard = [item for entry in context.graph.actuators for item in context.graph.commands(entry)]
    if any(item.topic in driving for item in heard):
        for item in heard:
            if item.topic not in sources:
                yield from unpublished(context, item)


def _actions_out(context: Context, entry: NodeEntry, commands: set[str]) -> Iterator[Diagnostic]:
    endpoints, place = context.graph.of_entry(entry), context.position(entry.path)
    own = [item for item in endpoints if item.is_publisher and item.block.data_type in COMMAND_TYPES]
    if not entry.node.publishers:
        what = f"the model {title(entry)} to publish its actions, but it publishes no topic"
        remedy = 'Add publishers { data_type: JOINT_STATE topic_name: "/ai/actions" publish_rate_hz: 10.0 }'
        yield lacks(context, "mode-lacks-publisher", what, entry.path, position=place, remedy=remedy)
    elif own and context.graph.actuators and not any(item.topic in commands for item in own):
        actuators = context.graph.actuators
        yield context.error(
            "model-drives-nothing",
            f"No actuator subscribes to {own[0].topic}, so {title(entry)} drives nothing",
            f"{own[0].path}.topic_name",
            allowed=tuple(sorted(commands)[:_MOST_NAMES]),
            remedy=f'Add subscriptions {{ data_type: JOINT_STATE topic_name: "{own[0].topic}" }} to the node '
            f"{title(actuators[0])}"
            + (", or publish on the topic that it subscribes to" if commands else ""),
            related=context.see(f"{actuators[0].path}.subscriptions[0].topic_name", "topic of the actuator")
            if commands
            else (),
        )


def _observations_in(context: Context, entry: NodeEntry, cameras: tuple[str, ...]) -> Iterator[Diagnostic]:
    if any(item.data_type in (types.IMAGE, types.COMPRESSED_IMAGE) for item in entry.node.subscriptions):
        return
    sample = cameras[0] if cameras else "/camera/top/image_raw"
    yield context.error(
        "model-without-camera",
        f"{title(entry)} is a vision model but subscribes to no camera",
        f"{entry.path}.subscriptions",
        allowed=cameras,
        remedy=f'Add subscriptions {{ data_type: IMAGE topic_name: "{sample}" }}',
    )


SPEC = ModeSpec("MODE_INFERENCE", check, models=True, services=(DATA_STORE, SIMULATION))
