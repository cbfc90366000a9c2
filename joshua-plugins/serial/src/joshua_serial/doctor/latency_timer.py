"""Check the latency timer of FTDI adapters."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from joshua.tools import DoctorResult, Host, Level

from joshua_serial.usb_ports import list_ports

NAME = "latency timer"
LONGEST_MS = 1


def check(host: Host) -> Iterator[DoctorResult]:
    """Read the latency timer of every port that has one; it delays each reply on a bus."""
    for entry in list_ports(str(host.root)):
        name = Path(entry.path).name
        file = f"sys/bus/usb-serial/devices/{name}/latency_timer"
        text = host.read(file)
        if not text.isdigit():
            continue
        if int(text) <= LONGEST_MS:
            yield DoctorResult(Level.OK, NAME, entry.path, f"{text} ms")
            continue
        yield DoctorResult(
            Level.WARNING,
            NAME,
            entry.path,
            f"the adapter holds bytes back for up to {text} ms, so a bus cycle takes at least that long",
            f"run `echo {LONGEST_MS} | sudo tee /{file}`; to make it permanent, install the rules of "
            "`joshua doctor --udev`",
        )
