"""Message types that the device behind a topic can publish or listen to."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.config.checks.context import Context
from joshua.config.checks.device_table import block_of, fitting_blocks, messages_of
from joshua.config.checks.identity import title
from joshua.config.checks.topics import type_text
from joshua.plan import Diagnostic
from joshua.plan.graph import Endpoint
from joshua.schema import data_type_pb2 as types


def check(context: Context) -> Iterator[Diagnostic]:
    """Compares the types of each endpoint with its device, and finds sensors that say nothing."""
    for endpoint in context.graph.endpoints:
        yield from _device_types(context, endpoint)
    yield from _silent_sensors(context)


def _device_types(context: Context, item: Endpoint) -> Iterator[Diagnostic]:
    number = item.block.data_type
    owner = item.entry.owner
    messages = messages_of(owner)
    allowed = messages.publishes if item.is_publisher else messages.hears
    if not number or allowed is None or number in allowed:
        return
    what, _ = block_of(owner)
    if what and what not in fitting_blocks(owner):
        return  # it is not known which of the two is meant
    device = title(item.entry) + (f" ({what})" if what else "")
    path = f"{item.path}.data_type"
    if not allowed:
        yield context.error(
            "subscription-unfit",
            f"{device} listens to no topic, so this subscription would have no effect",
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
            sample = (
                f'data_type: {type_text(messages[0])} topic_name: "/{title(entry)}" publish_rate_hz: 30.0'
            )
            yield context.warning(
                "sensor-unpublished",
                f"{title(entry)} publishes no topic, so nobody gets what it measures",
                entry.path,
                remedy=f"Add publishers {{ {sample} }}",
            )
