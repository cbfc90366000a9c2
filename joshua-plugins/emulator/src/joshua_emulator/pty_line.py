"""The host side of an emulated USB serial adapter: a pseudo-terminal with udev-style names."""

from __future__ import annotations

import fcntl
import os
import shutil
import struct
import sys
import termios
import tty
from pathlib import Path

from joshua.api.files import safe_name

VENDOR_ID = "1a86"
PRODUCT_ID = "55d3"  # the adapter of SO-ARM100 kits

_IS_LINUX = sys.platform == "linux"
_TCGETS2 = 0x802C542A
_TERMIOS2 = struct.Struct("=4IB19B2I")


class PtyLine:
    """One emulated adapter below ``root``, which holds ``dev/`` and ``sys/`` as a Linux host does.

    Args:
        root: folder for the names; ``dev/NAME``, ``dev/serial/by-id/…`` and ``sys/class/tty/NAME``.
        identity: USB serial number of the adapter; "" for one without, as cheap ones are.
        product: what the adapter is called in its name by identity.

    Raises:
        UnsafePathError: the identity or the product cannot be a part of a path.
    """

    def __init__(self, root: Path, identity: str, product: str = "Servo_Bus") -> None:
        self.root = root
        self.identity = safe_name(identity, "the identity") if identity else ""
        self.product = safe_name(product, "the product")
        self.name = ""
        self.master = -1
        self._slave = -1

    @property
    def plugged(self) -> bool:
        """Whether the adapter is plugged in."""
        return self.master >= 0

    @property
    def port(self) -> Path:
        """Path that a host opens."""
        return self.root / "dev" / self.name

    @property
    def by_id(self) -> Path:
        """Path by the adapter's identity, which stays the same from plug to plug."""
        name = f"usb-JOSHUA_Emulated_{self.product}_{self.identity}-if00"
        return self.root / "dev" / "serial" / "by-id" / name

    def plug(self, name: str) -> None:
        """Plug the adapter in under a device name such as ``ttyACM0``.

        Raises:
            FileExistsError: another adapter has it; UnsafePathError: it cannot be a part of a path.
        """
        safe_name(name, "the device name")
        if (self.root / "dev" / name).exists():
            raise FileExistsError(f"{self.root / 'dev' / name}: is in use; choose another name")
        self.unplug()
        self.master, self._slave = os.openpty()
        os.set_blocking(self.master, False)
        tty.setraw(self._slave)
        self.name = name
        self.port.parent.mkdir(parents=True, exist_ok=True)
        self.by_id.parent.mkdir(parents=True, exist_ok=True)
        _link(self.port, os.ttyname(self._slave))
        _link(self.by_id, f"../../{name}")
        self._describe_usb()

    def unplug(self) -> None:
        """Unplug the adapter: its names vanish, and the terminal hangs up on whoever has it open."""
        if not self.plugged:
            return
        for path in (self.by_id, self.port, self._class_link):
            path.unlink(missing_ok=True)
        shutil.rmtree(self._usb_device, ignore_errors=True)
        os.close(self._slave)
        os.close(self.master)
        self.master = self._slave = -1

    def line_speed(self) -> int:
        """Line speed that the host has set, bit/s.

        Also lifts the host's exclusive lock on the terminal, which a pseudo-terminal would keep after the
        host has closed it, unlike a serial port.
        """
        fcntl.ioctl(self._slave, termios.TIOCNXCL)
        if _IS_LINUX:
            raw = fcntl.ioctl(self._slave, _TCGETS2, bytes(_TERMIOS2.size))
            return int(_TERMIOS2.unpack(raw)[-1])
        return int(termios.tcgetattr(self._slave)[5])

    @property
    def _usb_device(self) -> Path:
        return self.root / "sys" / "devices" / f"usb-{self.identity}"

    @property
    def _class_link(self) -> Path:
        return self.root / "sys" / "class" / "tty" / self.name

    def _describe_usb(self) -> None:
        node = self._usb_device / "1-1:1.0" / "tty" / self.name
        node.mkdir(parents=True)
        (node / "device").symlink_to("../..")
        for name, text in (("idVendor", VENDOR_ID), ("idProduct", PRODUCT_ID), ("serial", self.identity)):
            (self._usb_device / name).write_text(text + "\n", encoding="ascii")
        self._class_link.parent.mkdir(parents=True, exist_ok=True)
        _link(self._class_link, str(node))


def _link(path: Path, target: str) -> None:
    """Create or replace a symbolic link atomically."""
    temporary = path.with_name(f".{path.name}.new")
    temporary.unlink(missing_ok=True)
    temporary.symlink_to(target)
    temporary.replace(path)
