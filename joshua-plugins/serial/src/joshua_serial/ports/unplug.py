"""``joshua find-port --unplug``: identify an adapter by unplugging it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence

from joshua_serial.usb_ports import PortEntry, list_ports

POLL_S = 0.2
TIMEOUT_S = 60.0


class NothingHappened(Exception):
    """No adapter was unplugged or plugged back in, or several were. The message gives the remedy."""


def find_by_unplugging(device_root: str, timeout_s: float = TIMEOUT_S) -> PortEntry:
    """Ask the user to unplug an adapter and plug it back in; return it under its present name.

    Raises:
        NothingHappened: nothing changed in time, or the change is ambiguous.
    """
    before = list_ports(device_root)
    if not before:
        raise NothingHappened("no USB serial adapter is plugged in: plug all of them in first")
    _say(f"unplug one adapter ({len(before)} are plugged in)")
    after = _wait(lambda ports: len(ports) < len(before), device_root, timeout_s, "no adapter was unplugged")
    gone = [port for port in before if not any(_same(port, other) for other in after)]
    if len(gone) != 1:
        listing = ", ".join(map(str, gone)) or "no known adapter"
        raise NothingHappened(f"{listing} disconnected together: unplug one adapter, not a hub")
    _say(f"it was {gone[0]}. Plug it back in")
    ports = _wait(lambda ports: len(ports) > len(after), device_root, timeout_s, "no adapter was plugged in")
    (back,) = [port for port in ports if not any(_same(port, other) for other in after)][:1]
    return back


def _wait(
    holds: Callable[[Sequence[PortEntry]], bool], device_root: str, timeout_s: float, otherwise: str
) -> list[PortEntry]:
    """Poll the ports until a condition holds, and once more after they have settled."""
    deadline_s = time.monotonic() + timeout_s
    while not holds(list_ports(device_root)):
        if time.monotonic() > deadline_s:
            raise NothingHappened(f"{otherwise} within {timeout_s:g} s")
        time.sleep(POLL_S)
    time.sleep(2 * POLL_S)
    ports = list_ports(device_root)
    if not holds(ports):
        raise NothingHappened("the connection changed again: try again")
    return ports


def _same(port: PortEntry, other: PortEntry) -> bool:
    return (port.path, port.serial_number, port.place) == (other.path, other.serial_number, other.place)


def _say(text: str) -> None:
    sys.stderr.write(text + "\n")
    sys.stderr.flush()
