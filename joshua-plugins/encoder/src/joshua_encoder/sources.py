"""Sources of counts: a device that streams lines, or a bus that is polled."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import NamedTuple

from joshua.api import DeviceDisconnected, DeviceError
from joshua.api.clocks import AwakeClock, StampClock, witness
from joshua.api.patience import SILENCE_LIMIT_S, Patience
from joshua_serial.errors import PortUnusable
from joshua_serial.port import SerialPort

from joshua_encoder.amt21 import ANSWER_LENGTH, position
from joshua_encoder.lines import MAGNET_FOUND, Count, LineParser
from joshua_encoder.settings import AS5600, AS5600_RESOLUTION, EncoderSettings
from joshua_encoder.trust import Trust

#: Time until the first line of a microcontroller that restarts when its port is opened.
FIRST_LINE_S = 4.0

#: Time without data after which an encoder counts as disconnected; stalls of this process do not count.
STALE_S = 1.0

#: Factor on the usual timeout on an overloaded machine.
BUSY_FACTOR = 3.0

#: Reply timeout of an AMT21; USB adapters hold bytes back for up to 16 ms.
ANSWER_S = 0.025
SEARCH_ANSWER_S = 0.005

AMT21_BAUDRATE = 2_000_000
_LARGEST_ADDRESS = 252
_SPEEDS = (115_200, 9_600, 57_600, 230_400, 1_000_000, 38_400, 19_200, 250_000, 460_800, 500_000, 921_600)
_LISTEN_S = 0.3
_SURE = 3  # consecutive valid lines that are no coincidence
_CHUNK_S = 0.002
_LARGEST_CHUNK = 64
_RETRIES = 2
_LATE_ADDRESSES = 10  # requests that may be sent before a reply arrives
_MOST_ASKS = 6  # requests to one encoder in one round while its line is not trusted
_MICROSECONDS = 1 << 32  # of a microcontroller's 32-bit clock
_NS_PER_US = 1_000


class Counts(NamedTuple):
    """Simultaneous counts of all encoders of a link.

    Attributes:
        stamp_ns: acquisition time, ns since the epoch; time_ns: the same on the best clock for intervals.
    """

    stamp_ns: int
    time_ns: int
    counts: tuple[int, ...]


class Source(ABC):
    """The encoders on an open port.

    Attributes:
        damaged: unusable lines or replies so far.
    """

    def __init__(self, port: SerialPort, settings: EncoderSettings) -> None:
        self.port, self.settings = port, settings
        self.damaged = 0
        self._clock = StampClock()
        self._awake = AwakeClock()

    @abstractmethod
    def start(self) -> None:
        """Check that the encoders reply. Raises DeviceError."""

    @abstractmethod
    def read(self, deadline_s: float) -> list[Counts]:
        """Wait for counts until a monotonic deadline. Raises DeviceDisconnected."""


class LineSource(Source):
    """A microcontroller that sends lines of text."""

    def __init__(self, port: SerialPort, settings: EncoderSettings) -> None:
        super().__init__(port, settings)
        self._parser = self._new_parser()
        self._received = 0
        self._ready: list[Counts] = []
        self._time_us: int | None = None  # of the sender's clock, extended beyond 32 bits
        self._byte_s = self._good_s = self._awake.now_s()
        self._no_magnet = False

    def start(self) -> None:
        """Wait for the first line."""
        self.port.discard_input()
        self._byte_s = self._good_s = started_s = self._awake.now_s()
        while not self._ready:
            if self._awake.now_s() - started_s > FIRST_LINE_S or self._parser.bad >= 10 * _SURE:
                raise self._explain()
            self._take(time.monotonic() + 0.05)

    def read(self, deadline_s: float) -> list[Counts]:
        """Wait for the next lines."""
        if not self._ready:
            self._take(deadline_s)
            self._check_alive()
        ready, self._ready = self._ready, []
        return ready

    def _new_parser(self) -> LineParser:
        return LineParser(AS5600_RESOLUTION - 1 if self.settings.protocol == AS5600 else None)

    def _take(self, deadline_s: float) -> None:
        port = self.port
        size = max(1, min(_LARGEST_CHUNK, round(_CHUNK_S / port.wire_time_s(1))))
        data = port.receive(size, min(deadline_s, time.monotonic() + 2 * _CHUNK_S))
        if not data:
            return
        stamp_ns = self._clock.now_ns()
        self._byte_s = self._awake.now_s()
        self._received += len(data)
        for count in self._parser.feed(data):
            behind_ns = round(port.wire_time_s(self._received - count.end) * 1e9)
            self._accept(count, stamp_ns - behind_ns)
        self.damaged = self._parser.bad

    def _accept(self, count: Count, stamp_ns: int) -> None:
        self._no_magnet = count.status is not None and not count.status & MAGNET_FOUND
        if self._no_magnet:
            return
        time_ns = stamp_ns
        if count.time_us is not None:
            step = 1 if self._time_us is None else (count.time_us - self._time_us) % _MICROSECONDS
            if step == 0:
                return  # a repeated line holds no new count
            if self._time_us is None or step > _MICROSECONDS // 2:  # its clock restarted
                self._time_us = count.time_us
            else:
                self._time_us += step
            time_ns = self._time_us * _NS_PER_US
        self._good_s = self._awake.now_s()
        self._ready.append(Counts(stamp_ns, time_ns, (count.count,)))

    def _check_alive(self) -> None:
        now_s = self._awake.now_s()
        if now_s - self._byte_s > STALE_S:
            raise DeviceDisconnected(
                f"{self.port}: the encoder has sent nothing for {STALE_S:g} s: check cable and power, and "
                "that the program on its microcontroller runs"
            )
        if now_s - self._good_s > STALE_S:
            raise DeviceDisconnected(self._stale())

    def _stale(self) -> str:
        if self._no_magnet:
            return (
                f"{self.port}: the AS5600 detects no magnet: place the magnet 0.5 to 3 mm from the centre "
                "of the chip"
            )
        if self._parser.last_bad:
            return (
                f"{self.port}: no valid line received for {STALE_S:g} s (last one: "
                f"{_text(self._parser.last_bad)}): check baudrate, cable and ground"
            )
        return (
            f"{self.port}: the encoder repeats the same time stamp: restart the program on its "
            "microcontroller"
        )

    def _explain(self) -> DeviceError:
        """Raise the error that explains why no line was received."""
        port, parser, asked = self.port, self._parser, self.port.baudrate
        if self._no_magnet:
            return DeviceError(self._stale())
        if not self._received:
            return DeviceError(
                f"{port}: the encoder sends nothing: check cable and power, that the program on its "
                "microcontroller runs, and comm.serial; joshua find-port lists the ports"
            )
        for speed in _SPEEDS:
            if speed == asked or not _runs_at(port, speed):
                continue
            port.discard_input()
            trial = self._new_parser()
            end_s = self._awake.now_s() + _LISTEN_S
            while (left_s := end_s - self._awake.now_s()) > 0 and trial.good < _SURE:
                trial.feed(port.receive(_LARGEST_CHUNK, time.monotonic() + min(left_s, 0.05)))
            if trial.good >= _SURE:
                return DeviceError(
                    f"{port}: no line is valid at {asked} bit/s, but lines are at {speed}: "
                    f"set baudrate: {speed}"
                )
        found = f", such as {_text(parser.last_bad)}" if parser.last_bad else ""
        kind = "angles from 0 to 4095" if self.settings.protocol == AS5600 else "counts"
        return DeviceError(
            f"{port}: the data are not lines of {kind}{found}: check baudrate and protocol; a line is "
            "COUNT, or COUNT,MICROSECONDS, with an optional *CRC"
        )


class Amt21Source(Source):
    """AMT21 encoders on RS-485, which reply when their address is sent."""

    def __init__(self, port: SerialPort, settings: EncoderSettings) -> None:
        super().__init__(port, settings)
        self._period_s = 1.0 / settings.rate_hz
        self._due_s = time.monotonic()
        self._echo = False
        period_s = max(self._period_s, ANSWER_S)
        self._patience = {
            address: Patience(STALE_S, period_s=period_s, clock=time.monotonic)
            for address in settings.addresses
        }
        self._trust = {address: Trust(settings.resolution) for address in settings.addresses}

    def start(self) -> None:
        """Poll each encoder."""
        addresses = self.settings.addresses
        missing = [address for address in addresses if not self._answers(address, STALE_S)]
        if missing:
            raise self._explain(missing)
        self._due_s = time.monotonic()

    def read(self, deadline_s: float) -> list[Counts]:
        """Wait for the next round, then poll each encoder."""
        now_s = time.monotonic()
        if self._due_s > deadline_s:
            time.sleep(max(0.0, deadline_s - now_s))
            return []
        time.sleep(max(0.0, self._due_s - now_s))
        self._due_s = max(self._due_s + self._period_s, time.monotonic())
        counts = []
        for address in self.settings.addresses:
            patience = self._patience[address]
            patience.begin()
            count = self._ask(address)
            if count is None:
                if not patience.miss():
                    raise self._lost(address, patience)
                return []
            patience.hear()
            counts.append(count)
        stamp_ns = self._clock.now_ns()
        return [Counts(stamp_ns, stamp_ns, tuple(counts))]

    def _lost(self, address: int, patience: Patience) -> DeviceDisconnected:
        """An error for an encoder with which the patience has ended; it is blamed only for awake time."""
        if patience.is_silent:
            return DeviceDisconnected(
                f"{self.port}: the AMT21 at address {address} has not answered for {STALE_S:g} s: check its "
                "power, both wires of the bus and its termination"
            )
        return DeviceDisconnected(
            f"{self.port}: no reply of the AMT21 at address {address} for {patience.gap_s:.1f} s, of which "
            f"this process was delayed by {patience.delayed_s:.1f} s: the machine is too busy to tell "
            "whether the encoder is at fault. Close other programs, then try again"
        )

    def _ask(self, address: int) -> int | None:
        """Poll one encoder until a reply is trusted; None if too many are missing or doubtful."""
        trust, missing = self._trust[address], 0
        trust.begin()
        for _ in range(_MOST_ASKS):
            length = ANSWER_LENGTH + self._echo
            begun_s = time.monotonic()
            self.port.send(bytes((address,)))
            answer = self.port.receive(length, time.monotonic() + ANSWER_S)
            if len(answer) < length:  # a late or missing reply; the line may be sound
                missing += 1
                if missing == _RETRIES:
                    return None
                continue
            count = position(answer[-ANSWER_LENGTH:], self.settings.resolution)
            if count is None:
                self.damaged += 1
                trust.damaged()
            else:
                now_s = time.monotonic()
                # a second request to each encoder must not reduce the rate
                hurried = 2 * (now_s - begun_s) * len(self.settings.addresses) > self._period_s
                if trust.take(count, now_s, hurried=hurried):
                    return count
        return None

    def _answers(self, address: int, limit_s: float, timeout_s: float = ANSWER_S) -> bool:
        """Return whether an encoder replies; also detects whether the adapter echoes.

        Args:
            limit_s: awake time in which it may leave requests unanswered; timeout_s: of each request.
        """
        patience = Patience(limit_s, period_s=timeout_s, clock=time.monotonic)
        while True:
            patience.begin()
            self.port.send(bytes((address,)))
            answer = self.port.receive(ANSWER_LENGTH + 1, time.monotonic() + timeout_s)
            echo = len(answer) == ANSWER_LENGTH + 1 and answer[0] == address
            if len(answer) == ANSWER_LENGTH + echo and _checked(answer[-ANSWER_LENGTH:]):
                self._echo = echo
                return True
            if answer:  # may include replies to earlier requests: wait until the line is idle
                self.port.receive(_LARGEST_CHUNK, time.monotonic() + timeout_s)
            if not patience.miss():
                return False

    def _heard(self, timeout_s: float) -> list[int]:
        """Return the addresses that may reply; a reply does not contain its address."""
        addresses = range(0, _LARGEST_ADDRESS + 1, 4)
        heard: set[int] = set()
        clock, began_s = witness(), time.monotonic()
        rounds = [*enumerate(addresses)] * 2
        for number, (place, address) in enumerate(rounds):
            if number == len(addresses) and not clock.missed_s(began_s, time.monotonic()):
                break  # the second round covers a stall of this process in the first
            for _ in range(_RETRIES):
                self.port.send(bytes((address,)))
                if self.port.receive(ANSWER_LENGTH + 1, time.monotonic() + timeout_s):
                    heard.update(addresses[max(0, place - _LATE_ADDRESSES) : place + 1])
                    break
        if self.port.receive(1, time.monotonic() + ANSWER_S):
            heard.update(addresses[-_LATE_ADDRESSES:])
        return sorted(heard)

    def _explain(self, missing: list[int]) -> DeviceError:
        port, asked = self.port, self.port.baudrate
        listed = ", ".join(f"{address} ({address:#04x})" for address in missing)
        wanted = f"no AMT21 answers at address {listed}"
        patient_s = BUSY_FACTOR * ANSWER_S
        at_times = DeviceError(
            f"{port}: the AMT21 at address {listed} answers only intermittently: check its power, both wires "
            "of the bus and its termination"
        )
        if all(
            self._answers(address, SILENCE_LIMIT_S, patient_s) for address in missing
        ):  # poll each of them again
            return at_times
        for speed in dict.fromkeys((asked, AMT21_BAUDRATE, 115_200, 9_600, 19_200, 38_400)):
            if not _runs_at(port, speed):
                continue
            heard = self._heard(SEARCH_ANSWER_S + port.wire_time_s(4))
            found = [address for address in heard if self._answers(address, SILENCE_LIMIT_S, patient_s)]
            if found and speed != asked:
                return DeviceError(
                    f"{port}: {wanted} at {asked} bit/s, but one does at {speed}: set baudrate: {speed}"
                )
            if found and set(missing) <= set(found):
                return at_times
            if found:
                there = ", ".join(str(address) for address in found)
                return DeviceError(
                    f"{port}: {wanted}; those at {there} do: correct address, or check the wires"
                )
        return DeviceError(
            f"{port}: {wanted}, nor at any other: check power, that A and B are not swapped, and that the "
            "adapter is an RS-485 adapter"
        )


def _runs_at(port: SerialPort, speed: int) -> bool:
    """Set a line speed; return whether the adapter supports it. Raises PortDisconnected."""
    try:
        port.set_baudrate(speed)
    except PortUnusable:
        return False
    return True


def _checked(answer: bytes) -> bool:
    return position(answer, 1 << 14) is not None


def _text(line: bytes) -> str:
    return repr(line.decode("ascii", errors="backslashreplace").strip())
