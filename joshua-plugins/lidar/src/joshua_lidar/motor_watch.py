"""Watchdog process that stops a scanner's motor if the driver process is killed.

The program receives one line of JSON on standard input: the port of the scanner and the stop requests. If its
    input
ends after the line ``done``, the driver has stopped the motor itself; otherwise this program does.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import time
from typing import Any

from joshua.api import DeviceError
from joshua.api.clocks import AwakeClock
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint

#: How long the port of a killed driver may stay in use.
PATIENCE_S = 3.0

_RETRY_S = 0.02
_PAUSE_S = 0.002
_WAIT_S = 2.0
_DONE = "done"


class MotorWatch:
    """The driver's handle to the watchdog process.

    Args:
        path: of the port; baudrate: its line speed.
        messages: stop requests, in order.
        dtr: final state of DTR; None leaves it unchanged.
    """

    def __init__(self, path: str, baudrate: int, messages: tuple[bytes, ...], dtr: bool | None) -> None:
        order = {"path": path, "baudrate": baudrate, "messages": [m.hex() for m in messages], "dtr": dtr}
        # in a session of its own, so that Ctrl-C does not end it before the driver
        self._process = subprocess.Popen(
            [sys.executable, "-m", "joshua_lidar.motor_watch"],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self._send(json.dumps(order))

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def close(self) -> None:
        """Let the process end without stopping the motor. Idempotent."""
        if self._process.stdin is None or self._process.stdin.closed:
            return
        self._send(_DONE)
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(_WAIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _send(self, line: str) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # it has ended; continue without it
            self._process.stdin.write(line.encode() + b"\n")
            self._process.stdin.flush()


def stop_scanner(order: dict[str, Any]) -> bool:
    """Open the port and stop the scanner; False if it cannot be reached."""
    port = SerialPort(Endpoint(order["path"]), order["baudrate"])
    clock = AwakeClock()
    while True:
        try:
            port.open()
            break
        except DeviceError:
            if clock.now_s() > PATIENCE_S:
                return False
            time.sleep(_RETRY_S)
    try:
        for message in order["messages"]:
            port.send(bytes.fromhex(message))
            time.sleep(_PAUSE_S)
        if order["dtr"] is not None:
            port.set_dtr(order["dtr"])
    except DeviceError:
        return False
    finally:
        port.close()
    return True


def main() -> int:
    """Wait for the end of the driver. Exit code 1 if the scanner could not be stopped."""
    lines = sys.stdin.read().splitlines()
    if not lines or lines[-1] == _DONE:
        return 0
    return 0 if stop_scanner(json.loads(lines[0])) else 1


if __name__ == "__main__":
    sys.exit(main())
