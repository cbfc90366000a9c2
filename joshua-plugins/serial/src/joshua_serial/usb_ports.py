"""Serial ports of the host and their USB adapters; look up a port by its adapter's identity."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from joshua_serial.errors import PortNotFound


@dataclass(frozen=True)
class PortEntry:
    """One serial port.

    Attributes:
        path: device path, such as ``/dev/ttyACM0``.
        serial_number, vid_pid: of the USB adapter; "" if it has none or is not a USB device.
        by_id: path by the adapter's identity below ``/dev/serial/by-id``; "" if there is none.
        product: name that the adapter reports; driver: kernel driver, such as ``cdc_acm``.
        place: USB path, such as ``1-2.3``: bus, then the port on each hub; "" if unknown.
    """

    path: str
    serial_number: str = ""
    vid_pid: str = ""
    by_id: str = ""
    product: str = ""
    driver: str = ""
    place: str = ""

    @property
    def identity(self) -> str:
        """Permanent identity of the adapter, such as ``usb:5A46082345``; "" if it has none."""
        return f"usb:{self.serial_number}" if self.serial_number else ""

    def __str__(self) -> str:
        facts = ", ".join(
            text
            for text in (
                f"serial_number {self.serial_number}" if self.serial_number else "",
                f"vid_pid {self.vid_pid}" if self.vid_pid else "",
            )
            if text
        )
        return f"{self.path} ({facts})" if facts else self.path


@dataclass(frozen=True)
class Endpoint:
    """How the configuration names a port; an identity takes precedence over a path.

    Attributes:
        device_root: folder that contains ``dev`` and ``sys``; ``/`` for the host's own devices.
        known_as: identity of the adapter from its calibration; used to find the adapter if the path does not
            exist.
    """

    path: str = ""
    serial_number: str = ""
    vid_pid: str = ""
    device_root: str = "/"
    known_as: str = ""

    @property
    def is_lasting(self) -> bool:
        """Whether the adapter can be found after a replug: by its identity, or by a name from a udev rule."""
        return bool(self.serial_number or self.vid_pid or self.known_as) or is_lasting_name(self.path)

    def __str__(self) -> str:
        parts = [
            f"serial_number {self.serial_number}" if self.serial_number else "",
            f"vid_pid {self.vid_pid}" if self.vid_pid else "",
        ]
        return " and ".join(part for part in parts if part) or self.path


def is_lasting_name(path: str) -> bool:
    """Return whether a path is a permanent udev name, not one that depends on the plug-in order."""
    return bool(path) and not Path(path).name.startswith(("tty", "cu."))


def list_ports(device_root: str = "/") -> list[PortEntry]:
    """List the USB serial ports of the host, by path."""
    root = Path(device_root)
    classes = root / "sys/class/tty"
    if not classes.is_dir() and device_root == "/":
        return _list_by_pyserial()
    by_id = _by_id_links(root / "dev/serial/by-id")
    entries = []
    for node in sorted(classes.iterdir()) if classes.is_dir() else ():
        with contextlib.suppress(OSError):  # an adapter that is being unplugged vanishes file by file
            entry = _entry(node, root / "dev" / node.name, by_id)
            if entry is not None:
                entries.append(entry)
    return entries


def resolve(endpoint: Endpoint) -> PortEntry:
    """Find the port that an endpoint names.

    Raises:
        PortNotFound: no adapter matches, or several do. The message lists the available ports.
    """
    known = _at_path(endpoint)
    if known is not None:
        return known
    ports = list_ports(endpoint.device_root)
    if not (endpoint.serial_number or endpoint.vid_pid):
        return _by_path(endpoint, ports)
    fitting = [port for port in ports if _fits(port, endpoint)]
    if len(fitting) > 1 and endpoint.path:  # adapters that all have the same serial number from the factory
        real = Path(endpoint.path).resolve()
        fitting = [port for port in fitting if Path(port.path).resolve() == real] or fitting
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        numbers = {port.serial_number for port in fitting}
        which = "serial_number" if len(numbers) == len(fitting) else "port"
        raise PortNotFound(
            f"{endpoint}: {len(fitting)} adapters match: {_listing(fitting)}. Add {which} to the file, or "
            "unplug the others."
        )
    raise PortNotFound(
        f"{endpoint}: no adapter with this identity is plugged in. Ports here: {_listing(ports)}. Plug the "
        "device in and check its supply, or correct comm.serial; joshua find-port lists the ports."
    )


def _at_path(endpoint: Endpoint) -> PortEntry | None:
    """Return the port at the endpoint's path if it fits, without reading the others; None if it may not.

    A host has a hundred ttys, and a guardian opens its port when an arm must stop.
    """
    root = Path(endpoint.device_root)
    classes = root / "sys/class/tty"
    real = Path(endpoint.path).resolve()
    if not endpoint.path or not real.exists() or not classes.is_dir():
        return None
    by_identity = bool(endpoint.serial_number or endpoint.vid_pid)
    for name in dict.fromkeys((Path(endpoint.path).name, real.name)):
        path = root / "dev" / name
        if not (classes / name).exists() or path.resolve() != real:
            continue
        with contextlib.suppress(OSError):  # it is being unplugged
            entry = _entry(classes / name, path, _by_id_links(root / "dev/serial/by-id"))
            if not by_identity:
                return replace(entry or PortEntry(""), path=endpoint.path)
            return entry if entry is not None and _fits(entry, endpoint) else None
    # The host's own tty devices have the names of their classes, so this is none of them.
    return PortEntry(endpoint.path) if endpoint.device_root == "/" and not by_identity else None


def _by_path(endpoint: Endpoint, ports: Iterable[PortEntry]) -> PortEntry:
    real = Path(endpoint.path).resolve()
    for port in ports:
        if Path(port.path).resolve() == real:
            return replace(port, path=endpoint.path)
    if endpoint.known_as and not real.exists():
        moved = [port for port in ports if port.identity == endpoint.known_as]
        if len(moved) == 1:
            return moved[0]
    return PortEntry(endpoint.path)


def _fits(port: PortEntry, endpoint: Endpoint) -> bool:
    return (not endpoint.serial_number or port.serial_number == endpoint.serial_number) and (
        not endpoint.vid_pid or port.vid_pid.lower() == endpoint.vid_pid.lower()
    )


def _listing(ports: Iterable[PortEntry]) -> str:
    return ", ".join(str(port) for port in ports) or "none"


def describe_ports(device_root: str) -> str:
    """Name the USB serial ports of the host in one line, "none" where there are none."""
    return _listing(list_ports(device_root))


def _entry(node: Path, path: Path, by_id: Mapping[Path, str]) -> PortEntry | None:
    """Return the port of a sysfs tty; None if it is not a USB adapter."""
    usb = _usb_device(node)
    if usb is None or not path.exists():
        return None
    return PortEntry(
        str(path),
        _read(usb / "serial"),
        f"{_read(usb / 'idVendor')}:{_read(usb / 'idProduct')}",
        by_id.get(path.resolve(), ""),
        _read(usb / "product"),
        _driver(node),
        usb.name,
    )


def _usb_device(node: Path) -> Path | None:
    """Return the folder of the USB device behind a sysfs tty, None if there is none."""
    device = node / "device"
    if not device.exists():
        return None
    place = device.resolve()
    for folder in (place, *place.parents):
        if (folder / "idVendor").is_file():
            return folder
    return None


def _driver(node: Path) -> str:
    """Return the kernel driver of a tty; the tty of a USB-serial converter is a separate device."""
    device = (node / "device").resolve()
    for folder in (device, device.parent):
        if (folder / "driver").exists():
            return (folder / "driver").resolve().name
    return ""


def _by_id_links(folder: Path) -> dict[Path, str]:
    with contextlib.suppress(OSError):  # udev removes the folder with its last link
        return {link.resolve(): str(link) for link in sorted(folder.iterdir())}
    return {}


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace").strip() if path.is_file() else ""


def _list_by_pyserial() -> list[PortEntry]:
    from serial.tools import list_ports as tools

    return [
        PortEntry(
            port.device,
            port.serial_number or "",
            f"{port.vid:04x}:{port.pid:04x}",
            product=port.product or "",
            place=port.location or "",
        )
        for port in sorted(tools.comports())
        if port.vid is not None
    ]
