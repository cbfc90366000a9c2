"""A serial port for drivers: exclusive, raw, 8N1, with reads that end at a deadline."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import grp
import os
import select
import stat
import struct
import sys
import termios
import time
from collections.abc import Callable, Iterator

from joshua.api import Cancelled
from joshua.api.patience import AwakeClock

from joshua_serial.errors import (
    PortBusy,
    PortDisconnected,
    PortForbidden,
    PortGuarded,
    PortNotFound,
    PortUnusable,
)
from joshua_serial.port_holders import describe_process, holders, is_guardian
from joshua_serial.usb_ports import Endpoint, PortEntry, describe_ports, resolve

FULL_LINE_S = 1.0  # a line that accepts no byte for this long, in awake time, is gone
FULL_LOOK_S = 0.1
BITS_PER_BYTE = 10  # start bit, eight data bits, stop bit
_LARGEST_MINIMUM = 255  # VMIN is one byte
_IS_LINUX = sys.platform == "linux"
_TCGETS2, _TCSETS2 = 0x802C542A, 0x402C542B
_TERMIOS2 = struct.Struct("=4IB19s2I")
_ANY_SPEED = 0o010000  # BOTHER: the speed is in a separate field
_SPEED_MASK = 0o010017
_GONE = {errno.EIO, errno.ENXIO, errno.ENODEV, errno.EBADF}


class SerialPort:
    """A serial port, open until ``close`` or the end of the process."""

    def __init__(self, endpoint: Endpoint, baudrate: int) -> None:
        self.endpoint = endpoint
        self.baudrate = baudrate
        self.entry = PortEntry(endpoint.path)
        self._fd = -1
        self._attributes: list[object] = []
        self._minimum = 1
        self._poll = select.poll()
        self._stopping: Callable[[], bool] | None = None

    @property
    def is_open(self) -> bool:
        """Whether the port is open."""
        return self._fd >= 0

    def __str__(self) -> str:
        identity = self.entry.identity
        return f"{self.entry.path} ({identity})" if identity else self.entry.path or str(self.endpoint)

    def open(self) -> None:
        """Find, open, lock and set up the port.

        Raises:
            PortNotFound, PortForbidden, PortBusy, PortUnusable: by cause, each with its remedy.
        """
        self.close()
        self.entry = resolve(self.endpoint)
        self._fd = self._open()
        try:
            self._lock()
            self._set_up()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the port. Idempotent."""
        fd, self._fd = self._fd, -1
        if fd < 0:
            return
        with contextlib.suppress(OSError, KeyError):
            self._poll.unregister(fd)
        with contextlib.suppress(OSError):
            fcntl.ioctl(fd, termios.TIOCNXCL)
        os.close(fd)

    def set_baudrate(self, baudrate: int) -> None:
        """Change the line speed. Raises PortUnusable and PortDisconnected."""
        self.baudrate = baudrate
        try:
            self._apply_speed(baudrate)
        except (OSError, termios.error) as error:
            if error.args and error.args[0] in _GONE:
                raise self._disconnected(error) from error
            raise PortUnusable(
                f"{self}: cannot run at {baudrate} bit/s ({_reason(error)}); choose a baudrate that adapter "
                "and device support, such as 115200"
            ) from error

    def wire_time_s(self, size: int) -> float:
        """Return the time that ``size`` bytes take on the line."""
        return size * BITS_PER_BYTE / self.baudrate

    @contextlib.contextmanager
    def obeying(self, stopping: Callable[[], bool]) -> Iterator[None]:
        """Make ``receive`` raise Cancelled as soon as ``stopping`` returns true, to abort a search."""
        self._stopping = stopping
        try:
            yield
        finally:
            self._stopping = None

    def send(self, data: bytes) -> None:
        """Drop received bytes, then send. Raises PortDisconnected."""
        try:
            termios.tcflush(self._fd, termios.TCIFLUSH)
            sent = self._write(data)
            while sent < len(data):
                self._wait_writable()
                sent += self._write(data[sent:])
        except (OSError, termios.error) as error:
            raise self._disconnected(error) from error

    def discard_input(self) -> None:
        """Drop received bytes. Raises PortDisconnected."""
        try:
            termios.tcflush(self._fd, termios.TCIFLUSH)
        except termios.error as error:
            raise self._disconnected(error) from error

    def set_dtr(self, raised: bool, *, drop_on_close: bool = False) -> None:
        """Raise or lower DTR, which some devices use as a switch; pseudo-terminals have none.

        Args:
            drop_on_close: let the system lower it when the port closes, also when the process dies.

        Raises PortDisconnected.
        """
        try:
            attributes = termios.tcgetattr(self._fd)
            attributes[2] = attributes[2] | termios.HUPCL if drop_on_close else attributes[2] & ~termios.HUPCL
            termios.tcsetattr(self._fd, termios.TCSANOW, attributes)
            self._attributes = termios.tcgetattr(self._fd)
            request = termios.TIOCMBIS if raised else termios.TIOCMBIC
            fcntl.ioctl(self._fd, request, struct.pack("I", termios.TIOCM_DTR))
        except (OSError, termios.error) as error:
            if error.args[0] not in (errno.ENOTTY, errno.EINVAL):
                raise self._disconnected(error) from error

    def receive(self, size: int, deadline_s: float) -> bytes:
        """Wait for ``size`` bytes until a monotonic deadline; return the bytes received, possibly fewer.

        Raises PortDisconnected; Cancelled inside ``obeying``.
        """
        if self._stopping is not None and self._stopping():
            raise Cancelled
        self._set_minimum(size if size <= _LARGEST_MINIMUM else 1)
        data = b""
        while len(data) < size:
            wait_s = deadline_s - time.monotonic()
            try:
                ready = self._poll.poll(max(0.0, wait_s * 1000))
                chunk = self._read_available(size - len(data), hung_up=bool(ready))
            except OSError as error:
                raise self._disconnected(error) from error
            data += chunk
            if wait_s <= 0:
                break
            if chunk and len(data) < size:
                self._set_minimum(1)
        return data

    def _read_available(self, size: int, *, hung_up: bool) -> bytes:
        try:
            chunk = os.read(self._fd, size)
        except BlockingIOError:
            return b""
        if not chunk and hung_up:
            raise OSError(errno.EIO, "the line hung up")
        return chunk

    def _set_minimum(self, size: int) -> None:
        """Have the kernel wake this process only when ``size`` bytes are available or at the deadline."""
        if size == self._minimum:
            return
        self._minimum = size
        characters = self._attributes[6]
        assert isinstance(characters, list)
        characters[termios.VMIN] = size
        try:
            termios.tcsetattr(self._fd, termios.TCSANOW, self._attributes)  # type: ignore[arg-type]
        except termios.error as error:
            raise self._disconnected(error) from error

    def _write(self, data: bytes) -> int:
        """Return the number of bytes written; 0 while the buffer is full."""
        try:
            return os.write(self._fd, data)
        except BlockingIOError:
            return 0

    def _wait_writable(self) -> None:
        clock = AwakeClock(longest_look_s=FULL_LOOK_S)
        began_s = clock.now_s()
        writable: list[int] = []
        while not writable:
            if clock.now_s() - began_s >= FULL_LINE_S:
                raise OSError(errno.EIO, "the line accepts no bytes")
            _, writable, _ = select.select([], [self._fd], [], FULL_LOOK_S)

    def _open(self) -> int:
        path = self.entry.path
        try:
            fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            if error.errno in (errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.ELOOP, errno.ENOTDIR):
                raise PortNotFound(
                    f"{path}: no such serial port. Ports here: {describe_ports(self.endpoint.device_root)}. "
                    "Plug the adapter in or correct comm.serial.port; serial_number finds it under any "
                    "path."
                ) from error
            if error.errno in (errno.EACCES, errno.EPERM):
                raise PortForbidden(_forbidden(path)) from error
            if error.errno == errno.EBUSY:
                raise _busy(path) from error
            raise PortUnusable(f"{path}: cannot be opened ({_reason(error)})") from error
        if not os.isatty(fd):
            os.close(fd)
            raise PortUnusable(
                f"{path}: is not a serial port. Ports here: {describe_ports(self.endpoint.device_root)}. "
                "Correct comm.serial.port."
            )
        return fd

    def _lock(self) -> None:
        try:
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            fcntl.ioctl(self._fd, termios.TIOCEXCL)
        except BlockingIOError as error:
            raise _busy(self.entry.path) from error
        except OSError as error:
            raise self._disconnected(error) from error

    def _set_up(self) -> None:
        try:
            attributes = termios.tcgetattr(self._fd)
            attributes[0] = attributes[1] = attributes[3] = 0  # no translation, no echo, no line editing
            attributes[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
            attributes[6][termios.VMIN] = 1
            attributes[6][termios.VTIME] = 0
            termios.tcsetattr(self._fd, termios.TCSANOW, attributes)
        except termios.error as error:
            if error.args[0] in _GONE:
                raise self._disconnected(error) from error
            raise PortUnusable(f"{self}: cannot be configured as a serial port ({_reason(error)})") from error
        self.set_baudrate(self.baudrate)
        self._raise_modem_lines()
        self._poll.register(self._fd, select.POLLIN)

    def _apply_speed(self, baudrate: int) -> None:
        constant = getattr(termios, f"B{baudrate}", None)
        attributes = termios.tcgetattr(self._fd)
        if constant is not None:
            attributes[4] = attributes[5] = constant
            termios.tcsetattr(self._fd, termios.TCSANOW, attributes)
        elif _IS_LINUX:
            raw = list(_TERMIOS2.unpack(fcntl.ioctl(self._fd, _TCGETS2, bytes(_TERMIOS2.size))))
            raw[2] = raw[2] & ~_SPEED_MASK | _ANY_SPEED
            raw[-2] = raw[-1] = baudrate
            fcntl.ioctl(self._fd, _TCSETS2, _TERMIOS2.pack(*raw))
        else:
            raise OSError(errno.EINVAL, "no such line speed on this system")
        self._attributes = termios.tcgetattr(self._fd)
        self._minimum = int(self._attributes[6][termios.VMIN])  # type: ignore[index]

    def _raise_modem_lines(self) -> None:
        """Raise DTR and RTS, which some adapters require; pseudo-terminals have neither."""
        try:
            fcntl.ioctl(self._fd, termios.TIOCMBIS, struct.pack("I", termios.TIOCM_DTR | termios.TIOCM_RTS))
        except OSError as error:
            if error.errno not in (errno.ENOTTY, errno.EINVAL):
                raise self._disconnected(error) from error

    def _disconnected(self, error: BaseException) -> PortDisconnected:
        found_again = (
            "JOSHUA finds it again by its identity, under any path"
            if self.endpoint.is_lasting
            else "JOSHUA finds it again under this path only; with serial_number, under any path (joshua "
            "find-port --write)"
        )
        return PortDisconnected(
            f"{self}: the adapter is gone ({_reason(error)}). Check its plug and cable. {found_again}."
        )


def _forbidden(path: str) -> str:
    try:
        status = os.stat(path)  # noqa: PTH116 - follows links like open does
    except OSError:
        return f"{path}: this user may not open the port."
    try:
        group = grp.getgrgid(status.st_gid).gr_name
    except KeyError:
        group = str(status.st_gid)
    if not status.st_mode & stat.S_IWGRP:
        mode = stat.filemode(status.st_mode)
        remedy = f"its mode {mode} gives no group access: install the udev rules of joshua doctor --udev"
    else:
        remedy = f"it belongs to the group {group}: run `sudo usermod -a -G {group} $USER`, then log in again"
    return f"{path}: this user may not open the port; {remedy}."


def _busy(path: str) -> PortBusy:
    processes = holders(path)
    if any(map(is_guardian, processes)):
        return PortGuarded(
            f"{path}: a guardian (process {processes[0]}) is bringing the device into its safe state. It "
            "ends within seconds. Then try again.",
            processes=processes,
        )
    who = ", ".join(map(describe_process, processes)) or "another process"
    return PortBusy(
        f"{path}: the port is in use by {who}. Stop it, or correct comm.serial. Two programs cannot share a "
        "bus.",
        processes=processes,
    )


def _reason(error: BaseException) -> str:
    number = error.args[0] if error.args else None
    return os.strerror(number) if isinstance(number, int) else str(error)
