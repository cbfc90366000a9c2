"""The guardian process: runs beside a driver and takes over when the driver dies or hangs."""

from __future__ import annotations

import contextlib
import importlib
import json
import logging
import os
import select
import signal
import socket
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from joshua.guardian.action import Action, ActionEndedError, ActionProcess
from joshua.guardian.drop_order import DropOrder
from joshua.guardian.energised import remove_record
from joshua.guardian.latch import NO_LATCH, EstopFiles, EstopReport, Latch, LatchFolder, Subject
from joshua.guardian.order import (
    ARMED,
    BEAT,
    DONE,
    EXECUTE,
    INCOMPLETE,
    OVERTIME_S,
    PROCESS_TITLE,
    READY,
    RELEASE_ONLY,
    STOPPING,
    GuardianOrder,
)
from joshua.guardian.safe_stop import SafeStopRequest, perform
from joshua.guardian.silence import WATCHER_LOOK_S, AwakeClock, SilenceJudge, thread_time
from joshua.ipc.client import ask
from joshua.ipc.process_attributes import prefer_this_process, set_title
from joshua.ipc.run_bases import socket_address

#: Time to wait for the end of a killed process, which a device call may delay in the kernel.
END_TIMEOUT_S = 1.0

_END_POLL_S = 0.002

SUPERVISOR_TIMEOUT_S = 0.5

#: Reason of a guardian whose driver has ended by itself or was killed by somebody else.
ENDED = "the driver ended without a safe stop"

#: Signals that end other programs. The guardian ends when its work is done.
IGNORED = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGPIPE", "SIGUSR1", "SIGUSR2", "SIGTSTP", "SIGALRM")

#: Time from ARMED to the first heartbeat: torque on takes several exchanges with the device.
FIRST_BEAT_S = 2.0

#: Time for the driver to obey a latched e-stop, and again to confirm that it has.
ESTOP_PATIENCE_S = 0.3

#: Longest pause of the guardian's loop, which checks for an e-stop and for a hang.
LOOK_S = 0.06


class DriverProcess:
    """The parent process. Its process id is valid while the kernel reports it as this one's parent."""

    def __init__(self, process_id: int) -> None:
        self.process_id = process_id
        self._handle = -1
        if sys.platform == "linux":
            with contextlib.suppress(OSError):  # the kernel has no handles, or the process has ended
                self._handle = os.pidfd_open(process_id)

    @property
    def alive(self) -> bool:
        """Whether the process has not ended."""
        return os.getppid() == self.process_id

    def kill(self) -> bool:
        """Kills the process, waits for its end and returns whether it has ended."""
        deadline_s = time.monotonic() + END_TIMEOUT_S
        if self.alive:
            os.kill(self.process_id, signal.SIGKILL)
        if self.alive and self._handle >= 0:  # wakes at its end, not at the next look
            select.select([self._handle], [], [], END_TIMEOUT_S)
        while self.alive and time.monotonic() < deadline_s:
            time.sleep(_END_POLL_S)
        return not self.alive


class SafetyOrder:
    """An order that a guardian carries out and reports.

    Args:
        order: what to guard; action: brings the device into its safe state.

    Attributes:
        release_only: the safe state is torque off, whatever was ordered.
    """

    def __init__(self, order: GuardianOrder, action: Action) -> None:
        self.release_only = False
        self._order = order
        self._action = action
        self._prepared: ActionProcess | None = None
        self._latches = LatchFolder(Path(order.latch_folder)) if order.latch_folder else None
        self._subject = Subject(order.robot, order.domain_id, order.node)
        self._drop = DropOrder(order.estop_files)
        self._parks = order.request.get("action") == "PARK_THEN_RELEASE"

    def prepare(self, *foreign: int) -> None:
        """Makes a process for the action in advance, without these descriptors of this one."""
        self._prepared = ActionProcess(self._action, foreign)
        self._prepared.await_ready()

    def close(self) -> None:
        """Ends the process that was made in advance. Idempotent."""
        prepared, self._prepared = self._prepared, None
        if prepared is not None:
            prepared.close()

    def act(self, reason: str) -> dict[str, Any]:
        """Applies the safe state and returns the report."""
        began_s = time.monotonic()
        limit_s = self._order.timeout_s + OVERTIME_S
        order = self._order
        report = None
        if not self.release_only and not self._must_release():
            report = self._run(order.request, limit_s, self._must_release)
        latch = self.latch()
        if report is None or latch is not None:
            request = order.release_request or order.request
            report = self._run(request, limit_s, lambda: False) or {}
        if latch is not None:
            complete = bool(report.get("complete"))
            joints = {str(joint): str(state) for joint, state in dict(report.get("joints", {})).items()}
            detail = str(report.get("detail", ""))
            EstopFiles(order.estop_files).report(
                EstopReport(latch.identifier, order.node, "guardian", complete, complete, joints, detail)
            )
        if report.get("complete") and "held" not in dict(report.get("joints", {})).values():
            remove_record(order.energised_record)
        return {"reason": reason, "action_s": round(time.monotonic() - began_s, 4), **report}

    def _run(
        self, request: dict[str, Any], limit_s: float, abort: Callable[[], bool]
    ) -> dict[str, Any] | None:
        prepared, self._prepared = self._prepared, None
        if prepared is not None:
            with contextlib.suppress(ActionEndedError):  # it was killed while it waited, or as it began
                return prepared.run(request, limit_s, abort)
        try:
            return ActionProcess(self._action).run(request, limit_s, abort)
        except ActionEndedError as error:
            return {"complete": False, "detail": str(error)}

    def latch(self) -> Latch | None:
        """The latched e-stop, if any."""
        return None if self._latches is None else self._latches.standing(self._subject)

    def _must_release(self) -> bool:
        """Whether an e-stop is latched, or a person has ended the parking of the joints."""
        return self.latch() is not None or (self._parks and self._drop.given)

    def report(self, report: dict[str, Any]) -> None:
        """Reports to the supervisor, or into the log of the run if there is no supervisor."""
        order = self._order
        level = logging.WARNING if report.get("complete") else logging.CRITICAL
        states = ", ".join(f"{joint} {state}" for joint, state in dict(report.get("joints", {})).items())
        text = f"guardian: {report['reason']}; " + (states or "no joint confirmed its safe state")
        if report.get("detail"):
            text += f"; {report['detail']}"
        if order.control_socket:
            message = {"request": "guardian", "node": order.node, "level": level, "text": text}
            with contextlib.suppress(OSError, ValueError):
                if ask(Path(order.control_socket), message, SUPERVISOR_TIMEOUT_S).get("written"):
                    return
        if order.log:
            entry = {
                "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
                "level": logging.getLevelName(level).lower(),
                "node": order.node,
                "text": text,
                "stream": "guardian",
                "report": report,
            }
            if _append(order.log, json.dumps(entry).encode() + b"\n"):
                return
        if self.latch() is None:  # else the report of the e-stop is there, which a command waits for
            complete = bool(report.get("complete"))
            kept = EstopReport(NO_LATCH, order.node, "guardian", complete, complete, {}, text)
            EstopFiles(order.estop_files).report(kept)  # its file was made before the torque was enabled


def _append(path: str, line: bytes) -> bool:
    """Append a line to a file as a whole, and return whether that was possible."""
    try:
        with open(path, "ab", buffering=0) as file:  # noqa: PTH123
            return file.write(line) == len(line)
    except OSError:
        return False


class Guardian:
    """One guardian.

    Args:
        sock: link to the driver, which the kernel closes when the driver ends.
        order: what to guard; action: brings the device into its safe state.
    """

    def __init__(self, sock: socket.socket, order: GuardianOrder, action: Action) -> None:
        self._socket = sock
        self._order = order
        self._driver = DriverProcess(order.process_id)
        self._safety = SafetyOrder(order, action)

    def run(self) -> int:
        """Guards until there is nothing left to do and returns the exit code."""
        self._safety.prepare(self._socket.fileno())
        try:
            return self._guard()
        finally:
            self._safety.close()

    def _guard(self) -> int:
        self._socket.sendall(READY)
        reason = self._watch()
        if not reason:
            return 0
        if reason == "requested":
            report = self._safety.act(reason)
            try:
                self._socket.sendall(json.dumps(report).encode() + b"\n")
            except OSError:
                self._safety.report(report)  # the driver was killed while it waited
        else:
            if reason != ENDED:
                self._announce(reason)
            ended = self._driver.kill()
            report = self._safety.act(reason)
            if not ended:
                text = f"its driver, process {self._order.process_id}, could not be killed"
                report["detail"] = "; ".join(filter(None, (report.get("detail"), text)))
            self._safety.report(report)
        return 0 if report.get("complete") else INCOMPLETE

    def _watch(self) -> str:
        """Watches the driver and returns why the safe state is needed, "" if it is not."""
        order = self._order
        clock = AwakeClock(time.monotonic, WATCHER_LOOK_S)  # stops while the machine is suspended
        loop = partial(thread_time, order.process_id, order.thread_id)
        silence = SilenceJudge(order.hang_limit_s, clock, loop)
        armed = beating = False
        give_up_s = estop_s = float("inf")
        while True:
            pause_s = max(0.001, min(LOOK_S, silence.left_s())) if beating else LOOK_S
            ready, _, _ = select.select([self._socket], [], [], pause_s)
            now_s = clock.now_s()
            if armed and estop_s == float("inf") and self._safety.latch() is not None:
                estop_s = now_s + ESTOP_PATIENCE_S
            if ready:
                words = self._receive()
                self._safety.release_only |= RELEASE_ONLY in words
                if DONE in words:
                    return ""
                if EXECUTE in words:
                    return "requested"
                if not words:
                    return ENDED if armed else ""
                if ARMED in words:
                    armed, give_up_s = True, now_s + FIRST_BEAT_S
                if BEAT in words:
                    beating = True
                    silence.heard()
                if STOPPING in words:
                    beating, give_up_s = False, now_s + order.timeout_s
                    estop_s += ESTOP_PATIENCE_S
            if armed and now_s > estop_s:
                return "the e-stop is latched, and the driver has not taken the torque off"
            if ready:
                continue
            if beating and silence.hung():
                return f"the driver hung: no heartbeat for {order.hang_limit_s:g} s"
            if not beating and now_s > give_up_s:
                return "the driver hung while it switched torque on or off"

    def _receive(self) -> bytes:
        try:
            return self._socket.recv(65536)
        except OSError:
            return b""

    def _announce(self, reason: str) -> None:
        """Tells the supervisor why the driver is killed, without waiting for an answer."""
        message = {"request": "guardian", "node": self._order.node, "kills": reason}
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.setblocking(False)
            with socket_address(Path(self._order.control_socket)) as address:
                connection.connect(address)
            connection.send(json.dumps(message).encode() + b"\n")


def load_request(import_string: str) -> type[SafeStopRequest]:
    """Imports the request of an order. Raises ImportError, AttributeError, TypeError."""
    module, _, attribute = import_string.partition(":")
    target: Any = importlib.import_module(module)
    for name in attribute.split("."):
        target = getattr(target, name)
    if not (isinstance(target, type) and issubclass(target, SafeStopRequest)):
        raise TypeError(f"{import_string} is not a SafeStopRequest. Run joshua plugins --check")
    return target


def load_action(import_string: str) -> Action:
    """Imports the action of an order. Raises ImportError, AttributeError, TypeError."""
    return partial(perform, load_request(import_string))


def become_guardian() -> None:
    """Names this process and lets it ignore the signals that end other programs."""
    set_title(PROCESS_TITLE)
    for name in IGNORED:
        signal.signal(getattr(signal, name), signal.SIG_IGN)


def take_over(order: GuardianOrder, reason: str, *, release_only: bool) -> int:
    """Carries out the order of an ended driver whose guardian has ended, too. Returns the exit code.

    Args:
        reason: for the report; release_only: the safe state is torque off, whatever was ordered.
    """
    become_guardian()
    prefer_this_process()
    safety = SafetyOrder(order, lambda request: load_action(order.implementation)(request))
    safety.release_only = release_only
    report = safety.act(reason)
    safety.report(report)
    return 0 if report.get("complete") else INCOMPLETE


def main() -> int:
    """Runs the guardian of the driver that started this program."""
    descriptor, *sys.path[:] = sys.argv[1:]
    become_guardian()
    sock = socket.socket(fileno=int(descriptor))
    sock.set_inheritable(False)
    line = bytearray()
    while not line.endswith(b"\n"):
        part = sock.recv(1)
        if not part:
            return 0  # the driver ended before it sent its order
        line += part
    order = GuardianOrder.from_line(bytes(line))
    prefer_this_process()
    return Guardian(sock, order, load_action(order.implementation)).run()


if __name__ == "__main__":
    sys.exit(main())
