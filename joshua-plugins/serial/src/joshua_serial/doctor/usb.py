"""Check for adapters behind many hubs."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.tools import DoctorResult, Host, Level

from joshua_serial.usb_ports import list_ports

NAME = "USB"
MOST_HUBS = 2


def check(host: Host) -> Iterator[DoctorResult]:
    """Count the hubs between the computer and each adapter."""
    for entry in list_ports(str(host.root)):
        hubs = entry.place.count(".")
        if hubs >= MOST_HUBS:
            yield DoctorResult(
                Level.NOTE,
                NAME,
                entry.path,
                f"{hubs} hubs are between the computer and this adapter (socket {entry.place})",
                "plug it in closer to the computer: each hub adds delay and may limit the power",
            )
