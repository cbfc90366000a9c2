"""Clauses that actuators, sensors and models share: construction, closing, and what is left afterwards."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

from joshua.devices.context import Device
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua.node.verbs import VerbDeclarationError, verbs_of
from joshua.testing import resources
from joshua.testing.conformance import ViolationError, refuses, require, require_message

D = TypeVar("D")
Close = Callable[[Any], object]

SHARED = "state is kept on the class or in the module instead of the instance"


def disconnect(device: Any) -> None:
    """Close a device."""
    device.disconnect()


@contextmanager
def made(factory: Callable[[], D], close: Close = disconnect) -> Iterator[D]:
    """Yield a device or model that is closed after the context, whatever state it is in."""
    subject = factory()
    try:
        yield subject
    finally:
        with suppress(Exception):  # the clause about closing reports it
            close(subject)


@contextmanager
def opened(factory: Callable[[], D]) -> Iterator[D]:
    """Yield a device that is open inside the context and closed afterwards."""
    with made(factory) as device:
        device.connect()  # type: ignore[attr-defined]
        yield device


def both_open(first: Any, second: Any, *, why: str, cause: str = SHARED) -> bool:
    """Open two devices of one kind, which share nothing; False if only one can be open at a time."""
    require(first is not second, "the factory made the same object twice", cause, why)
    first.connect()
    require(not second.connected, "opening one opened the other", cause, why)
    try:
        second.connect()
    except DeviceError:
        return False
    return True


def check_constructor(factory: Callable[[], D], base: type, close: Close = disconnect) -> None:
    """The constructor does no I/O and makes an object of the right class."""
    with made(factory, close) as device:
        kind = type(device)
        require(
            isinstance(device, base),
            f"the factory made {kind.__name__}",
            f"the class does not derive from {base.__module__}.{base.__name__}",
            f"the node runs a {base.__name__}",
        )
        require(
            not getattr(device, "connected", False),
            "connected is true after the constructor",
            "connected is set in __init__, or is never false",
            "a device is open only between connect and disconnect",
        )
        try:
            verbs_of((device,))
        except VerbDeclarationError as error:
            why = "callers learn the fields and the reply of a verb from its annotations"
            cause = "an annotation is missing, or names no dataclass or pydantic model"
            raise ViolationError(str(error), why, cause) from error
    with resources.opened_by_constructor(kind) as found, made(factory, close):
        pass
    what = next(filter(None, found), "")
    require(
        not what,
        f"the constructor opened {what}",
        "work that belongs into connect or load is done in __init__",
        "planning makes the object, on machines without the device",
    )


def check_connection(factory: Callable[[], Device]) -> None:
    """Connected tells the truth; a device that was closed can be opened again."""
    with made(factory) as device:
        for attempt in ("connect", "a second connect after disconnect"):
            device.connect()
            require(
                device.connected,
                f"connected is false after {attempt}",
                "connect does not record that it succeeded",
                "the node reads a device only while connected is true",
            )
            device.disconnect()
            require(
                not device.connected,
                f"connected is true after disconnect ({attempt})",
                "disconnect does not record that it closed the device",
                "the node would read a closed device",
            )


def check_idempotent_close(
    factory: Callable[[], Any], states: Mapping[str, Callable[[Any], object]], close: Close = disconnect
) -> None:
    """Closing works in every state, and twice."""
    verb = close.__name__
    for state, reach in states.items():
        with made(factory, close) as device:
            reach(device)
            for count in ("first", "second"):
                try:
                    close(device)
                except Exception as error:
                    raise ViolationError(
                        f"the {count} {verb} raised {type(error).__name__}: {error} ({state})",
                        "a run closes everything when it stops, in whatever state a fault left it",
                        f"{verb} uses something that is not open, or closes it twice",
                    ) from error


def check_nothing_left(
    factory: Callable[[], Any], use: Callable[[Any], object], close: Close = disconnect
) -> None:
    """After closing no thread and no file handle is left."""
    for _ in range(2):  # what a first use loads for good is no leak
        with made(factory, close) as subject:
            before = resources.take()
            if hasattr(subject, "connect"):
                subject.connect()
            use(subject)
    left = resources.left_since(before)
    require(
        not left,
        f"{close.__name__} left {left}",
        "a handle is not closed, or a thread is not told to stop and joined",
        "a node that restarts would run out of handles, or find its port taken",
    )


def check_unplugged(
    factory: Callable[[], D], unplug: Callable[[D], None], read: Callable[[D], object], timeout_s: float
) -> None:
    """A device that was unplugged is reported as disconnected, and can still be closed."""
    with made(factory) as device:
        before = resources.take()
        device.connect()  # type: ignore[attr-defined]
        read(device)
        unplug(device)
        end = time.monotonic() + timeout_s
        while True:
            try:
                read(device)
            except DeviceDisconnected as error:
                require_message(error, "read")
                break
            except Exception as error:
                raise ViolationError(
                    f"after unplugging, read raised {type(error).__name__}: {error}",
                    "only DeviceDisconnected tells the node that the device may come back",
                    "an error of the operating system or a library is not turned into DeviceDisconnected",
                ) from error
            require(
                time.monotonic() < end,
                f"read still returned {timeout_s:g} s after unplugging",
                "read returns the previous reading if the device does not answer",
                "the node would publish old data with a fresh stamp, or command a dead joint",
            )
            time.sleep(0.01)
        device.disconnect()  # type: ignore[attr-defined]
    left = resources.left_since(before)
    require(
        not left,
        f"after unplugging, disconnect left {left}",
        "disconnect returns early if the device does not answer",
        "each attempt to reopen the device would add to it",
    )


def check_refused_when_closed(calls: Mapping[str, Callable[[], object]], when: str) -> None:
    """Calls that need an open device are refused with a clear error."""
    why = "the message must say that the calls are in the wrong order, not that the device failed"
    for name, call in calls.items():
        verb = name.split("(")[0]
        cause = f"{name} does not begin with self.require_connected({verb!r})"
        refuses(call, DeviceError, f"{name} {when}", cause, why)
