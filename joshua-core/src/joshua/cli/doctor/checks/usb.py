"""What shares a USB bus: cameras that need its bandwidth, adapters behind many hubs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from joshua.cli.doctor.finding import Finding, Level
from joshua.cli.doctor.host import Host

NAME = "USB"
HIGH_SPEED_MBIT_S = 480
MOST_HUBS = 2


def check(host: Host) -> Iterator[Finding]:
    """Counts cameras on each USB 2 bus, and the hubs between the computer and each adapter."""
    cameras = defaultdict(set)
    for node in (host.root / "sys/class/video4linux").glob("*"):
        place = _usb_place(node)
        if place:
            cameras[place.partition("-")[0]].add(place)
    for bus, places in sorted(cameras.items()):
        speeds = {host.read(f"sys/bus/usb/devices/{place}/speed") for place in places}
        if len(places) > 1 and speeds & {"12", str(HIGH_SPEED_MBIT_S)}:
            yield Finding(
                Level.NOTE,
                NAME,
                f"bus {bus}",
                f"{len(places)} cameras share the {HIGH_SPEED_MBIT_S} Mbit/s of one bus; "
                "uncompressed pictures of 640x480 at 30 Hz take 150 of them each",
                'set pixel_format: "MJPG", or plug a camera into a socket of another bus (lsusb -t)',
            )
    for entry in host.ports:
        hubs = entry.place.count(".")
        if hubs >= MOST_HUBS:
            yield Finding(
                Level.NOTE,
                NAME,
                entry.path,
                f"{hubs} hubs lie between the computer and this adapter (socket {entry.place})",
                "plug it nearer to the computer: each hub adds delay and may cut the power",
            )


def _usb_place(node: Path) -> str:
    """Socket of the USB device behind a node of sysfs; "" where there is none."""
    device = (node / "device").resolve()
    for folder in (device, *device.parents):
        if (folder / "idVendor").is_file():
            return folder.name
    return ""
