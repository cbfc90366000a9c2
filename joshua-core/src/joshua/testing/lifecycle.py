"""Clauses that actuators, sensors and models share: construction, closing, and what is left afterwards."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua.node.verbs import VerbDeclarationError, verbs_of
from joshua.testing import resources
from joshua.testing.conformance import must, must_refuse, said, violation

D = TypeVar("D")
Close = Callable[[Any], object]


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


def both_open(first: Any, second: Any) -> bool:
    """Open two devices of one kind, which share nothing; False if only one can be open at a time."""
    must("factory.same", first is not second)
    first.connect()
    must("instances.opened", not second.connected)
    try:
        second.connect()
    except DeviceError:
        return False
    return True


def check_constructor(factory: Callable[[], D], base: type, close: Close = disconnect) -> None:
    """The constructor does no I/O and makes an object of the right class."""
    with made(factory, close) as device:
        kind = type(device)
        must("factory.kind", isinstance(device, base), kind.__name__, base.__name__)
        must("constructor.connected", not getattr(device, "connected", False))
        try:
            verbs_of((device,))
        except VerbDeclarationError as error:
            raise violation("constructor.verbs", error) from error
    with resources.opened_by_constructor(kind) as found, made(factory, close):
        pass
    must("constructor.opened", not any(found), "".join(found))


def check_connection(factory: Callable[[], Any]) -> None:
    """Connected tells the truth; a device that was closed can be opened again."""
    with made(factory) as device:
        for attempt in ("connect", "a second connect after disconnect"):
            device.connect()
            must("connection.false", device.connected, attempt)
            device.disconnect()
            must("connection.true", not device.connected, attempt)


def check_idempotent_close(
    factory: Callable[[], Any], states: Mapping[str, Callable[[Any], object]], close: Close = disconnect
) -> None:
    """Closing works in every state, and twice."""
    for state, reach in states.items():
        with made(factory, close) as device:
            reach(device)
            for count in ("first", "second"):
                try:
                    close(device)
                except Exception as error:
                    raise violation("close.raised", count, close.__name__, said(error), state) from error


def check_nothing_left(
    factory: Callable[[], Any], use: Callable[[Any], object], close: Close = disconnect
) -> None:
    """After closing no thread and no file handle is left."""
    for _ in range(2):  # resources loaded permanently at first use are no leak
        with made(factory, close) as subject:
            before = resources.take()
            if hasattr(subject, "connect"):
                subject.connect()
            use(subject)
    left = resources.left_since(before)
    must("left", not left, close.__name__, left)


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
                must("message.empty", bool(str(error).strip()), "read", type(error).__name__)
                break
            except Exception as error:
                raise violation("unplugged.raised", said(error)) from error
            must("unplugged.returned", time.monotonic() < end, timeout_s)
            time.sleep(0.01)
        device.disconnect()  # type: ignore[attr-defined]
    left = resources.left_since(before)
    must("unplugged.left", not left, left)


def check_refused_when_closed(calls: Mapping[str, Callable[[], object]], when: str) -> None:
    """Calls that need an open device are refused with a clear error."""
    for name, call in calls.items():
        must_refuse("order.closed", call, DeviceError, f"{name} {when}")
