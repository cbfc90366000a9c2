"""Check whether this user may open the serial ports."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.tools import DoctorResult, Host, Level, may_open

from joshua_serial.usb_ports import list_ports


def check(host: Host) -> Iterator[DoctorResult]:
    """Compare owner, group and mode of each port with the user's session."""
    ports = list_ports(str(host.root))
    if not ports:
        yield DoctorResult(Level.NOTE, "permissions", "USB serial ports", "none found", "plug an adapter in")
    for entry in ports:
        yield may_open(host, entry.path)
