"""MODE_TELEOPERATE: a person drives a robot with a leader or an input device."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.config.checks import Context
from joshua.config.checks.device_table import block_of
from joshua.config.checks.identity import title
from joshua.config.checks.topics import unfit_for, unpublished
from joshua.modes.queries import lacks
from joshua.modes.services import DATA_STORE, SIMULATION
from joshua.modes.spec import ModeSpec
from joshua.plan import Diagnostic
from joshua.plan.graph import Endpoint, NodeEntry
from joshua.schema import config_pb2 as pb
from joshua.textproto.nearest import nearest_first

# Upper limit of suggestions and of a follower's leaders.
_MOST_LEADERS = 50


def check(context: Context) -> Iterator[Diagnostic]:
    """Pair every follower with its leader."""
    sources = leaders(context)
    driven = [entry for entry in context.graph.actuators if not entry.leads]
    followed = {entry.path for entry in driven}
    leading = [item for group in sources.values() for item in group if item.entry.path not in followed]
    followers = [entry for entry in driven if entry.owner.action_type == pb.ACTION_FOLLOWER]
    if not leading and not (driven and all(map(context.graph.is_external, followers or driven))):
        yield from _no_leader(context)
    if not driven:
        yield lacks(
            context,
            "mode-lacks-follower",
            "an actuator that follows",
            "robot.actions",
            allowed=("ACTION_FOLLOWER", "ACTION_SINGLE", "ACTION_SPIKE", "ACTION_MOCK"),
        )
    if not leading or not driven:
        return
    for entry in followers:
        yield from _follower(context, entry, sources, leading[:_MOST_LEADERS])
    others = [
        item
        for entry in context.graph.actuators
        if entry.owner.action_type != pb.ACTION_FOLLOWER
        for item in context.graph.commands(entry)
    ]
    if not followers and not any(item.block.external or item.topic in sources for item in others):
        yield from _follower(context, driven[0], sources, leading[:_MOST_LEADERS])
    else:
        for item in others:
            if item.topic not in sources:
                yield from unpublished(context, item)
    for entry in driven:
        yield from joint_counts(context, entry, sources)


def leaders(context: Context) -> dict[str, list[Endpoint]]:
    """Possible commanders of an actuator in this mode, by topic. Models do not run in it."""
    sources = context.graph.command_sources.items()
    found = {topic: [item for item in group if not item.entry.is_model] for topic, group in sources}
    return {topic: group for topic, group in found.items() if group}


def _no_leader(context: Context) -> Iterator[Diagnostic]:
    silent = next((entry for entry in context.graph.actuators if entry.leads), None)
    if silent is not None:
        if not any(map(unfit_for, context.graph.of_entry(silent))):  # otherwise its wrong type is reported
            yield lacks(
                context,
                "mode-lacks-publisher",
                f"the leader {title(silent)} to publish its joints, but it publishes no JOINT_STATE",
                silent.path,
                position=context.position(silent.path),
                remedy="Add publishers { data_type: JOINT_STATE "
                f'topic_name: "/{title(silent)}/joint_states" publish_rate_hz: 50.0 }}',
            )
        return
    yield lacks(
        context,
        "mode-lacks-leader",
        "something to drive with: a leader arm, a gamepad or a keyboard that publishes JOINT_STATE",
        "robot",
        allowed=("ACTION_LEADER", "PERCEPTION_GAMEPAD", "PERCEPTION_KEYBOARD"),
        remedy="Add an actions block with action_type: ACTION_LEADER, or a perceptions block "
        "with a gamepad or keyboard, that publishes JOINT_STATE",
    )


def _follower(
    context: Context, entry: NodeEntry, sources: dict[str, list[Endpoint]], leading: list[Endpoint]
) -> Iterator[Diagnostic]:
    heard = context.graph.commands(entry)
    if any(item.block.external or item.topic in sources for item in heard):
        return
    related = context.see(f"{leading[0].path}.topic_name", f"topic of {title(leading[0].entry)}")
    topics = tuple(dict.fromkeys(item.topic for item in leading))
    if heard:
        path, nearby = f"{heard[0].path}.topic_name", tuple(nearest_first(heard[0].topic, topics))
        message = (
            f"{title(entry)} subscribes to {heard[0].topic}, which no node in this file publishes, "
            "so it would never move"
        )
        remedy = (
            f"Subscribe to the leader's topic {nearby[0]}, "
            "or set external: true if a node outside this file publishes it"
        )
    elif any(map(unfit_for, context.graph.of_entry(entry))):
        return  # its wrong type is reported
    else:
        path, nearby = f"{entry.path}.subscriptions", topics
        message = f"{title(entry)} has no leader: it subscribes to no JOINT_STATE topic"
        remedy = f'Add subscriptions {{ data_type: JOINT_STATE topic_name: "{topics[0]}" }}'
    yield context.error(
        "follower-without-leader", message, path, allowed=nearby, remedy=remedy, related=related
    )


def joint_counts(
    context: Context, entry: NodeEntry, sources: dict[str, list[Endpoint]]
) -> Iterator[Diagnostic]:
    """Note a leader and follower with different numbers of joints."""
    mine = joint_count(entry)
    for item in context.graph.commands(entry):
        for source in (item for item in sources.get(item.topic, ())[:_MOST_LEADERS] if item.entry.leads):
            theirs = joint_count(source.entry)
            if mine and theirs and mine != theirs:
                other, _ = block_of(source.entry.owner)
                yield context.warning(
                    "joint-count-mismatch",
                    f"{title(entry)} has {mine} motors and its leader {title(source.entry)} has {theirs}: "
                    "joints without a partner stay where they are",
                    f"{entry.owner_path}.{block_of(entry.owner)[0]}",
                    found=f"{mine} and {theirs} motors",
                    related=context.see(f"{source.entry.owner_path}.{other}", "block of the leader"),
                )


def joint_count(entry: NodeEntry) -> int:
    """Motors of an actuator; 0 if the file does not say."""
    name, block = block_of(entry.owner)
    if name == "plugin_config" or block is None:
        return 0
    if hasattr(block, "num_motors"):
        return int(block.num_motors)
    return len(getattr(block, "motor_ids", ()) or getattr(block, "port_names", ()))


SPEC = ModeSpec("MODE_TELEOPERATE", check, services=(DATA_STORE, SIMULATION))
