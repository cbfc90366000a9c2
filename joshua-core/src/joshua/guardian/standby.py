"""The driver's side of the second road to the safe state.

The fork server, parent of the driver, keeps the orders of the driver's guardians. It applies the safe state
if a driver and its guardian have both ended without doing so, for example because both were killed.
"""

from __future__ import annotations

import contextlib
import json
import socket
from typing import Any

from joshua.guardian.order import GuardianOrder

#: Largest message. Each is sent whole or not at all.
MESSAGE_BYTES = 1 << 20

_adopted: list[socket.socket] = []


def adopt(descriptor: int) -> None:
    """Sends the orders of this process over an inherited socket from here on."""
    _adopted[:] = [socket.socket(fileno=descriptor)]


def keep(order: GuardianOrder, guardian_id: int) -> None:
    """Lets the fork server keep an order of this process, if a fork server started it.

    Args:
        guardian_id: process id of the guardian that has the same order.

    Raises:
        OSError: the fork server has ended.
    """
    _send({"keep": order.to_values(), "guardian_id": guardian_id})


def release_only(node: str) -> None:
    """Makes torque off the safe state of a kept order."""
    with contextlib.suppress(OSError):  # the fork server has ended, and the kernel ends this process with it
        _send({"release_only": node})


def forget(node: str) -> None:
    """Withdraws the order of a node, because it is in its safe state. Idempotent."""
    with contextlib.suppress(OSError):
        _send({"forget": node})


def _send(message: dict[str, Any]) -> None:
    for sock in _adopted:
        sock.send(json.dumps(message).encode(), socket.MSG_DONTWAIT)
