"""ROS 2 topics behind one interface. Zenoh is part of the core; Plugins provide other transports."""

from __future__ import annotations

import contextlib
import ctypes
import os
from functools import lru_cache
from typing import Protocol

from joshua.plan import TransportSettings
from joshua.plugins.targets import load_target
from joshua.transport.transports import (
    EndpointInfo,
    NodeHandle,
    NodeInfo,
    Publisher,
    Sample,
    ServiceInfo,
    Subscription,
    Transport,
    TransportError,
)

__all__ = [
    "EndpointInfo",
    "Host",
    "NodeHandle",
    "NodeInfo",
    "Publisher",
    "Sample",
    "ServiceInfo",
    "Subscription",
    "Transport",
    "TransportError",
    "TransportSettings",
    "open_transport",
    "prepare_transport",
]

# parameters of mallopt(3)
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_KEPT_B = 64 * 2**20
_LARGEST_BLOCK_B = 32 * 2**20  # the maximum of glibc


class Host(Protocol):
    """An object that a run hosts for its nodes, such as the Zenoh router."""

    @property
    def description(self) -> str:
        """The hosted object and its address, for the start-up table."""
        raise NotImplementedError

    def close(self) -> None:
        """Stop hosting. Idempotent."""
        raise NotImplementedError


def open_transport(settings: TransportSettings) -> Transport:
    """Connect this process to the ROS 2 graph.

    Open it once in a process and never before a fork: a child that inherits an open Zenoh session hangs when
    it opens another one. Afterwards, type hashes and message classes are those of ``settings.distro``.

    Raises:
        TransportError: the middleware refuses the settings.
        TargetError: the plugin of the transport cannot be imported.
    """
    from joshua.messages import select_distro

    select_distro(settings.distro)
    keep_freed_memory()
    transport: Transport = load_target(settings.implementation)(settings)
    return transport


def prepare_transport(settings: TransportSettings) -> Host | None:
    """Check that a transport can be used on this machine, and host what its nodes need.

    Returns:
        The object to close at the end of the run; None if nothing is hosted.

    Raises:
        TransportError: the settings cannot be used on this machine.
        TargetError: the plugin of the transport cannot be imported.
    """
    host: Host | None = load_target(settings.prepare)(settings) if settings.prepare else None
    return host


@lru_cache(maxsize=1)
def keep_freed_memory() -> bool:
    """Tell the C library to keep up to 64 MiB of freed memory; return whether it can (glibc only).

    A 640 × 480 image has 225 pages. Without this the C library returns them to the system when the image is
    freed, and the next image faults them in again: half of its latency and of its processor time.
    """
    with contextlib.suppress(ValueError, OSError, AttributeError):
        if "glibc" in (os.confstr("CS_GNU_LIBC_VERSION") or ""):
            set_option = ctypes.CDLL(None).mallopt
            done = set_option(_M_MMAP_THRESHOLD, _LARGEST_BLOCK_B) and set_option(_M_TRIM_THRESHOLD, _KEPT_B)
            return bool(done)
    return False
