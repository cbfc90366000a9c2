"""Refuses what would hang: opening a Zenoh session in a fork of a process that had one open."""

from __future__ import annotations

import os
import threading

from joshua.transport.errors import TransportError

_lock = threading.Lock()
_open_here = 0
_inherited = False


def session_opened() -> None:
    """Counts a session that is about to be opened.

    Raises:
        TransportError: this process was forked from one that had a session open.
    """
    global _open_here
    if _inherited:
        raise TransportError(
            "this process was forked from one with an open Zenoh session, in which the middleware hangs; "
            "fork first and open the transport afterwards, or start the process anew (spawn)"
        )
    with _lock:
        _open_here += 1


def session_closed() -> None:
    """Counts a session that was closed."""
    global _open_here
    with _lock:
        _open_here -= 1


def _after_fork() -> None:
    global _inherited, _open_here, _lock
    _lock = threading.Lock()
    _inherited = _inherited or _open_here > 0
    _open_here = 0


os.register_at_fork(after_in_child=_after_fork)
