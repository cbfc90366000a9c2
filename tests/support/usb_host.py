"""What a Linux host shows of USB serial adapters: real files below a folder in place of ``/``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from joshua.cli.doctor.host import Host

MakeHost = Callable[..., Host]
USER = 4711


@pytest.fixture
def make_host(tmp_path: Path) -> MakeHost:
    """Writes files below the root and makes a host for an ordinary user."""

    def make(files: dict[str, str] | None = None, *, groups: tuple[int, ...] = ()) -> Host:
        for name, text in (files or {}).items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return Host(tmp_path, USER, groups, "ada")

    return make


def plug(
    root: Path,
    name: str,
    serial: str,
    vid_pid: str = "1a86:55d3",
    *,
    place: str = "",
    driver: str = "cdc_acm",
    product: str = "USB Single Serial",
) -> str:
    """Lays out one adapter; returns its device path.

    Args:
        name: of the device, such as ``ttyACM0``; serial: "" for an adapter without a serial number.
        place: socket, such as ``1-2``.
    """
    usb = root / "sys/devices/pci0/usb1" / (place or f"1-{name}")
    interface = usb / f"{usb.name}:1.0"
    node = interface / "tty" / name
    node.mkdir(parents=True)
    (node / "device").symlink_to("../..")
    drivers = root / "sys/bus/usb/drivers" / driver
    drivers.mkdir(parents=True, exist_ok=True)
    (interface / "driver").symlink_to(drivers)
    vendor, product_id = vid_pid.split(":")
    files = {"idVendor": vendor, "idProduct": product_id, "serial": serial, "product": product}
    for file, text in files.items():
        if text:
            (usb / file).write_text(text + "\n")
    for folder in ("sys/class/tty", "sys/bus/usb/devices", "dev/serial/by-id"):
        (root / folder).mkdir(parents=True, exist_ok=True)
    (root / "sys/class/tty" / name).symlink_to(node)
    (root / "sys/bus/usb/devices" / usb.name).symlink_to(usb)
    path = root / "dev" / name
    path.touch()
    link = root / "dev/serial/by-id" / f"usb-Maker_{serial or name}-if00"
    link.unlink(missing_ok=True)  # of two adapters with one serial number the last one has it
    link.symlink_to(f"../../{name}")
    return str(path)
