"""Publish rates that the device cannot reach: a camera's frame rate, the bytes of a bus.

A cycle of a servo bus is a sync read of the state, one reply from each servo and, if the arm is commanded, a
sync write of the goals. Both requests have an overhead, 1 byte (the id) per servo, and the data to write. A
serial line with 8 data bits and no parity carries 10 bits per byte. The schema states the bytes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from joshua.config.checks.context import Context
from joshua.config.checks.device_table import device_block, frame_rate, motor_ids
from joshua.plan import Diagnostic
from joshua.plan.graph import NodeEntry
from joshua.schema import data_type_pb2 as types
from joshua.schema.options_pb2 import BusRule
from joshua.textproto.field_facts import field_facts, number_text

BITS_PER_BYTE = 10

# A USB adapter adds 1 to 2 ms to a cycle in practice. This is the lower figure.
ADAPTER_DELAY_S = 0.001

_PICTURES = (types.IMAGE, types.COMPRESSED_IMAGE)


def check(context: Context) -> Iterator[Diagnostic]:
    """Compare each publish rate with the rate of its device."""
    for entry in context.graph.entries:
        name, block, rule = device_block(entry.owner)
        rates = [
            (publisher.publish_rate_hz, f"{entry.path}.publishers[{index}].publish_rate_hz", publisher)
            for index, publisher in enumerate(entry.node.publishers)
            if math.isfinite(publisher.publish_rate_hz) and publisher.publish_rate_hz > 0
        ]
        field, fps = frame_rate(entry.owner)
        if rule.HasField("bus") and rates:
            # One cycle serves all publishers of the node, so the fastest decides.
            rate, path, _ = max(rates, key=lambda item: item[0])
            yield from _bus(context, entry, (name, block, rule.bus), rate, path)
        elif field and int(fps) > 0:
            for rate, path, publisher in rates:
                if publisher.data_type in _PICTURES and rate > int(fps):
                    yield context.error(
                        "rate-above-camera",
                        f"The camera delivers {int(fps)} pictures a second, so it cannot publish "
                        f"{number_text(rate)}",
                        path,
                        allowed=(f"above 0, at most {int(fps)} Hz",),
                        remedy=f"Lower publish_rate_hz to {int(fps)}, or raise fps if the camera offers more",
                        related=context.see(f"{entry.owner_path}.{name}.{field}", "pictures per second"),
                    )


def _bus(
    context: Context, entry: NodeEntry, device: tuple[str, Any, BusRule], rate: float, path: str
) -> Iterator[Diagnostic]:
    name, block, protocol = device
    servos, link = len(motor_ids(block) or ()), getattr(block, "comm", None)
    if servos == 0 or link is None:
        return
    baudrate = link.serial.baudrate
    speed = next(item for item in field_facts(link.serial.DESCRIPTOR) if item.name == "baudrate")
    if not speed.contains(baudrate):
        return  # reported separately
    cycle = bus_cycle(protocol, servos, baudrate, commanded=bool(entry.node.subscriptions))
    related = context.see(f"{entry.owner_path}.{name}.comm.serial.baudrate", "line speed")
    practical = rate_text(cycle.practical_rate_hz)
    if rate > cycle.max_rate_hz:
        yield context.error(
            "rate-above-bus",
            f"The servo bus cannot carry this rate ({cycle.calculation()})",
            path,
            allowed=(f"above 0, at most {rate_text(cycle.max_rate_hz)} Hz",),
            remedy=f"Lower publish_rate_hz to {practical}, which leaves time for the adapter's delay, or "
            "raise the baud rate of the servos and of this block",
            related=related,
        )
    elif rate > cycle.practical_rate_hz:
        yield context.warning(
            "rate-tight-on-bus",
            f"At this rate the servo bus has no time left for the 1 to 2 ms delay of a USB adapter "
            f"({cycle.calculation()})",
            path,
            allowed=(f"above 0, at most {practical} Hz",),
            remedy=f"Lower publish_rate_hz to {practical} or less",
            related=related,
        )


class BusCycle(NamedTuple):
    """Bytes of one control cycle on a servo bus.

    Attributes:
        servos: servos on the bus; baudrate: line speed, bit/s.
        request, replies, command: bytes of the sync read, of its replies and of the sync write.
    """

    servos: int
    baudrate: int
    request: int
    replies: int
    command: int

    @property
    def total_bytes(self) -> int:
        """Bytes of the whole cycle."""
        return self.request + self.replies + self.command

    @property
    def duration_s(self) -> float:
        """Time of the bytes on the line, without turn-around and adapter delays."""
        return self.total_bytes * BITS_PER_BYTE / self.baudrate

    @property
    def max_rate_hz(self) -> float:
        """Highest number of cycles per second on the line."""
        return 1.0 / self.duration_s

    @property
    def practical_rate_hz(self) -> float:
        """Highest number of cycles per second with the delay of a USB adapter."""
        return 1.0 / (self.duration_s + ADAPTER_DELAY_S)

    def calculation(self) -> str:
        """The calculation in words."""
        command = f" + sync write {self.command}" if self.command else ""
        servos = f"{self.servos} servo{'' if self.servos == 1 else 's'}"
        return (
            f"{servos}: sync read {self.request} + replies {self.replies}"
            f"{command} = {self.total_bytes} bytes = {self.total_bytes * BITS_PER_BYTE} bits; "
            f"at {self.baudrate} bit/s {_milliseconds(self.duration_s)} ms a cycle, "
            f"at most {rate_text(self.max_rate_hz)} Hz"
        )


def bus_cycle(protocol: BusRule, servos: int, baudrate: int, *, commanded: bool) -> BusCycle:
    """Compute the shortest cycle of a servo bus: read the state and, if commanded, write the goals.

    Args:
        servos: servos on the bus, at least 1; baudrate: above zero, bit/s.
        commanded: whether goals are written in each cycle.
    """
    return BusCycle(
        servos=servos,
        baudrate=baudrate,
        request=protocol.request + servos,
        replies=servos * (protocol.reply + protocol.feedback),
        command=protocol.request + servos * (1 + protocol.command) if commanded else 0,
    )


def rate_text(rate_hz: float) -> str:
    """A rate rounded down to three digits, which keeps the shown figure allowed."""
    step = 10 ** max(len(str(int(rate_hz))) - 3, 0) if rate_hz >= 100 else 0.1
    return f"{int(rate_hz / step) * step:.4g}"


def _milliseconds(duration_s: float) -> str:
    value = duration_s * 1000
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"
