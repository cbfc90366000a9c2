"""Packet framing in a byte stream from any offset, with a check whether the line can be trusted."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from typing import NamedTuple

#: Packets in a row that make a line trustworthy. An 8-bit checksum lets one damaged packet in 256 through,
#: and equal pairs of errors more often; on a line that damages every other packet some would get past.
TRUST_RUN = 32

#: Good packets after which a single damaged one does not revoke trust.
FORGIVE_RUN = 2 * TRUST_RUN


class Packet(NamedTuple):
    """One packet: its offset in the stream and its bytes."""

    start: int
    data: bytes

    @property
    def end(self) -> int:
        """Offset of its end in the stream."""
        return self.start + len(self.data)


class PacketFinder(ABC):
    """Finds contiguous packets with a header and a checksum in a stream.

    After damage the search resumes one byte behind the false header, so no intact packet is lost. At the
    start, and after two damages close together, packets are held back until ``trust_run`` of them have
    arrived without a gap; these and all later ones are accepted. On a line that damages every other packet
    nothing is accepted.

    Args:
        header: first bytes of a packet.
        shortest: number of bytes that ``length`` needs.
        trust_run: packets in a row that make the line trustworthy; 1 accepts each.
    """

    def __init__(self, header: re.Pattern[bytes], shortest: int, trust_run: int = TRUST_RUN) -> None:
        self.packets = 0
        self.damaged = 0
        self._header = header
        self._shortest = shortest
        self._trust_run = trust_run
        self._buffer = b""
        self._offset = 0  # of the buffer in the stream
        self._last_end = -1
        self._run = 0
        self._trusted = trust_run <= 1
        self._held: list[Packet] = []

    @abstractmethod
    def length(self, buffer: bytes, start: int) -> int:
        """Return the length of the packet that begins at an offset; 0 if it cannot be one."""

    @abstractmethod
    def valid(self, packet: bytes) -> bool:
        """Return whether the checksum and all other constraints hold."""

    def find(self, data: bytes) -> list[Packet]:
        """Add bytes; return the packets that are now accepted."""
        buffer = self._buffer + data
        size, place = len(buffer), 0
        counted: list[Packet] = []
        while True:
            match = self._header.search(buffer, place)
            if match is None:
                place = max(place, size - 1)  # the last byte may be the first of a header
                break
            place = match.start()
            if size - place < self._shortest:
                break
            length = self.length(buffer, place)
            if size - place < length:
                break
            packet = buffer[place : place + length]
            if length and self.valid(packet):
                self._judge(Packet(self._offset + place, packet), counted)
                place += length
            else:
                place += 1
        self._buffer = buffer[place:]
        self._offset += place
        self.packets += len(counted)
        return counted

    def _judge(self, packet: Packet, counted: list[Packet]) -> None:
        if packet.start == self._last_end:
            self._run += 1
        else:
            if self._last_end >= 0:
                self.damaged += 1
            self._trusted = self._trust_run <= 1 or (self._trusted and self._run >= FORGIVE_RUN)
            self._held.clear()
            self._run = 1
        self._last_end = packet.end
        if not self._trusted:
            self._held.append(packet)
            if self._run < self._trust_run:
                return
            self._trusted = True
            counted += self._held
            self._held.clear()
        else:
            counted.append(packet)
