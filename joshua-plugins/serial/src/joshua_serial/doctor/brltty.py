"""Check whether brltty, the braille display driver, claims serial adapters."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.tools import DoctorResult, Host, Level

from joshua_serial.usb_ports import list_ports

NAME = "brltty"
# Ids that servo adapters share with braille displays: CH340, CP2102, FT232.
SHARED_IDS = ("1a86:7523", "10c4:ea60", "0403:6001")
REMEDY = (
    "run `sudo apt remove brltty`, or `sudo systemctl mask --now brltty-udev brltty`, then plug the adapter "
    "in again"
)


def check(host: Host) -> Iterator[DoctorResult]:
    """Look for adapters without a port while brltty is installed, and for those that it may claim."""
    if not _is_there(host):
        return
    with_port = {entry.place for entry in list_ports(str(host.root))}
    taken = [place for place, vid_pid in _shared_adapters(host) if place not in with_port]
    for place in taken:
        yield DoctorResult(
            Level.ERROR,
            NAME,
            f"USB device {place}",
            "is a serial adapter without a port, because brltty takes it for a braille display",
            REMEDY,
        )
    for entry in list_ports(str(host.root)):
        if entry.vid_pid in SHARED_IDS:
            yield DoctorResult(
                Level.WARNING,
                NAME,
                entry.path,
                f"brltty is installed and may claim adapters of the type {entry.vid_pid}",
                REMEDY,
            )


def _is_there(host: Host) -> bool:
    return "brltty" in host.process_names() or "brltty" in host.udev_rules()


def _shared_adapters(host: Host) -> Iterator[tuple[str, str]]:
    for folder in sorted((host.root / "sys/bus/usb/devices").glob("*")):
        place = folder.name
        vid_pid = (
            f"{host.read(f'sys/bus/usb/devices/{place}/idVendor')}:"
            f"{host.read(f'sys/bus/usb/devices/{place}/idProduct')}"
        )
        if vid_pid in SHARED_IDS:
            yield place, vid_pid
