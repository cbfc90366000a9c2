"""Both devices on pseudo-terminals, started by ``--emulate`` in place of the hardware.

An emulator speaks the device's own protocol, so the driver runs unchanged. It is a process of its own, which
ends when its standard input closes: with the run that started it, even if that is killed.
"""

import contextlib
import os
import pty
import select
import subprocess
import sys
import time
import tty
from typing import Any

from google.protobuf.message import Message
from joshua.api.emulation import DeviceEmulator, FaultRefusedError

SPEED_RAD_S = 2.0


class BenchEmulator(DeviceEmulator):
    """The process that emulates the device of a block."""

    _process: subprocess.Popen[str] | None = None
    _port = "emulated"

    def start(self) -> None:
        """Start the process and wait for the name of its port. Raises FaultRefusedError."""
        if self.device.faults:
            raise FaultRefusedError(f"--fault {self.device.node_name}: this emulator has no faults")
        command = [sys.executable, "-m", "acme_bench.emulator", type(self.device.block).__name__]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
        )
        assert self._process.stdout is not None
        self._port = self._process.stdout.readline().strip()

    def amend(self, block: Message) -> None:
        """Put the pseudo-terminal in place of the serial port."""
        serial: Any = block.comm.serial  # type: ignore[attr-defined]
        serial.ClearField("serial_number")
        serial.ClearField("vid_pid")
        serial.port = self._port

    @property
    def endpoint(self) -> str:
        """Path of the pseudo-terminal."""
        return self._port

    def close(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.communicate()  # closes its standard input


class RangeFirmware:
    """Sends a distance of about half a metre 50 times a second."""

    period_s = 0.02

    def tick(self, now_s: float) -> bytes:
        """Return what it sends by itself."""
        return b"R %05d\n" % (500 + int(now_s * 50) % 20)

    def answer(self, request: bytes, now_s: float) -> bytes:
        """Do nothing: it accepts no requests."""
        return b""


class ClampFirmware:
    """Moves at constant speed while it has torque."""

    period_s = 1.0

    def __init__(self) -> None:
        self._torque = False
        self._position = self._goal = 0.5
        self._moved_s = time.monotonic()

    def tick(self, now_s: float) -> bytes:
        """Return nothing: it does not stream."""
        return b""

    def answer(self, request: bytes, now_s: float) -> bytes:
        """Carry out a request and return the state."""
        step, left = SPEED_RAD_S * (now_s - self._moved_s), self._goal - self._position
        self._moved_s = now_s
        moves = self._torque and abs(left) > 1e-4
        if self._torque:
            self._position += max(-step, min(step, left))
        if request.startswith(b"T"):
            self._torque = request == b"T1"
        elif request.startswith(b"G "):
            self._goal = int(request[2:]) / 1000
        speed = SPEED_RAD_S * moves * (1 if left > 0 else -1)
        return b"%d %+06d %+06d\n" % (self._torque, round(self._position * 1000), round(speed * 1000))


def main(block: str) -> None:
    """Serve a device until the standard input closes."""
    firmware = RangeFirmware() if block == "RangeConfig" else ClampFirmware()
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    sys.stdout.write(f"{os.ttyname(theirs)}\n")
    sys.stdout.flush()
    received, due_s = b"", time.monotonic()
    while True:
        ready, _, _ = select.select([ours, sys.stdin], [], [], max(0.0, due_s - time.monotonic()))
        if sys.stdin in ready:
            return
        now_s = time.monotonic()
        reply = b""
        if ours in ready:
            *requests, received = (received + os.read(ours, 4096)).split(b"\n")
            reply = b"".join(firmware.answer(request, now_s) for request in requests)
        if now_s >= due_s:
            due_s += firmware.period_s
            reply += firmware.tick(now_s)
        with contextlib.suppress(BlockingIOError):  # nobody reads
            os.write(ours, reply)


if __name__ == "__main__":
    main(sys.argv[1])
