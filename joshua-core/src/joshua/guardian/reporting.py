"""Tells a run what its guardian has done: the supervisor if it lives, else the run's log file."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import socket
import time
from typing import Any

from joshua.guardian.order import GuardianOrder

SUPERVISOR_TIMEOUT_S = 0.5


def report_to_run(order: GuardianOrder, level: int, text: str, report: dict[str, Any]) -> None:
    """Has the supervisor write the report into the log; writes it there itself where nobody answers."""
    message = {"request": "guardian", "node": order.node, "level": level, "text": text}
    if order.control_socket and _told(order.control_socket, message):
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
        with contextlib.suppress(OSError):  # a full disk must not keep the guardian from ending
            descriptor = os.open(order.log, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o644)
            try:
                os.write(descriptor, json.dumps(entry).encode() + b"\n")
            finally:
                os.close(descriptor)


def _told(path: str, message: dict[str, Any]) -> bool:
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.settimeout(SUPERVISOR_TIMEOUT_S)
            connection.connect(path)
            connection.sendall(json.dumps(message).encode() + b"\n")
            answer = json.loads(connection.recv(65536) or b"{}")
    except (OSError, ValueError):
        return False
    return bool(isinstance(answer, dict) and answer.get("written"))
