"""An emulated scanner: its stream and its replies to requests."""

from __future__ import annotations

import random
import time
from collections.abc import Callable

from joshua_emulator.event_log import EventLog
from joshua_emulator.lidar import requests
from joshua_emulator.lidar.line_faults import LineFaults
from joshua_emulator.lidar.models import ScannerModel
from joshua_emulator.lidar.packets import rplidar_descriptor
from joshua_emulator.lidar.requests import Request, RequestReader
from joshua_emulator.lidar.streams import (
    DenseExpressStream,
    Ld06Stream,
    Lds01Stream,
    LegacyExpressStream,
    StandardStream,
    Stream,
    YdlidarStream,
)
from joshua_emulator.wire import BITS_PER_BYTE, TimedReply


class Scanner:
    """One scanner at the end of a line.

    Attributes:
        baudrate: line speed; a host at another speed receives noise.
        silent: sends nothing although it turns.
        health: of an RPLIDAR: 0 good, 1 warning, 2 error; old_firmware: it knows no express scan.
        motor: whether the motor is on.
    """

    def __init__(self, model: ScannerModel, log: EventLog, faults: LineFaults) -> None:
        self.model, self.log, self.faults = model, log, faults
        self.baudrate = model.baudrate
        self.silent = False
        self.health = 0
        self.old_firmware = False
        self.motor = False
        self.turn_hz = model.turn_hz
        self.packets = 0
        self._noise = random.Random(4)  # noqa: S311 - reproducible noise, no secrets
        self._stream: Stream | None = None
        self._reader = RequestReader(payloads=model.protocol == "rplidar")
        self._number = 0
        if not model.waits:
            self._start(self._usual_stream(), time.monotonic())

    @property
    def scanning(self) -> bool:
        """Whether it is sending measurements."""
        return self._stream is not None

    def set_turn_hz(self, turn_hz: float) -> None:
        """Turn faster or slower; 0 holds the motor fast."""
        self.turn_hz = turn_hz
        if self._stream is not None:
            self._stream.turn_hz = turn_hz

    def reset_line(self) -> None:
        """Restart after a replug, which cuts the power."""
        self._reader.clear()
        if self.model.waits:
            self._stop()
            self._set_motor(False)

    def produce(self, now_s: float, line_speed: int) -> list[TimedReply]:
        """What the scanner has measured up to a time, as bytes on the line."""
        if self._stream is None:
            return []
        sent = []
        for end_s, packet in self._stream.until(now_s):
            if not packet or self.silent or self.faults.drops():
                continue
            self.packets += 1
            sent.append(self._reply(end_s, self.faults.disturb(packet), line_speed))
        return sent

    def receive(self, data: bytes, line_speed: int, now_s: float) -> list[TimedReply]:
        """Process bytes from the host."""
        if line_speed != self.baudrate:
            return []
        if self.model.protocol == "lds01":
            return self._receive_letters(data, now_s)
        if not self.model.waits:
            return []  # its line is one-way
        answers = []
        for request in self._reader.take(data):
            self.log.add("request", now_s, command=request.command, payload=request.payload.hex())
            answer = (
                self._rplidar(request, now_s)
                if self.model.protocol == "rplidar"
                else self._ydlidar(request, now_s)
            )
            if answer:
                answers.append(self._reply(now_s + 0.001, answer, line_speed))
        return answers

    def _rplidar(self, request: Request, now_s: float) -> bytes:
        model, command = self.model, request.command
        if command == requests.STOP or command == requests.RESET:
            self._stop()
            if command == requests.RESET:
                self.health = 0
            return b""
        if command in (requests.SET_PWM, requests.SET_RPM):
            self._set_motor(int.from_bytes(request.payload, "little") > 0)
            if not self.motor:
                self._stop()
            return b""
        starts: dict[int, Callable[[], tuple[Stream, int, int]]] = {
            requests.SCAN: lambda: (self._usual_stream(), 5, requests.STANDARD_ANSWER),
            requests.FORCE_SCAN: lambda: (self._usual_stream(), 5, requests.STANDARD_ANSWER),
            requests.EXPRESS_SCAN: lambda: (self._express_stream(), 84, requests.express_answer(model)),
        }
        if command == requests.EXPRESS_SCAN and self.old_firmware:
            return b""
        if command in starts:
            if self.health == 2 and command != requests.FORCE_SCAN:
                return b""
            stream, length, kind = starts[command]()
            self._start(stream, now_s)
            return rplidar_descriptor(length, kind, many=True)
        if self.scanning:
            return b""  # a scanner that sends measurements answers nothing else
        answers: dict[int, Callable[[], bytes]] = {
            requests.GET_INFO: lambda: requests.rplidar_info(model),
            requests.GET_HEALTH: lambda: requests.rplidar_health(self.health),
            requests.GET_SAMPLERATE: lambda: requests.rplidar_samplerate(model),
            requests.GET_CONF: lambda: requests.rplidar_conf(model, request.payload),
            requests.GET_BOARD: requests.rplidar_board,
        }
        return answers[command]() if command in answers else b""

    def _ydlidar(self, request: Request, now_s: float) -> bytes:
        if request.command == requests.YD_SCAN:
            self._start(self._usual_stream(), now_s)
            return rplidar_descriptor(5, requests.STANDARD_ANSWER, many=True)
        if request.command in (requests.YD_STOP, requests.YD_RESET):
            self._stop()
            self._set_motor(False)
            return b""
        if self.scanning:
            return b""
        if request.command == requests.YD_INFO:
            return requests.rplidar_info(self.model)
        if request.command == requests.YD_HEALTH:
            return requests.rplidar_health(self.health)
        return b""

    def _receive_letters(self, data: bytes, now_s: float) -> list[TimedReply]:
        for letter in data:
            if letter == ord("b") and not self.scanning:
                self._start(self._usual_stream(), now_s)
            elif letter == ord("e"):
                self._stop()
                self._set_motor(False)
        return []

    def _usual_stream(self) -> Stream:
        kinds: dict[str, Callable[..., Stream]] = {
            "ld06": Ld06Stream,
            "lds01": Lds01Stream,
            "ydlidar": YdlidarStream,
            "rplidar": StandardStream,
        }
        return kinds[self.model.protocol](self.model, self.model.sample_hz, time.monotonic(), 57.0)

    def _express_stream(self) -> Stream:
        dense = requests.express_answer(self.model) == requests.DENSE_ANSWER
        kind: Callable[..., Stream] = DenseExpressStream if dense else LegacyExpressStream
        return kind(self.model, self.model.express_hz, time.monotonic(), 57.0)

    def _start(self, stream: Stream, now_s: float) -> None:
        stream.now_s, stream.turn_hz = now_s, self.turn_hz
        self._stream = stream
        self._set_motor(True)

    def _stop(self) -> None:
        self._stream = None

    def _set_motor(self, on: bool) -> None:
        if on != self.motor:
            self.motor = on
            self.log.add("motor", time.monotonic(), on=on)

    def _reply(self, measured_s: float, data: bytes, line_speed: int) -> TimedReply:
        self._number += 1
        if line_speed != self.baudrate:
            data = self._noise.randbytes(max(1, len(data) * line_speed // self.baudrate))
        due_s = measured_s + len(data) * BITS_PER_BYTE / self.baudrate
        return TimedReply(due_s, self._number, data)
