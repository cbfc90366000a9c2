"""The fork server's side of the second road: applies the safe state if driver and guardian have both ended.

A forked guardian needs no fresh interpreter: the fork server has loaded the action of the device.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import math
import os
import selectors
import signal
import socket
import time
from dataclasses import dataclass
from typing import Any, NoReturn

from joshua.guardian.order import INCOMPLETE, OVERTIME_S, GuardianOrder
from joshua.guardian.standby import MESSAGE_BYTES
from joshua.ipc.process_attributes import set_child_subreaper

#: Program of a guardian. Imported by name when the first order comes.
GUARDIAN_PROGRAM = "joshua.guardian.main"

#: Forked guardians for one order. Each replaces one that was killed.
MAX_GUARDIANS = 3

#: Time until the next attempt after the system has refused another process.
RETRY_S = 0.05

#: Interval of ``look`` while an order is to be carried out.
LOOK_S = 0.1

#: Beyond the descriptors of a fork server.
LAST_DESCRIPTOR = 1024

REASON = "the driver and its guardian ended without a safe stop"


@dataclass
class _Kept:
    """An order, and the guardian that has to carry it out.

    Attributes:
        guardian_id: of that process; 0 for none that could.
        driver_ended: whether nobody else can carry it out.
        until_s: when the guardian is killed, or another one is forked.
    """

    order: GuardianOrder
    guardian_id: int
    release_only: bool = False
    driver_ended: bool = False
    until_s: float = math.inf
    forks: int = 0


class Standby:
    """The kept orders of all drivers.

    Args:
        selector: of the server's loop; gets the sockets of the drivers, with a function as data.
    """

    def __init__(self, selector: selectors.BaseSelector) -> None:
        # Guardians whose driver has ended become children of this process, which learns how they end.
        self.available = set_child_subreaper(True)
        self._selector = selector
        self._sockets: dict[int, socket.socket] = {}
        self._kept: dict[tuple[int, str], _Kept] = {}

    @property
    def busy(self) -> bool:
        """Whether an order of an ended driver is not carried out yet."""
        return any(kept.driver_ended for kept in self._kept.values())

    def add(self, driver_id: int, sock: socket.socket) -> None:
        """Keeps the orders that a child sends over a socket, which this object owns."""
        self._sockets[driver_id] = sock
        self._selector.register(sock, selectors.EVENT_READ, lambda: self._read(driver_id))

    def ended(self, process_id: int, status: int) -> None:
        """Acts on the end of any child: a driver, a guardian of an ended driver, or another one."""
        for driver_id in tuple(self._sockets):  # a driver's last words come before its end
            self._read(driver_id)
        if process_id in self._sockets:
            self._driver_ended(process_id)
            return
        for key, kept in tuple(self._kept.items()):
            if kept.guardian_id == process_id:
                if os.waitstatus_to_exitcode(status) in (0, INCOMPLETE):
                    del self._kept[key]
                else:
                    kept.guardian_id = 0
                    self._replace(kept)

    def pause_s(self) -> float | None:
        """Time until the next ``look``, None for never."""
        return LOOK_S if self.busy else None

    def look(self) -> None:
        """Kills stopped guardians and those that do not end, and forks those that could not be forked."""
        now_s = time.monotonic()
        for kept in tuple(self._kept.values()):
            if not kept.driver_ended:
                continue
            if not kept.guardian_id:
                if now_s >= kept.until_s:
                    self._replace(kept)
            elif now_s >= kept.until_s or _is_stopped(kept.guardian_id):
                os.kill(kept.guardian_id, signal.SIGKILL)  # its end replaces it; it is not reaped yet

    def close(self) -> None:
        """Closes the sockets. Idempotent."""
        while self._sockets:
            self._sockets.popitem()[1].close()

    def _read(self, driver_id: int) -> None:
        sock = self._sockets[driver_id]
        while True:
            try:
                message = sock.recv(MESSAGE_BYTES, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            except OSError:
                message = b""
            if not message:
                with contextlib.suppress(KeyError):  # its end was read before
                    self._selector.unregister(sock)
                return
            self._obey(driver_id, json.loads(message))

    def _obey(self, driver_id: int, message: dict[str, Any]) -> None:
        if "keep" in message:
            order = GuardianOrder(**message["keep"])
            self._kept[driver_id, order.node] = _Kept(order, message["guardian_id"])
            with contextlib.suppress(Exception):  # the forked guardian, which tries again, reports the cause
                importlib.import_module(GUARDIAN_PROGRAM).load_action(order.implementation)
        elif "release_only" in message:
            if kept := self._kept.get((driver_id, message["release_only"])):
                kept.release_only = True
        else:
            self._kept.pop((driver_id, message["forget"]), None)

    def _driver_ended(self, driver_id: int) -> None:
        sock = self._sockets.pop(driver_id)
        with contextlib.suppress(KeyError):
            self._selector.unregister(sock)
        sock.close()
        for (owner_id, _), kept in tuple(self._kept.items()):
            if owner_id == driver_id:
                kept.driver_ended = True
                kept.until_s = time.monotonic() + _limit_s(kept.order)
                if not _is_child(kept.guardian_id):
                    kept.guardian_id = 0
                    self._replace(kept)
        self.look()

    def _replace(self, kept: _Kept) -> None:
        """Forks a guardian if no other process can carry the order out."""
        if not kept.driver_ended:
            return
        if kept.forks == MAX_GUARDIANS:
            # Whatever kills them would kill the next one. A restarted driver completes a release.
            self._kept = {key: other for key, other in self._kept.items() if other is not kept}
            return
        try:
            process_id = os.fork()
        except OSError:
            kept.until_s = time.monotonic() + RETRY_S
            return
        if process_id == 0:
            _become_guardian(kept)
        kept.forks += 1
        kept.guardian_id = process_id
        kept.until_s = time.monotonic() + _limit_s(kept.order)


def _limit_s(order: GuardianOrder) -> float:
    """Time for a guardian to end: one action that an e-stop ends late, and the release after it."""
    return 2 * (order.timeout_s + OVERTIME_S) + 1.0


def _is_child(process_id: int) -> bool:
    if not process_id:
        return False
    try:
        os.waitid(os.P_PID, process_id, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return False
    return True


def _is_stopped(process_id: int) -> bool:
    """Whether a child was stopped by a signal."""
    state = os.waitid(os.P_PID, process_id, os.WEXITED | os.WSTOPPED | os.WNOHANG | os.WNOWAIT)
    return state is not None and state.si_code == os.CLD_STOPPED


def _become_guardian(kept: _Kept) -> NoReturn:
    """Body of a forked guardian, which outlives the fork server as the other guardians do."""
    code = 1
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        gc.disable()  # a collection would copy every page that it visits
        os.setsid()
        null = os.open(os.devnull, os.O_RDWR)
        for target in (0, 1, 2):
            os.dup2(null, target)
        os.closerange(3, LAST_DESCRIPTOR)
        program = importlib.import_module(GUARDIAN_PROGRAM)
        code = program.take_over(kept.order, REASON, release_only=kept.release_only)
    finally:
        os._exit(code)
