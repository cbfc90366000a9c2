"""How long one control cycle occupies a bus of motors, from the bytes that the schema states.

A cycle is a sync read of the state, one reply from each servo, and a sync write of the goals where the arm is
commanded. Both requests have an overhead, and 1 byte (its id) for each servo, and the data to write.
A serial line of 8 data bits without parity carries 10 bits for each byte.
"""

from __future__ import annotations

from typing import NamedTuple

from joshua.schema.options_pb2 import BusRule

BITS_PER_BYTE = 10

# A USB adapter adds 1 to 2 ms to a cycle in practice; the smaller figure is used.
ADAPTER_DELAY_S = 0.001


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
        """Time that the bytes take on the line; turn-around and adapter come on top."""
        return self.total_bytes * BITS_PER_BYTE / self.baudrate

    @property
    def max_rate_hz(self) -> float:
        """Cycles per second that the line can carry at most."""
        return 1.0 / self.duration_s

    @property
    def practical_rate_hz(self) -> float:
        """Cycles per second that remain with the delay of a USB adapter."""
        return 1.0 / (self.duration_s + ADAPTER_DELAY_S)

    def calculation(self) -> str:
        """The sum in words."""
        command = f" + sync write {self.command}" if self.command else ""
        servos = f"{self.servos} servo{'' if self.servos == 1 else 's'}"
        return (
            f"{servos}: sync read {self.request} + replies {self.replies}"
            f"{command} = {self.total_bytes} bytes = {self.total_bytes * BITS_PER_BYTE} bits; "
            f"at {self.baudrate} bit/s {_milliseconds(self.duration_s)} ms a cycle, "
            f"at most {rate_text(self.max_rate_hz)} Hz"
        )


def bus_cycle(protocol: BusRule, servos: int, baudrate: int, *, commanded: bool) -> BusCycle:
    """Computes the shortest cycle of a servo bus: read the state and, if commanded, write the goals.

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
    """A rate rounded down to three digits, so that the figure shown is allowed."""
    step = 10 ** max(len(str(int(rate_hz))) - 3, 0) if rate_hz >= 100 else 0.1
    return f"{int(rate_hz / step) * step:.4g}"


def _milliseconds(duration_s: float) -> str:
    value = duration_s * 1000
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"
