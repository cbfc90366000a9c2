"""Access to private parts of the cyclonedds wheel: serialised payloads in and out, and its one lock.

The public writer takes only typed samples, whose serialiser costs 24 ms for a 640 × 480 image. The
functions here belong to the minor version of cyclonedds that this distribution pins.
"""

from __future__ import annotations

import ctypes
import threading
from typing import Any

from cyclonedds._clayer import ddspy_write
from cyclonedds.core import DDSException, Entity, GuardCondition
from cyclonedds.internal import DDS
from joshua.api.transports import TransportError

#: Hold this lock while cyclonedds converts QoS settings to Python values: when reading the discovery data of
#: an endpoint, or making a writer. All threads share its buffers, and two at once get wrong values or an
#: exception.
READING_QOS = threading.Lock()

_ALIGNMENT = 4

_assert_liveliness = DDS._dll_handle.dds_assert_liveliness
_assert_liveliness.argtypes = [ctypes.c_int32]
_assert_liveliness.restype = ctypes.c_int32


def write(writer: Entity, cdr: Any) -> bool:
    """Write a serialised sample; return False if the readers must catch up first.

    Raises:
        TransportError: the payload does not fit the type.
    """
    # the network part sends whole words, so a payload must not end within one
    gap = -len(cdr) % _ALIGNMENT
    code = ddspy_write(writer._ref, b"".join((cdr, bytes(gap))) if gap else cdr)
    if code == DDSException.DDS_RETCODE_TIMEOUT:
        return False
    if code == DDSException.DDS_RETCODE_BAD_PARAMETER:
        raise TransportError("the payload does not fit the message type of the publisher")
    if code < 0:
        raise TransportError(f"DDS refused the message: {DDSException(code)}")
    return True


def delete(entity: Entity) -> None:
    """Delete an entity now, instead of when the last reference goes. Idempotent."""
    entity.__del__()


def assert_liveliness(writer: Entity) -> None:
    """Assert the liveliness of a writer with manual liveliness.

    Raises:
        DDSException: the writer is gone.
    """
    code = _assert_liveliness(writer._ref)
    if code < 0:
        raise DDSException(code, "while asserting liveliness")


def trigger(condition: GuardCondition) -> None:
    """Wake the thread that waits on a guard condition."""
    condition.set(True)
