"""Whose handles and threads are whose: those of the driver, of the test's factory, of a dead driver."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from broken_actuators import settings
from joshua.guardian.safe_stop import SafeStopRequest, SafeStopResult
from joshua.testing import check_actuator
from joshua_mock.actuator import MockActuator


def test_what_the_factory_opens_is_not_held_against_the_driver() -> None:
    emulators: list[tuple[socket.socket, socket.socket]] = []
    ends = threading.Event()
    try:

        def factory() -> MockActuator:
            emulators.append(socket.socketpair())
            threading.Thread(target=ends.wait, name="emulator", daemon=True).start()
            return MockActuator(settings())

        check_actuator(factory, only=("constructor", "close", "nothing left"))
    finally:
        ends.set()
        for pair in emulators:
            for end in pair:
                end.close()


class BatteryArm(MockActuator):
    """Its torque lives in a far end, as in a servo; only the far end's own link can switch it off."""

    torque = False
    link: socket.socket | None = None

    def connect(self) -> None:
        super().connect()
        self.link = socket.create_connection(("127.0.0.1", far_end.port))

    def _tell(self, word: bytes) -> None:
        if self.link is not None:
            self.link.sendall(word)
            assert self.link.recv(1)

    def enable(self) -> None:
        super().enable()
        self._tell(b"1")

    def release(self) -> None:
        super().release()
        self._tell(b"0")

    def safe_stop_request(self, action: str, **values: Any) -> LinkStop:
        return LinkStop(action, port=far_end.port)

    def disconnect(self) -> None:
        try:
            self.release()
        finally:
            if self.link is not None:
                self.link.close()
                self.link = None
            super().disconnect()


@dataclass(frozen=True)
class LinkStop(SafeStopRequest):
    port: int = 0

    def run(self) -> SafeStopResult:
        with socket.create_connection(("127.0.0.1", self.port), timeout=1) as link:
            link.sendall(b"0" if self.action == "RELEASE" else b"?")
            had = link.recv(1) == b"1"
        state: Any = "was off" if not had else "held" if self.action == "HOLD" else "released"
        return SafeStopResult(dict.fromkeys(("joint_1", "joint_2"), state), self.action)


class FarEnd:
    """A device that takes one link at a time, like a serial port."""

    def __enter__(self) -> FarEnd:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self._torque = b"0"
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        return self

    def _serve(self) -> None:
        while True:
            try:
                link, _ = self._server.accept()
            except OSError:
                return
            with link, suppress(OSError):
                while word := link.recv(1):
                    link.sendall(self._torque)
                    self._torque = self._torque if word == b"?" else word

    def __exit__(self, *reason: object) -> None:
        self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self._thread.join()


far_end = FarEnd()


def test_the_safe_stop_runs_on_a_device_whose_driver_has_died_with_torque_on() -> None:
    with far_end:
        check_actuator(lambda: BatteryArm(settings()), only=("safe stop",))
