"""Clauses that actuators and sensors share: opening, closing, and what is left afterwards."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, Protocol, TypeVar

from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua.node.verbs import VerbDeclarationError, verbs_of
from joshua.testing import resources
from joshua.testing.conformance import ViolationError, refuses, require


class Device(Protocol):
    """What actuators and sensors have in common."""

    @property
    def connected(self) -> bool:
        """Whether the device is open."""

    def connect(self) -> None:
        """Opens the device."""

    def disconnect(self) -> None:
        """Closes the device."""


D = TypeVar("D", bound=Device)

#: Largest distance between a stamp and the clock of this machine.
STAMP_TOLERANCE_NS = 60 * 1_000_000_000


@contextmanager
def made(factory: Callable[[], D]) -> Iterator[D]:
    """A device that is closed after the context, whatever state it is in."""
    device = factory()
    try:
        yield device
    finally:
        with suppress(Exception):  # the clause about closing reports it
            device.disconnect()


@contextmanager
def opened(factory: Callable[[], D]) -> Iterator[D]:
    """A device that is open inside the context and closed afterwards."""
    with made(factory) as device:
        device.connect()
        yield device


def both_open(first: Device, second: Device, *, why: str, cause: str) -> bool:
    """Opens two devices of one kind, which share nothing; False where only one can be open at a time."""
    require(first is not second, "the factory made the same object twice", why=why, cause=cause)
    first.connect()
    require(not second.connected, "opening one opened the other", why=why, cause=cause)
    try:
        second.connect()
    except DeviceError:
        return False
    return True


def check_constructor(factory: Callable[[], Device], base: type) -> None:
    """The constructor does no I/O and makes an object of the right class."""
    before = resources.take()
    with made(factory) as device:
        opened_now = resources.take().since(before)
        require(
            isinstance(device, base),
            f"the factory made {type(device).__name__}",
            why=f"the node drives a {base.__name__}",
            cause=f"the class does not derive from {base.__module__}.{base.__name__}",
        )
        require(
            not opened_now,
            f"the constructor opened {opened_now}",
            why="a file is checked and planned with the object made, on machines without the device",
            cause="work that belongs into connect stands in __init__",
        )
        require(
            not device.connected,
            "connected is true after the constructor",
            why="the device is open only between connect and disconnect",
            cause="connected is set in __init__, or is never false",
        )
        require_verbs(device)


def require_verbs(provider: object) -> None:
    """Every verb of a device or model can be served as it is declared. Raises ViolationError."""
    try:
        verbs_of((provider,))
    except VerbDeclarationError as error:
        raise ViolationError(
            str(error),
            why="who calls a verb is told of its fields and its reply by the annotations",
            cause="an annotation is missing, or names no dataclass or pydantic model",
        ) from error


def check_connection(factory: Callable[[], Device]) -> None:
    """Connected says the truth; a device that was closed can be opened again."""
    with made(factory) as device:
        for attempt in ("connect", "a second connect after disconnect"):
            device.connect()
            require(
                device.connected,
                f"connected is false after {attempt}",
                why="the node reads a device only when it says that it is open",
                cause="connect does not note that it succeeded",
            )
            device.disconnect()
            require(
                not device.connected,
                f"connected is true after disconnect ({attempt})",
                why="the node would read a closed device",
                cause="disconnect does not note that it closed the device",
            )


def check_idempotent_close(
    factory: Callable[[], Device], states: Mapping[str, Callable[[Any], object]]
) -> None:
    """Disconnect works in every state, and twice."""
    for state, reach in states.items():
        with made(factory) as device:
            reach(device)
            for count in ("first", "second"):
                try:
                    device.disconnect()
                except Exception as error:
                    raise ViolationError(
                        f"the {count} disconnect raised {type(error).__name__}: {error} ({state})",
                        "the stop of a run closes every device, in whatever state a fault left it",
                        "disconnect uses a handle that is not open, or closes it twice",
                    ) from error


def check_nothing_left(factory: Callable[[], Device], use: Callable[[Any], None]) -> None:
    """After disconnect no thread and no file handle is left."""
    with opened(factory) as device:  # what a first use loads once and for all is not a leak
        use(device)
    before = resources.take()
    with opened(factory) as device:
        use(device)
    left = resources.left_since(before)
    require(
        not left,
        f"disconnect left {left}",
        why="a node that restarts would run out of handles, or find its port taken",
        cause="a handle is not closed, or a thread is not told to end and joined",
    )


def check_unplugged(
    factory: Callable[[], D], unplug: Callable[[D], None], read: Callable[[D], object], timeout_s: float
) -> None:
    """A device that vanished is reported as disconnected, and can still be closed."""
    before = resources.take()
    with made(factory) as device:
        device.connect()
        read(device)
        unplug(device)
        end = time.monotonic() + timeout_s
        while True:
            try:
                read(device)
            except DeviceDisconnected as error:
                require(
                    bool(str(error).strip()),
                    "read raised DeviceDisconnected without a message",
                    why="the user sees the message and nothing else",
                    cause="the error is raised without a text that names the device",
                )
                break
            except Exception as error:
                raise ViolationError(
                    f"after the unplugging read raised {type(error).__name__}: {error}",
                    "only DeviceDisconnected tells the node that the device may come back",
                    "an error of the operating system or of a library is not turned into DeviceDisconnected",
                ) from error
            require(
                time.monotonic() < end,
                f"read still returned {timeout_s:g} s after the unplugging",
                why="the node would publish old data as new, or command a dead joint",
                cause="read returns what it read last when the device does not answer",
            )
            time.sleep(0.01)
        device.disconnect()
    left = resources.left_since(before)
    require(
        not left,
        f"after the unplugging disconnect left {left}",
        why="each attempt to open the device again would add to it",
        cause="disconnect returns early when the device does not answer",
    )


def check_refused_when_closed(calls: Mapping[str, Callable[[], object]], when: str) -> None:
    """Calls that need an open device are refused with a clear error."""
    for name, call in calls.items():
        refuses(
            call,
            DeviceError,
            f"{name} {when}",
            why="a call in the wrong order is a fault of the program, not of the device, and must say so",
            cause=f"{name} does not begin with self.require_connected({name.split('(')[0]!r})",
        )


def check_stamp(stamp_ns: object, before_ns: int, after_ns: int) -> None:
    """A stamp is ns since the epoch, taken at acquisition."""
    require(
        isinstance(stamp_ns, int) and not isinstance(stamp_ns, bool),
        f"stamp_ns is {stamp_ns!r} of type {type(stamp_ns).__name__}",
        why="a float cannot hold ns since the epoch exactly",
        cause="time.time() in place of time.time_ns()",
    )
    assert isinstance(stamp_ns, int)
    close = before_ns - STAMP_TOLERANCE_NS <= stamp_ns <= after_ns + STAMP_TOLERANCE_NS
    require(
        close,
        f"stamp_ns is {stamp_ns}, while the clock shows {after_ns}",
        why="stamps are ns since the epoch, so that data of all nodes can be matched",
        cause="seconds, milliseconds or the monotonic clock in place of time.time_ns()",
    )
    require(
        stamp_ns <= after_ns + 1_000_000,
        f"stamp_ns lies {(stamp_ns - after_ns) / 1e6:.1f} ms after the return of read",
        why="an acquisition is never later than its result",
        cause="the stamp is computed ahead, or from a clock that does not run with this machine's",
    )
