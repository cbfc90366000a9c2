"""Emulated encoders on a line: a microcontroller that sends text, or AMT21s that reply."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Sequence

from joshua_emulator.encoder.shaft import Shaft
from joshua_emulator.event_log import EventLog
from joshua_emulator.lidar.line_faults import LineFaults
from joshua_emulator.wire import BITS_PER_BYTE, TimedReply

LINE, AS5600, AMT21 = "line", "as5600", "amt21"

_AMT21_TURNAROUND_S = 3e-6
_CLOCK_US = 1 << 32
_STATUS_GOOD, _STATUS_NO_MAGNET = 0x20, 0x00


class EncoderDevice:
    """The encoders of one link.

    Args:
        protocol: line, as5600 or amt21; resolution: counts in one revolution.
        addresses: of AMT21 encoders; the second one sits on a shaft geared one to two, and so on.
        rate_hz: lines a second.
        counter_range: of a line's counter: it starts again after so many counts; 0: it continues.
        crc: lines end with a CRC. times: lines carry the microcontroller's time.

    Attributes:
        baudrate: at which it talks; a host at another one hears noise.
        silent, frozen, no_magnet: faults.
    """

    def __init__(
        self,
        protocol: str,
        resolution: int,
        baudrate: int,
        log: EventLog,
        faults: LineFaults,
        *,
        addresses: Sequence[int] = (0x54,),
        rate_hz: float = 200.0,
        counter_range: int = 0,
        crc: bool = False,
        times: bool = True,
    ) -> None:
        self.protocol, self.resolution, self.log, self.faults = protocol, resolution, log, faults
        self.baudrate = self.original_baudrate = baudrate
        self.addresses = tuple(addresses)
        self.shaft = Shaft(time.monotonic())
        self.silent = self.frozen = self.no_magnet = False
        self.sent = 0
        self._period_s = 1.0 / rate_hz
        self._counter_range, self._crc, self._times = counter_range, crc, times
        self._due_s = time.monotonic()
        self._noise = random.Random(6)  # noqa: S311 - reproducible noise, no secrets
        self._number = 0
        self._last_line = b""

    def count(self, now_s: float, place: int = 0) -> int:
        """The count of an encoder: its whole counts, or those within a turn."""
        turned = math.floor(self.shaft.angle_rad(now_s) / (1 << place) * self.resolution / math.tau)
        if self.protocol == LINE:
            return turned % self._counter_range if self._counter_range else turned
        return turned % self.resolution

    def reset_line(self) -> None:
        """Do nothing: there is no state to reset after a replug."""

    def produce(self, now_s: float, line_speed: int) -> list[TimedReply]:
        """Return the due lines."""
        if self.protocol == AMT21:
            return []
        sent = []
        while self._due_s <= now_s:
            at_s, self._due_s = self._due_s, self._due_s + self._period_s
            if now_s - self._due_s > 1.0:  # this process was stalled
                self._due_s = now_s
            if not self.silent and not self.faults.drops():
                if not self.frozen:
                    self._last_line = self._line(at_s)
                sent.append(self._reply(at_s, self.faults.disturb(self._last_line), line_speed))
                self.sent += 1
        return sent

    def receive(self, data: bytes, line_speed: int, now_s: float) -> list[TimedReply]:
        """Process bytes from the host; each AMT21 replies to its address."""
        if self.protocol != AMT21 or line_speed != self.baudrate or self.silent:
            return []
        answers = []
        for byte in data:
            if byte in self.addresses and not self.faults.drops():
                count = self.count(now_s, self.addresses.index(byte))
                answer = self.faults.disturb(amt21_answer(count, self.resolution))
                answers.append(self._reply(now_s + _AMT21_TURNAROUND_S, answer, line_speed))
                self.sent += 1
        return answers

    def _line(self, now_s: float) -> bytes:
        text = str(self.count(now_s))
        if self._times:
            text += f",{int(now_s * 1e6) % _CLOCK_US}"
            if self.protocol == AS5600:
                text += f",{_STATUS_NO_MAGNET if self.no_magnet else _STATUS_GOOD}"
        if self._crc:
            text += f"*{crc8(text.encode()):02X}"
        return text.encode() + b"\r\n"

    def _reply(self, at_s: float, data: bytes, line_speed: int) -> TimedReply:
        self._number += 1
        if line_speed != self.baudrate:
            data = self._noise.randbytes(max(1, len(data) * line_speed // self.baudrate))
        return TimedReply(at_s + len(data) * BITS_PER_BYTE / self.baudrate, self._number, data)


def amt21_answer(count: int, resolution: int) -> bytes:
    """A position as an AMT21 sends it: 14 bits, the lower ones 0 at 12 bits, and two check bits above."""
    value = count if resolution == 1 << 14 else count << 2
    bits = [value >> place & 1 for place in range(14)]
    even, odd = (1 - sum(bits[start::2]) % 2 for start in (0, 1))
    return (value | even << 14 | odd << 15).to_bytes(2, "little")


def crc8(data: bytes) -> int:
    """CRC-8 by division: the polynomial 0x107, the highest bit first."""
    remainder = int.from_bytes(data + b"\x00", "big")
    for place in range(len(data) * 8 - 1, -1, -1):
        if remainder >> (place + 8) & 1:
            remainder ^= 0x107 << place
    return remainder
