"""Publish rates that the device behind them can keep: the camera's frames, the bus's bytes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from joshua.config.checks.bus_load import bus_cycle, rate_text
from joshua.config.checks.context import Context
from joshua.config.checks.device_table import device_block, frame_rate
from joshua.plan import Diagnostic
from joshua.plan.graph import NodeEntry
from joshua.schema import data_type_pb2 as types
from joshua.schema.comm_pb2 import Serial
from joshua.schema.options_pb2 import KIND_MOTOR_ID, BusRule
from joshua.textproto.field_facts import field_facts, number_text

_PICTURES = (types.IMAGE, types.COMPRESSED_IMAGE)


def check(context: Context) -> Iterator[Diagnostic]:
    """Compares each publish rate with what the device behind it can deliver."""
    for entry in context.graph.entries:
        name, block, rule = device_block(entry.owner)
        if rule.HasField("bus"):
            yield from _bus(context, entry, name, block, rule.bus)
            continue
        field, fps = frame_rate(entry.owner)
        if field:
            yield from _camera(context, entry, f"{entry.owner_path}.{name}.{field}", int(fps))


def _camera(context: Context, entry: NodeEntry, fps_path: str, fps: int) -> Iterator[Diagnostic]:
    for index, publisher in enumerate(entry.node.publishers):
        if publisher.data_type in _PICTURES and _usable(publisher.publish_rate_hz) and fps > 0:
            rate = publisher.publish_rate_hz
            if rate <= fps:
                continue
            path = f"{entry.path}.publishers[{index}].publish_rate_hz"
            yield context.error(
                "rate-above-camera",
                f"The camera delivers {fps} pictures a second, so {number_text(rate)} cannot be published",
                path,
                allowed=(f"above 0, at most {fps} Hz",),
                remedy=f"Lower publish_rate_hz to {fps}, or raise fps if the camera offers more",
                related=context.see(fps_path, "pictures per second"),
            )


def _bus(
    context: Context, entry: NodeEntry, name: str, block: Any, protocol: BusRule
) -> Iterator[Diagnostic]:
    facts = field_facts(block.DESCRIPTOR)
    ids = [item.name for item in facts if item.repeated and item.kind == KIND_MOTOR_ID]
    serial = block.comm.serial if any(item.name == "comm" for item in facts) else Serial()
    servos, baudrate = sum(len(getattr(block, field)) for field in ids), serial.baudrate
    rates = [
        (publisher.publish_rate_hz, index)
        for index, publisher in enumerate(entry.node.publishers)
        if _usable(publisher.publish_rate_hz)
    ]
    if not rates or servos == 0 or not _allowed(serial, "baudrate"):
        return
    # One cycle feeds all publishers of the node, so the fastest decides.
    rate, index = max(rates)
    cycle = bus_cycle(protocol, servos, baudrate, commanded=bool(entry.node.subscriptions))
    if rate <= cycle.practical_rate_hz:
        return
    path = f"{entry.path}.publishers[{index}].publish_rate_hz"
    related = context.see(f"{entry.owner_path}.{name}.comm.serial.baudrate", "line speed")
    if rate > cycle.max_rate_hz:
        yield context.error(
            "rate-above-bus",
            f"The servo bus cannot carry this rate ({cycle.calculation()})",
            path,
            allowed=(f"above 0, at most {rate_text(cycle.max_rate_hz)} Hz",),
            remedy=f"Lower publish_rate_hz to {rate_text(cycle.practical_rate_hz)}, which leaves room for "
            "the adapter's delay, or raise the baud rate of the servos and of this block",
            related=related,
        )
    else:
        yield context.warning(
            "rate-tight-on-bus",
            f"The servo bus has no room for a USB adapter's delay of 1 to 2 ms at this rate "
            f"({cycle.calculation()})",
            path,
            allowed=(f"above 0, at most {rate_text(cycle.practical_rate_hz)} Hz",),
            remedy=f"Lower publish_rate_hz to {rate_text(cycle.practical_rate_hz)} or less",
            related=related,
        )


def _allowed(message: Any, name: str) -> bool:
    """Whether a number lies in its range; what does not is reported for itself."""
    facts = next(item for item in field_facts(message.DESCRIPTOR) if item.name == name)
    return facts.contains(getattr(message, name))


def _usable(rate: float) -> bool:
    return math.isfinite(rate) and rate > 0
