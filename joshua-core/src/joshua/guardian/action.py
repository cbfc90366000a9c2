"""Carries out a safe-stop action in a process of its own, because a device can block it."""

from __future__ import annotations

import gc
import json
import os
import select
import signal
import time
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from joshua.ipc.process_attributes import set_command_line

Action = Callable[[dict[str, Any]], dict[str, Any]]

_POLL_S = 0.02


class ActionEndedError(Exception):
    """The process of an action has ended without a report, because it was killed or has crashed."""


class ActionProcess:
    """A fork of this process, which must have no threads. It waits for a request and carries it out.

    Made in advance, it saves the time of a fork in an emergency. It ends with this process as long as it
    waits; once it acts, it completes the action even if this process is killed.

    Args:
        action: returns its report.
        foreign: descriptors of this process that the fork must not keep open.
    """

    def __init__(self, action: Action, foreign: Sequence[int] = ()) -> None:
        requests, self._requests = os.pipe()
        self._reports, reports = os.pipe()
        self._process_id = os.fork()
        if self._process_id == 0:
            for descriptor in (self._requests, self._reports, *foreign):
                os.close(descriptor)
            _serve(action, requests, reports)
        os.close(requests)
        os.close(reports)

    def await_ready(self) -> None:
        """Waits until the process waits for its request."""
        os.read(self._reports, 1)

    def run(
        self, request: dict[str, Any], limit_s: float, abort: Callable[[], bool]
    ) -> dict[str, Any] | None:
        """Carries out the request, once.

        Args:
            limit_s: time after which the action is killed.
            abort: polled; the action is killed when it returns true.

        Returns:
            The report of the action, one with ``complete`` false if it failed, or None if it was aborted.

        Raises:
            ActionEndedError: the process has ended without a report.
        """
        deadline_s = time.monotonic() + limit_s
        data = b""
        try:
            os.write(self._requests, json.dumps(request).encode() + b"\n")
            while True:
                if select.select([self._reports], [], [], _POLL_S)[0]:
                    part = os.read(self._reports, 65536)
                    if not part:
                        return dict(json.loads(data))
                    data += part
                elif time.monotonic() > deadline_s:
                    return _failed(f"the safe-stop action did not return within {limit_s:g} s")
                elif abort():
                    return None
        except (BrokenPipeError, ValueError) as error:
            raise ActionEndedError("the safe-stop action ended its process without a report") from error
        finally:
            self.close()

    def close(self) -> None:
        """Kills the process if it has not ended. Idempotent."""
        if self._process_id:
            os.close(self._requests)
            os.close(self._reports)
            os.kill(self._process_id, signal.SIGKILL)  # not reaped yet, so the process id is still valid
            os.waitpid(self._process_id, 0)
            self._process_id = 0


def _serve(action: Action, requests: int, reports: int) -> NoReturn:
    """Body of the fork."""
    try:
        gc.disable()  # a collection would copy every page that it visits
        set_command_line("joshua-guardian: safe-stop action")
        os.write(reports, b"\n")  # ready; white space before the report
        line = b""
        while not line.endswith(b"\n"):
            part = os.read(requests, 65536)
            if not part:
                return  # type: ignore[misc]  # nothing to do: the guardian has ended
            line += part
        try:
            report = dict(action(json.loads(line)))
        except Exception as error:  # noqa: BLE001 (a plugin's code; the report must be sent)
            report = _failed(f"the safe-stop action failed: {error!r}")
        data = json.dumps(report).encode()
        while data:
            data = data[os.write(reports, data) :]
    finally:
        os._exit(0)


def _failed(detail: str) -> dict[str, Any]:
    return {"complete": False, "detail": detail}
