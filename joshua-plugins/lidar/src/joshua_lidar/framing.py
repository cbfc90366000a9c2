"""Finds packets in a stream of bytes, from any place on, and judges whether the line can be trusted."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from typing import NamedTuple

#: Packets in a row that make a line trustworthy. An 8-bit checksum lets one damaged packet in 256 through,
#: one of two equal damages even more often; on a line that damages every other packet some would get past.
TRUST_RUN = 32

#: Good packets after which a single damaged one does not end the trust.
FORGIVE_RUN = 2 * TRUST_RUN


class Packet(NamedTuple):
    """One packet: its place in the stream and its bytes."""

    start: int
    data: bytes

    @property
    def end(self) -> int:
        """Bytes of the stream up to its end."""
        return self.start + len(self.data)


class PacketFinder(ABC):
    """Finds packets that have a header and a checksum, back to back in a stream.

    After a damaged place the search goes on one byte behind the header that was none, so no whole packet is
    lost, whatever stands before it. At the beginning, and after two damaged places close to each other,
    packets are held back until ``trust_run`` of them have come without a byte between them; those count, and
    all after them. On a line that damages every other packet nothing counts.

    Args:
        header: how a packet begins.
        shortest: bytes from which ``length`` can be told.
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
        """Length of the packet whose first ``shortest`` bytes stand at a place; 0 if none can be."""

    @abstractmethod
    def valid(self, packet: bytes) -> bool:
        """Whether the checksum, and what else must hold, holds."""

    def find(self, data: bytes) -> list[Packet]:
        """Take the next bytes; return the packets that count from now on."""
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
