"""Runs a safe-stop action where it can be ended: in a process of its own."""

from __future__ import annotations

import json
import os
import select
import signal
import time
from collections.abc import Callable
from typing import Any

Action = Callable[[dict[str, Any]], dict[str, Any]]

_POLL_S = 0.02


def run_bounded(
    action: Action, request: dict[str, Any], limit_s: float, abort: Callable[[], bool]
) -> dict[str, Any] | None:
    """Runs an action in a fork of this process, which must have no threads.

    Args:
        limit_s: after this time the action is ended.
        abort: asked all the time; once it says so, the action is ended too.

    Returns:
        The report of the action, one with ``complete`` false where it failed, or None where it was aborted.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        _act(action, request, writer)
    os.close(writer)
    deadline_s = time.monotonic() + limit_s
    data = b""
    try:
        while True:
            if select.select([reader], [], [], _POLL_S)[0]:
                part = os.read(reader, 65536)
                if not part:
                    break
                data += part
            elif time.monotonic() > deadline_s:
                return _failed(f"the safe-stop action did not return within {limit_s:g} s")
            elif abort():
                return None
        return dict(json.loads(data))
    except ValueError:
        return _failed("the safe-stop action ended its process without a report")
    finally:
        os.close(reader)
        os.kill(child, signal.SIGKILL)  # not waited for yet, so the number is still its own
        os.waitpid(child, 0)


def _act(action: Action, request: dict[str, Any], writer: int) -> None:
    """What the fork does; never returns."""
    try:
        try:
            report = dict(action(request))
        except Exception as error:  # noqa: BLE001 (a plugin's code; the report must go out)
            report = _failed(f"the safe-stop action failed: {error!r}")
        data = json.dumps(report).encode()
        while data:
            data = data[os.write(writer, data) :]
    finally:
        os._exit(0)


def _failed(detail: str) -> dict[str, Any]:
    return {"complete": False, "detail": detail}
