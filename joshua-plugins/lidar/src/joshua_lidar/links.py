"""Start and stop of each family of scanners."""

from __future__ import annotations

import contextlib
import time
from abc import ABC, abstractmethod
from collections.abc import Callable

from joshua.api import DeviceError
from joshua_serial.port import SerialPort

from joshua_lidar import requests
from joshua_lidar.models import EXPRESS, RPLIDAR_NUMBERS, YDLIDAR_NUMBERS, Model
from joshua_lidar.parsers.ld06 import Ld06Parser
from joshua_lidar.parsers.lds01 import Lds01Parser
from joshua_lidar.parsers.rplidar_express import DenseExpressParser, LegacyExpressParser
from joshua_lidar.parsers.rplidar_standard import StandardParser
from joshua_lidar.parsers.ydlidar import LARGEST_CORRECTION_RAD, YdlidarParser
from joshua_lidar.samples import Parser
from joshua_lidar.stop_bytes import MOTOR_PWM, MOTOR_RPM, STILL_DTR, STOP_BYTES

RESET_S = 2.0
_PAUSE_S = 0.002
_ERROR = 2
_WARNING = 1
_TYPICAL_MODE = (0x7C).to_bytes(4, "little")
_STANDARD, _LEGACY, _DENSE = 0x81, 0x82, 0x85


class NoAnswerError(DeviceError):
    """No reply, or a reply from another device. The caller identifies the device."""


class Link(ABC):
    """A scanner of one family on an open port.

    Attributes:
        seam_rad: jitter of its angles.
        facts: description that the scanner reports; warnings: for the user.
    """

    seam_rad = 0.0

    def __init__(self, port: SerialPort, model: Model) -> None:
        self.port, self.model = port, model
        self.facts = ""
        self.warnings: list[str] = []

    @abstractmethod
    def start(self, scan_mode: str) -> tuple[Parser, bytes]:
        """Start motor and measurements; return the parser and the bytes received so far.

        Raises DeviceError.
        """

    def stop(self) -> None:
        """Stop measurements and motor if the scanner supports it. Never raises."""
        with contextlib.suppress(DeviceError, OSError):
            for message in STOP_BYTES[self.model.name]:
                self.port.send(message)
                time.sleep(_PAUSE_S)
            self._set_dtr(running=False)

    def _set_dtr(self, *, running: bool) -> None:
        """Switch the motor of a scanner whose adapter uses DTR as the switch.

        If low DTR means off, the system lowers it even when the process is killed.
        """
        still = STILL_DTR.get(self.model.name)
        if still is not None:
            self.port.set_dtr(still != running, drop_on_close=not still)


class OneWayLink(Link):
    """LD06, LD19 and YDLIDAR X2, which stream while powered; the X2 while DTR is high."""

    def __init__(self, port: SerialPort, model: Model) -> None:
        super().__init__(port, model)
        if model.name == "ydlidar_x2":
            self.seam_rad = LARGEST_CORRECTION_RAD

    def start(self, scan_mode: str) -> tuple[Parser, bytes]:
        """Drop waiting bytes; the motor is already running."""
        self.port.discard_input()
        if self.model.name == "ydlidar_x2":
            self._set_dtr(running=True)
            return YdlidarParser(), b""
        return Ld06Parser(), b""


class Lds01Link(Link):
    """LDS-01: one letter starts it, another stops it."""

    def start(self, scan_mode: str) -> tuple[Parser, bytes]:
        """Start motor and measurements."""
        self.port.send(b"b")
        return Lds01Parser(), b""


class YdlidarLink(Link):
    """YDLIDAR X4."""

    seam_rad = LARGEST_CORRECTION_RAD

    def start(self, scan_mode: str) -> tuple[Parser, bytes]:
        """Query the identity, then start motor and measurements."""
        port = self.port
        requests.quieten(port)
        info = requests.ask(
            port,
            requests.request(requests.YDLIDAR_INFO),
            requests.INFO_ANSWER,
            attempts=requests.ATTEMPTS,
        )
        if info is None or YDLIDAR_NUMBERS.get(info.data[0]) != self.model.name:
            raise NoAnswerError(f"{port}: no {self.model.title} answers")
        self.facts = _facts(self.model, info.data)
        self._set_dtr(running=True)
        port.send(requests.request(requests.YDLIDAR_SCAN))
        answer = requests.await_answer(port, (_STANDARD,), many=True)
        if answer is None:
            raise NoAnswerError(f"{port}: the {self.model.title} does not start to measure")
        return YdlidarParser(), answer.rest


class RplidarLink(Link):
    """RPLIDAR A1 and C1."""

    seam_rad = 0.05

    def start(self, scan_mode: str) -> tuple[Parser, bytes]:
        """Query identity and health, then start motor and measurements."""
        port = self.port
        requests.quieten(port)
        info = requests.ask(
            port, requests.request(requests.GET_INFO), requests.INFO_ANSWER, attempts=requests.ATTEMPTS
        )
        if info is None or RPLIDAR_NUMBERS.get(info.data[0], self.model.name) != self.model.name:
            raise NoAnswerError(f"{port}: no {self.model.title} answers")
        self.facts = _facts(self.model, info.data)
        self._check_health()
        self._start_motor()
        if scan_mode == EXPRESS:
            payload = bytes((self._express_mode(), 0, 0, 0, 0))
            port.send(requests.request(requests.EXPRESS_SCAN, payload))
        else:
            port.send(requests.request(requests.SCAN))
        answer = requests.await_answer(port, tuple(_PARSERS), timeout_s=1.0, many=True)
        if answer is None:
            raise DeviceError(
                f"{port}: the {self.facts} does not start its {scan_mode} scan: "
                + (
                    'firmware before 1.17 needs scan_mode: "standard"'
                    if scan_mode == EXPRESS
                    else f"check its power ({self.model.power})"
                )
            )
        return _PARSERS[answer.kind](), answer.rest

    def _start_motor(self) -> None:
        if self.model.name == "rplidar_c1":
            self.port.send(requests.request(requests.SET_RPM, MOTOR_RPM.to_bytes(2, "little")))
            return
        self._set_dtr(running=True)
        self.port.send(requests.request(requests.SET_PWM, MOTOR_PWM.to_bytes(2, "little")))

    def _express_mode(self) -> int:
        """Return the mode number of the express scan; 0 for the A1, which older firmware accepts too."""
        if self.model.name != "rplidar_c1":
            return 0
        answer = requests.ask(
            self.port, requests.request(requests.GET_CONF, _TYPICAL_MODE), requests.CONF_ANSWER
        )
        return answer.data[4] if answer is not None and len(answer.data) > 4 else 1

    def _check_health(self) -> None:
        status, code = self._health()
        if status == _ERROR:  # a reset clears a protection stop whose cause is gone
            self.port.send(requests.request(requests.RESET))
            time.sleep(RESET_S)
            self.port.discard_input()
            status, code = self._health()
        if status == _ERROR:
            raise DeviceError(
                f"{self.port}: the {self.model.title} stopped with error {code:#06x}: free its "
                f"rotor, disconnect and reconnect its power; it needs {self.model.power}"
            )
        if status == _WARNING:
            self.warnings.append(
                f"{self.port}: the {self.model.title} warns of an imminent failure (code {code:#06x}): "
                "clean its window and check its power"
            )

    def _health(self) -> tuple[int, int]:
        answer = requests.ask(
            self.port,
            requests.request(requests.GET_HEALTH),
            requests.HEALTH_ANSWER,
            attempts=requests.ATTEMPTS,
        )
        if answer is None:
            raise NoAnswerError(f"{self.port}: the {self.model.title} does not report its health")
        return answer.data[0], answer.data[1] | answer.data[2] << 8


_PARSERS: dict[int, Callable[[], Parser]] = {
    _STANDARD: StandardParser,
    _LEGACY: LegacyExpressParser,
    _DENSE: DenseExpressParser,
}

LINKS: dict[str, type[Link]] = {
    "rplidar": RplidarLink,
    "ydlidar": YdlidarLink,
    "lds01": Lds01Link,
    "none": OneWayLink,
}


def _facts(model: Model, info: bytes) -> str:
    return f"{model.title}, firmware {info[2]}.{info[1]}, serial number {info[4:20].hex().upper()}"
