"""Topics: one type that the devices support, a publisher, and one commander per actuator."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from joshua.config.checks.context import Context
from joshua.config.checks.device_table import (
    block_of,
    device_block,
    fitting_blocks,
    frame_rate,
    messages_of,
    motor_ids,
    type_text,
)
from joshua.config.checks.identity import title
from joshua.plan import Diagnostic
from joshua.plan.graph import Endpoint
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2 as types
from joshua.textproto.field_facts import number_text
from joshua.textproto.nearest import nearest

# Every ROS 2 node publishes these without an entry in a file.
_SYSTEM_TOPICS = ("/rosout", "/parameter_events", "/clock", "/tf", "/tf_static", "/joint_states")

_MOST_NAMES = 200


def check(context: Context) -> Iterator[Diagnostic]:
    """Compare the endpoints of each topic with each other and with their devices."""
    for group in context.graph.by_topic.values():
        publishers = [item for item in group if item.is_publisher]
        yield from _types(context, group)
        yield from _publishers(context, publishers, group)
        yield from _external(context, publishers, group)
        yield from _motor_orders(context, publishers, group)
    for item in context.graph.endpoints:
        yield from _device_types(context, item)
    yield from _silent_sensors(context)
    yield from _unpublished(context)
    yield from _feedback(context)


def _types(context: Context, group: list[Endpoint]) -> Iterator[Diagnostic]:
    """The first publisher's type counts, or without a publisher the first subscription's.

    An endpoint whose device does not support its type is reported only for that.
    """
    typed = [item for item in group if item.block.data_type and unfit_for(item) is None]
    typed.sort(key=lambda item: not item.is_publisher)
    for item in typed[1:]:
        first = typed[0]
        if item.block.data_type == first.block.data_type:
            continue
        path = f"{item.path}.data_type"
        expected = type_text(first.block.data_type)
        verb = "publishes" if first.is_publisher else "subscribes to"
        yield context.error(
            "topic-type-mismatch",
            f"{title(first.entry)} {verb} {item.topic} as {expected}; a topic has one type, "
            "and endpoints of different types do not connect",
            path,
            found=type_text(item.block.data_type),
            allowed=(expected,),
            remedy=f"Write data_type: {expected}, or use another topic_name",
            related=context.see(f"{first.path}.data_type", f"type of {title(first.entry)}"),
        )


def _publishers(context: Context, publishers: list[Endpoint], group: list[Endpoint]) -> Iterator[Diagnostic]:
    commanded = next((item for item in group if item.is_command), None)
    for item in publishers:
        if item.block.HasField("override_motion_rad") and not (item.block.override and item.entry.leads):
            message = "override_motion_rad has no effect: it belongs to a leader arm with override: true"
            yield context.note("field-unused", message, f"{item.path}.override_motion_rad")
    for kind in (False, True):
        same = [item for item in publishers if bool(item.block.override) is kind]
        if kind and commanded is None:
            for item in same:
                message = f"override has no effect: {item.topic} commands no actuator of this file"
                yield context.note("field-unused", message, f"{item.path}.override")
            continue
        if len(same) < 2:
            continue
        for item in same[1:]:
            yield _two_publishers(context, same[0], item, commanded, overriding=kind)


def _external(context: Context, publishers: list[Endpoint], group: list[Endpoint]) -> Iterator[Diagnostic]:
    """Find actuators commanded by a node of the file and by nodes outside it."""
    first = next((item for item in publishers if not item.block.override), None)
    for item in group:
        if first is None or item.is_publisher or not item.block.external:
            continue
        path, related = f"{item.path}.external", context.see(f"{first.path}.topic_name", "published here")
        if item.is_command:
            yield context.warning(
                "command-topic-two-publishers",
                f"external: true lets any node command {title(item.entry)} on {item.topic} beside "
                f"{title(first.entry)}; the actuator would jerk between the two",
                path,
                remedy="Remove external, or subscribe to a topic of its own for commands from outside",
                related=related,
            )
        else:
            message = f"external has no effect: {title(first.entry)} publishes {item.topic}"
            yield context.note("field-unused", message, path, related=related)


def _motor_orders(
    context: Context, publishers: list[Endpoint], group: list[Endpoint]
) -> Iterator[Diagnostic]:
    """Find followers that list the motors of their leader in another order."""
    leaders = {item.entry.path: item.entry for item in publishers if item.entry.leads}
    followers = {item.entry.path: item.entry for item in group if item.is_command}
    for leader, follower in itertools.product(leaders.values(), followers.values()):
        _, leader_block, _ = device_block(leader.owner)
        name, follower_block, _ = device_block(follower.owner)
        leader_ids = motor_ids(leader_block) or []
        follower_ids = motor_ids(follower_block) or []
        if leader_ids == follower_ids or sorted(leader_ids) != sorted(follower_ids):
            continue
        yield context.note(
            "motor-order-differs",
            f"{title(follower)} lists the motors of {title(leader)} in another order. Joints of one name "
            "follow each other, others by their place in the list; messages and recordings of the two arms "
            "have different orders",
            f"{follower.owner_path}.{name}.motor_ids",
            found=str(follower_ids),
            allowed=(str(leader_ids),),
            remedy=f"Write motor_ids: {leader_ids}, unless the motors of the two arms have different places",
            related=context.see(f"{leader.owner_path}.{block_of(leader.owner)[0]}.motor_ids", title(leader)),
        )


def _two_publishers(
    context: Context, first: Endpoint, item: Endpoint, commanded: Endpoint | None, *, overriding: bool
) -> Diagnostic:
    path = f"{item.path}.topic_name"
    related = context.see(f"{first.path}.topic_name", f"{title(first.entry)} publishes it")
    names = f"{title(first.entry)} and {title(item.entry)}"
    if first.entry is item.entry:
        names = f"Two publishers of {title(item.entry)}"
    if commanded is None:
        message = f"{names} publish {item.topic}: subscribers get both streams mixed"
        return context.warning("topic-two-publishers", message, path, related=related)
    message = (
        f"{names} both command {title(commanded.entry)} on {item.topic}, which would jerk between the two"
    )
    remedy = (
        "Give one of them its own topic_name, or set override: true on the one that may override the other"
    )
    if overriding:
        message = f"{names} both have override: true on {item.topic}; only one may override the others"
        remedy = "Remove override from one of them and give it its own topic_name"
    return context.error(
        "command-topic-two-publishers",
        message,
        path,
        remedy=remedy,
        related=(
            *related,
            *context.see(f"{commanded.path}.topic_name", f"commands {title(commanded.entry)}"),
        ),
    )


def _unpublished(context: Context) -> Iterator[Diagnostic]:
    # In these modes, the mode's checks report an actuator without a commander.
    by_mode = context.config.general.mode in (pb.MODE_TELEOPERATE, pb.MODE_INFERENCE)
    for item in context.graph.usable:
        if item.is_publisher or item.topic in context.graph.published or item.topic in _SYSTEM_TOPICS:
            continue
        if not (by_mode and item.is_command):
            yield from unpublished(context, item)


def unpublished(context: Context, item: Endpoint) -> Iterator[Diagnostic]:
    """Warn of a subscription to a topic without a publisher, unless the file declares an external one."""
    if item.block.external:
        return
    path = f"{item.path}.topic_name"
    written = item.block.topic_name
    found = context.found(path)
    if written != item.topic:
        found += f", which is {item.topic} in full"
    number = item.block.data_type
    # The node's own topics do not help. The number of suggestions is limited.
    own = {endpoint.topic for endpoint in context.graph.of_entry(item.entry)}
    others = [
        name for name in itertools.islice(context.graph.published_by_nodes, _MOST_NAMES) if name not in own
    ]
    similar = nearest(item.topic, others)
    same_type = [name for name in others if number and context.graph.published_by_nodes[name] == number]
    outside = "set external: true if a node outside this file publishes it"
    yield context.warning(
        "topic-unpublished",
        f"No node in this file publishes {item.topic}, so "
        + (
            f"{title(item.entry)} never moves"
            if item.is_command
            else f"{title(item.entry)} waits for a node outside this file"
        ),
        path,
        found=found,
        allowed=tuple(dict.fromkeys([*similar, *same_type])),
        remedy=(f"Did you mean {similar[0]}? Otherwise " if similar else "Correct the name, or ") + outside,
    )


def _feedback(context: Context) -> Iterator[Diagnostic]:
    """Find nodes that subscribe to their own topic, which for an actuator is a command loop."""
    own = {(item.entry.path, item.topic): item for item in context.graph.usable if item.is_publisher}
    for item in context.graph.usable:
        publisher = own.get((item.entry.path, item.topic))
        if item.is_publisher or publisher is None:
            continue
        actuator = item.entry.is_actuator
        make = context.error if actuator else context.warning
        yield make(
            "topic-feedback",
            f"{title(item.entry)} subscribes to the topic that it publishes itself"
            + (", so its own state would command it" if actuator else ""),
            f"{item.path}.topic_name",
            remedy="Subscribe to the topic of the leader, model or input device"
            if actuator
            else "Subscribe to another topic",
            related=context.see(f"{publisher.path}.topic_name", "published here"),
        )


def unfit_for(item: Endpoint) -> tuple[int, ...] | None:
    """The types that the device of an endpoint supports; None if the endpoint's type is one of them."""
    messages = messages_of(item.entry.owner)
    allowed = messages.publishes if item.is_publisher else messages.takes
    fits = not item.block.data_type or allowed is None or item.block.data_type in allowed
    return None if fits else allowed


def _device_types(context: Context, item: Endpoint) -> Iterator[Diagnostic]:
    number = item.block.data_type
    owner = item.entry.owner
    allowed = unfit_for(item)
    what, _ = block_of(owner)
    if allowed is None or (what and what not in fitting_blocks(owner)):
        return  # if type and block do not match, it is unclear which of the two is meant
    device = title(item.entry) + (f" ({what})" if what else "")
    path = f"{item.path}.data_type"
    if not allowed:
        yield context.error(
            "subscription-unfit",
            f"{device} takes no input, so this subscription has no effect",
            item.path,
            found=f"subscription to {item.topic} as {type_text(number)}",
        )
        return
    verb = "publish" if item.is_publisher else "take commands as"
    yield context.error(
        "data-type-unfit",
        f"{device} cannot {verb} {type_text(number)}",
        path,
        allowed=tuple(type_text(entry) for entry in allowed),
        remedy=f"Write data_type: {type_text(allowed[0])}",
    )


def _silent_sensors(context: Context) -> Iterator[Diagnostic]:
    for entry in context.graph.entries:
        if entry.is_sensor and not entry.node.publishers:
            messages = messages_of(entry.owner).publishes or (types.JOINT_STATE,)
            rate = number_text(frame_rate(entry.owner)[1] or 30)
            sample = f'data_type: {type_text(messages[0])} topic_name: "/{title(entry)}"'
            message = f"{title(entry)} publishes no topic, so its readings are lost"
            remedy = f"Add publishers {{ {sample} publish_rate_hz: {rate} }}"
            yield context.warning("sensor-unpublished", message, entry.path, remedy=remedy)
