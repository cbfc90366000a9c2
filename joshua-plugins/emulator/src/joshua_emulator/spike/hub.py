"""The firmware of an emulated hub without its radio: commands in, events out, one program at a time."""

from __future__ import annotations

import random
import struct
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from pathlib import Path

from joshua_emulator.event_log import EventLog
from joshua_emulator.spike.motors import MOTOR_DEVICES, EmulatedMotor
from joshua_emulator.spike.program import ProgramError, unpack, write_modules
from joshua_emulator.spike.runner import ProgramRunner

MAX_WRITE_SIZE = 155
MAX_PROGRAM_SIZE = 258_048
STDIN_SIZE = 512
STDOUT_CHUNK = 19  # bytes per notification, as sent by firmware with 20-byte characteristics
REPL = 0b001
FEATURES = 0b111  # also multi-file .mpy 6, and .mpy 6.1 with native code
BATTERY_LOW, LOW_MV = 1 << 0, 6_800
PROGRAM_RUNNING = 1 << 6
HOST_CONNECTED = 1 << 9


class Command(IntEnum):
    """Commands of the Pybricks profile."""

    STOP = 0
    START = 1
    START_REPL = 2
    WRITE_META = 3
    WRITE_RAM = 4
    REBOOT = 5
    WRITE_STDIN = 6
    WRITE_APP_DATA = 7


class Event(IntEnum):
    """Events of the Pybricks profile."""

    STATUS = 0
    STDOUT = 1


class Answer(IntEnum):
    """Results of a command, as ATT error codes."""

    OK = 0
    NOT_ALLOWED = 0x13
    INVALID = 0x80
    BUSY = 0x81


class HubFirmware:
    """One hub that is switched on.

    Args:
        motors: by port letter.
        log: of events.
    """

    def __init__(self, motors: Mapping[str, EmulatedMotor], log: EventLog) -> None:
        self.motors = motors
        self.log = log
        self.battery_mv = 8100
        self.corrupt = 0.0  # share of output events with a flipped bit
        self.random = random.Random(0)  # noqa: S311 - of faults
        self.connected = False
        self.send: Callable[[bytes], None] = lambda event: None
        self._ram = bytearray(MAX_PROGRAM_SIZE)
        self._written = bytearray(MAX_PROGRAM_SIZE)  # 1 for each byte written since the size was set to 0
        self._size = 0
        self._runner: ProgramRunner | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    @property
    def running(self) -> bool:
        """Whether a program runs."""
        return self._runner is not None

    def capabilities(self, *, old: bool = False) -> bytes:
        """Value of the capabilities characteristic; of firmware that knows no .mpy 6, where ``old``."""
        return struct.pack("<HIIB", MAX_WRITE_SIZE, REPL if old else FEATURES, MAX_PROGRAM_SIZE, 1)

    def status(self) -> bytes:
        """The status event."""
        flags = PROGRAM_RUNNING * self.running | HOST_CONNECTED * self.connected
        flags |= BATTERY_LOW * (self.battery_mv < LOW_MV)
        return struct.pack("<BIBB", Event.STATUS, flags, 0, 0)

    def command(self, data: bytes) -> Answer:
        """Execute a write to the command characteristic."""
        if not data or data[0] not in Command.__members__.values():
            return Answer.INVALID
        command, payload = Command(data[0]), data[1:]
        if command is Command.STOP:
            self.stop_program()
        elif command is Command.START:
            return self._start()
        elif command is Command.WRITE_META:
            return self._set_size(payload)
        elif command is Command.WRITE_RAM:
            return self._write_ram(payload)
        elif command is Command.WRITE_STDIN:
            return self._write_stdin(payload)
        else:
            return Answer.INVALID
        return Answer.OK

    def run(self, blob: bytes) -> None:
        """Start a program that is already on the hub."""
        self._ram[: len(blob)] = blob
        self._size = len(blob)
        self._start()

    def stop_program(self) -> None:
        """End the program, like the button of the hub."""
        if self._runner is not None:
            self._runner.close()
            self._ended(b"The program was stopped (SystemExit).\r\n")

    def close(self) -> None:
        """Switch off."""
        if self._runner is not None:
            self._runner.close()
            self._runner = None
        self._let_go()
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def _set_size(self, payload: bytes) -> Answer:
        if self.running:
            return Answer.BUSY
        if len(payload) != 4:
            return Answer.INVALID
        (self._size,) = struct.unpack("<I", payload)
        if self._size > MAX_PROGRAM_SIZE:
            self._size = 0
            return Answer.NOT_ALLOWED
        if self._size == 0:
            self._written = bytearray(MAX_PROGRAM_SIZE)
        else:
            holes = self._written.count(0, 0, self._size)
            self.log.add("upload", time.monotonic(), size=self._size, holes=holes)
        return Answer.OK

    def _write_ram(self, payload: bytes) -> Answer:
        if len(payload) < 4:
            return Answer.INVALID
        (offset,) = struct.unpack_from("<I", payload)
        data = payload[4:]
        if offset + len(data) > MAX_PROGRAM_SIZE:
            return Answer.NOT_ALLOWED
        if self.running:
            return Answer.BUSY
        self._ram[offset : offset + len(data)] = data
        self._written[offset : offset + len(data)] = b"\1" * len(data)
        return Answer.OK

    def _write_stdin(self, payload: bytes) -> Answer:
        if len(payload) > STDIN_SIZE:
            return Answer.BUSY
        if self._runner is not None:
            self._runner.write(payload)
        return Answer.OK

    def _start(self) -> Answer:
        if self.running:
            return Answer.BUSY
        if self._size == 0:
            return Answer.NOT_ALLOWED
        self._folder = tempfile.TemporaryDirectory(prefix="joshua-hub-")
        try:
            module = write_modules(unpack(bytes(self._ram[: self._size])), Path(self._folder.name))
        except ProgramError as error:
            self._ended(f"{error}\r\n".encode())
            return Answer.OK
        self._runner = ProgramRunner(
            Path(self._folder.name),
            module,
            answer=self._answer,
            on_output=lambda data: self._print(data.replace(b"\r\n", b"\n").replace(b"\n", b"\r\n")),
            on_end=self._ended,
        )
        self.log.add("program", time.monotonic(), running=True)
        self.send(self.status())
        return Answer.OK

    def _ended(self, words: bytes = b"") -> None:
        self._runner = None
        self._let_go()
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None
        if words:
            self._print(words)
        self.log.add("program", time.monotonic(), running=False)
        self.send(self.status())

    def _let_go(self) -> None:
        for motor in self.motors.values():
            motor.stop()  # the firmware stops all motors when a program ends

    def _print(self, data: bytes) -> None:
        for start in range(0, len(data), STDOUT_CHUNK):
            chunk = bytearray(data[start : start + STDOUT_CHUNK])
            if self.corrupt and self.random.random() < self.corrupt:
                chunk[self.random.randrange(len(chunk))] ^= 1 << self.random.randrange(7)
            self.send(bytes([Event.STDOUT]) + chunk)

    def _answer(self, words: Sequence[str]) -> str:
        """Answer a request of the running program."""
        verb, arguments = words[0], words[1:]
        if verb == "battery":
            return f"ok {self.battery_mv} 120"
        motor = self.motors.get(arguments[0]) if arguments else None
        if motor is None or not motor.attached:
            return "nodev"
        if verb == "device":
            return f"ok {motor.device}"
        if motor.device not in MOTOR_DEVICES:
            return "nodev"
        if verb == "state":
            return "ok {} {} {}".format(*motor.state())
        if verb == "motor":
            motor.take()
        elif verb == "hold":
            motor.hold()
        elif verb == "stop":
            motor.stop()
        elif verb == "track":
            self.log.add("track", time.monotonic(), port=arguments[0], angle_deg=int(arguments[1]))
            motor.track(int(arguments[1]))
        else:
            return "error"
        return "ok"
