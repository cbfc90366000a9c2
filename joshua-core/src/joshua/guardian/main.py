"""The guardian process: waits beside a driver, and takes over when the driver dies or hangs."""

from __future__ import annotations

import argparse
import importlib
import json
import logging
import os
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from joshua.guardian.driver_process import DriverProcess
from joshua.guardian.order import ARMED, BEAT, DONE, EXECUTE, READY, STOPPING, GuardianOrder
from joshua.guardian.reporting import report_to_run
from joshua.guardian.silence import SilenceWatch

Action = Callable[[dict[str, Any]], dict[str, Any]]

#: Signals that end other programs; the guardian ends when its work is done.
IGNORED = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGPIPE", "SIGUSR1", "SIGUSR2", "SIGTSTP", "SIGALRM")

#: Energising takes several exchanges with the device before the first beat.
FIRST_BEAT_S = 2.0

#: An action that has not returned by then is given up.
OVERTIME_S = 1.5


class Guardian:
    """One guardian.

    Args:
        sock: link to the driver; its end is the driver's end.
        order: what to guard; action: brings the device into its safe state.
    """

    def __init__(self, sock: socket.socket, order: GuardianOrder, action: Action) -> None:
        self._socket = sock
        self._order = order
        self._action = action
        self._driver = DriverProcess(order.process_id, order.thread_id)

    def run(self) -> int:
        """Guards until there is nothing left to do; returns the exit code."""
        self._socket.sendall(READY)
        reason = self._watch()
        if not reason:
            return 0
        if reason == "requested":
            report = self._act(reason)
            try:
                self._socket.sendall(json.dumps(report).encode() + b"\n")
            except OSError:
                self._report(report)  # the driver was not allowed to wait for it
        else:
            ended = self._driver.kill()
            report = self._act(reason)
            if not ended:
                text = f"its driver, process {self._order.process_id}, could not be killed"
                report["detail"] = "; ".join(filter(None, (report.get("detail"), text)))
            self._report(report)
        return 0 if report.get("complete") else 1

    def _watch(self) -> str:
        """Listens; returns why the safe state is called for, "" where it is not."""
        silence = SilenceWatch(self._driver, self._order.hang_limit_s)
        armed = beating = False
        give_up_s = float("inf")
        while True:
            ready, _, _ = select.select([self._socket], [], [], silence.patience_s() if beating else 0.1)
            now_s = time.monotonic()
            if ready:
                words = self._receive()
                if DONE in words:
                    return ""
                if EXECUTE in words:
                    return "requested"
                if not words:
                    return "the driver ended without letting go" if armed else ""
                if ARMED in words:
                    armed, give_up_s = True, now_s + FIRST_BEAT_S
                if BEAT in words:
                    beating = True
                    silence.heard(now_s)
                if STOPPING in words:
                    beating, give_up_s = False, now_s + self._order.timeout_s
            elif beating and silence.hung(now_s):
                return f"the driver hung: no sign of life for {self._order.hang_limit_s:g} s"
            elif not beating and now_s > give_up_s:
                return "the driver hung while it switched the device on or off"

    def _receive(self) -> bytes:
        try:
            return self._socket.recv(65536)
        except OSError:
            return b""

    def _act(self, reason: str) -> dict[str, Any]:
        began_s = time.monotonic()
        self._bound(reason)
        try:
            report = dict(self._action(self._order.request))
        except Exception as error:  # noqa: BLE001 (a plugin's code; the report must go out)
            report = {"complete": False, "detail": f"the safe-stop action failed: {error!r}"}
        return {"reason": reason, "action_s": round(time.monotonic() - began_s, 4), **report}

    def _bound(self, reason: str) -> None:
        """Ends this process when the action takes far longer than it may."""
        limit_s = self._order.timeout_s + OVERTIME_S

        def give_up() -> None:
            detail = f"the safe-stop action did not return within {limit_s:g} s"
            self._report({"reason": reason, "complete": False, "detail": detail})
            os._exit(1)

        timer = threading.Timer(limit_s, give_up)
        timer.daemon = True
        timer.start()

    def _report(self, report: dict[str, Any]) -> None:
        level = logging.WARNING if report.get("complete") else logging.CRITICAL
        states = ", ".join(f"{joint} {state}" for joint, state in dict(report.get("joints", {})).items())
        text = f"guardian: {report['reason']}; " + (states or "no joint has confirmed its safe state")
        if report.get("detail"):
            text += f"; {report['detail']}"
        report_to_run(self._order, level, text, report)


def load_action(import_string: str) -> Action:
    """Imports what an order names. Raises ImportError, AttributeError."""
    module, _, attribute = import_string.partition(":")
    target: Any = importlib.import_module(module)
    for name in attribute.split("."):
        target = getattr(target, name)
    action: Action = target
    return action


def main() -> int:
    """Runs the guardian of one driver, which starts this program itself."""
    parser = argparse.ArgumentParser(description="Started by a driver; of no use by hand.")
    parser.add_argument("--descriptor", type=int, required=True, help="inherited socket of the driver")
    parser.add_argument("--path", action="append", default=[], help="entry of the module search path")
    arguments = parser.parse_args()
    for name in IGNORED:
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    sys.path[:] = arguments.path or sys.path
    sock = socket.socket(fileno=arguments.descriptor)
    os.set_inheritable(arguments.descriptor, False)
    line = bytearray()
    while not line.endswith(b"\n"):
        part = sock.recv(1)
        if not part:
            return 0  # the driver ended before it had said anything
        line += part
    order = GuardianOrder.from_line(bytes(line))
    return Guardian(sock, order, load_action(order.implementation)).run()


if __name__ == "__main__":
    sys.exit(main())
