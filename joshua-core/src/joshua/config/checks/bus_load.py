"""How long one control cycle occupies a servo bus.

Packet layouts of the Feetech STS/SMS protocol (the public register tables and memory map of the STS3215):

- sync read request: ``FF FF FE LEN 82 address count id… checksum``: 8 bytes and 1 for each servo
- status reply: ``FF FF id LEN error data… checksum``: 6 bytes and the data, one reply from each servo
- sync write: ``FF FF FE LEN 83 address count (id data…)… checksum``: 8 bytes and 1 + data for each servo

A serial line of 8 data bits without parity carries 10 bits for each byte.
"""

from __future__ import annotations

from typing import NamedTuple

BITS_PER_BYTE = 10
REQUEST_OVERHEAD = 8
REPLY_OVERHEAD = 6

# Position, speed and load (registers 56 to 61): what a JointState needs at least.
FEEDBACK_BYTES = 6
# Goal position (register 42): the least that a command writes.
COMMAND_BYTES = 2

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


def sts3215_cycle(servos: int, baudrate: int, *, commanded: bool) -> BusCycle:
    """Computes the shortest cycle of an STS3215 bus: read the state and, if commanded, write the goals.

    Args:
        servos: servos on the bus, at least 1; baudrate: above zero, bit/s.
        commanded: whether goals are written in each cycle.
    """
    return BusCycle(
        servos=servos,
        baudrate=baudrate,
        request=REQUEST_OVERHEAD + servos,
        replies=servos * (REPLY_OVERHEAD + FEEDBACK_BYTES),
        command=REQUEST_OVERHEAD + servos * (1 + COMMAND_BYTES) if commanded else 0,
    )


def rate_text(rate_hz: float) -> str:
    """A rate rounded down to three digits, so that the figure shown is allowed."""
    step = 10 ** max(len(str(int(rate_hz))) - 3, 0) if rate_hz >= 100 else 0.1
    return f"{int(rate_hz / step) * step:.4g}"


def _milliseconds(duration_s: float) -> str:
    value = duration_s * 1000
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"
