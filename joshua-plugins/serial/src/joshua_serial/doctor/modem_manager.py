"""Check whether ModemManager probes adapters that are not modems."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.tools import DoctorResult, Host, Level

from joshua_serial.usb_ports import list_ports

NAME = "ModemManager"


def check(host: Host) -> Iterator[DoctorResult]:
    """Look for the service, and for a rule that excludes each adapter."""
    if "ModemManager" not in host.process_names():
        return
    lines = [line for line in host.udev_rules().splitlines() if "ID_MM_DEVICE_IGNORE" in line]
    for entry in list_ports(str(host.root)):
        vendor, _, product = entry.vid_pid.partition(":")
        if any(vendor in line and (product in line or "idProduct" not in line) for line in lines):
            yield DoctorResult(Level.OK, NAME, entry.path, "ignores this adapter")
            continue
        yield DoctorResult(
            Level.WARNING,
            NAME,
            entry.path,
            "ModemManager is running and probes each new port for some seconds to find modems",
            "install the rules of `joshua doctor --udev`, or run `sudo systemctl disable --now ModemManager`",
        )
