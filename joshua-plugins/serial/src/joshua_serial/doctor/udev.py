"""udev rules that give each adapter its own name and mode."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from joshua_serial.usb_ports import PortEntry

MARK = "# Written by joshua doctor --udev"
FILE_NAME = "72-joshua.rules"  # before 73-seat-late.rules, which acts on the tag uaccess

_HEAD = f"""{MARK}; run it again when an adapter is added.
# Each adapter gets a name below /dev/joshua that does not depend on its socket. The user who is logged in
# and the group dialout may open it. ModemManager ignores it.
"""
_FTDI = """# FTDI adapters pass on bytes without delay.
ACTION=="add|change", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"
"""


class NotOurs(Exception):
    """The file was not written by this command. The message says what to do."""


def rules(ports: Sequence[PortEntry], names: Mapping[str, str]) -> str:
    """Return the rules for some adapters.

    Args:
        names: name for the adapter by its device path; the others are named by their identity.
    """
    lines = [_HEAD, *(_rule(port, ports, names) for port in ports)]
    if any(port.driver == "ftdi_sio" for port in ports):
        lines.append(_FTDI)
    return "\n".join(lines)


def _rule(port: PortEntry, ports: Sequence[PortEntry], names: Mapping[str, str]) -> str:
    vendor, _, product = port.vid_pid.partition(":")
    match = [f'ATTRS{{idVendor}}=="{vendor}"', f'ATTRS{{idProduct}}=="{product}"']
    alike = [
        other for other in ports if (other.vid_pid, other.serial_number) == (port.vid_pid, port.serial_number)
    ]
    if port.serial_number:
        match.append(f'ATTRS{{serial}}=="{_pattern(port.serial_number)}"')
    if len(alike) > 1 or not port.serial_number:
        match.append(f'KERNELS=="{port.place}"')
        why = (
            f"# {port.path}: has no identity of its own, so its name depends on its socket, {port.place}. "
            "Keep it there"
        )
    else:
        why = f"# {port.path}: {port.product or 'adapter'} {port.serial_number}"
    unique = port.serial_number if len(alike) == 1 else port.place
    name = names.get(port.path) or f"adapter_{unique or port.place}"
    gives = [
        f'SYMLINK+="joshua/{_plain(name)}"',
        'GROUP="dialout"',
        'MODE="0660"',
        'TAG+="uaccess"',
        'ENV{ID_MM_DEVICE_IGNORE}="1"',
    ]
    return f"{why}\n" + ", ".join(['SUBSYSTEM=="tty"', *match, *gives]) + "\n"


def _pattern(text: str) -> str:
    """Return text as a udev match; pattern characters and quotes are replaced by a wildcard."""
    return re.sub(r'[*?\[\]|"\\]|[^\x20-\x7e]', "?", text)


def _plain(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.-]", "_", text)


def install(text: str, path: Path) -> Path:
    """Write the rules into a file, or into a folder under the usual name; return the file.

    Raises:
        NotOurs: another program's file is there.
        OSError: it cannot be written.
    """
    from joshua.tools import replace_file

    target = path / FILE_NAME if path.is_dir() else path
    if target.exists():
        if not target.read_text(encoding="utf-8", errors="replace").startswith(MARK):
            raise NotOurs(f"{target} was not written by joshua doctor --udev: choose another file")
        replace_file(str(target), text)
    else:
        with target.open("x", encoding="utf-8") as file:
            file.write(text)
    return target
