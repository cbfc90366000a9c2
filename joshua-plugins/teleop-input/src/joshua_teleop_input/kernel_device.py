"""An input device of this machine's kernel, ``/dev/input/eventN``."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import select
import struct

from joshua.api import DeviceDisconnected

from joshua_teleop_input.codes import EV_ABS, EV_KEY
from joshua_teleop_input.errors import InputDeviceError
from joshua_teleop_input.events import NATIVE_RECORD, AxisRange, Capabilities, EventDecoder, InputEvent

_KEY_BYTES = 96  # KEY_MAX / 8, rounded up
_ABS_BYTES = 8
_NAME_BYTES = 256
_ABSINFO = struct.Struct("iiiiii")
_ID = struct.Struct("HHHH")
_READ_RECORDS = 64


def _request(direction: int, number: int, size: int) -> int:
    """Return an ioctl number of the input subsystem, like the macros _IOR and _IOW."""
    return direction << 30 | size << 16 | ord("E") << 8 | number


EVIOCGID = _request(2, 0x02, _ID.size)
EVIOCGNAME = _request(2, 0x06, _NAME_BYTES)
EVIOCGKEY = _request(2, 0x18, _KEY_BYTES)
EVIOCGRAB = _request(1, 0x90, 4)


def eviocgbit(event_type: int, size: int) -> int:
    """Query the codes of one type that a device has."""
    return _request(2, 0x20 + event_type, size)


def eviocgabs(axis: int) -> int:
    """Query value and limits of an axis."""
    return _request(2, 0x40 + axis, _ABSINFO.size)


class KernelDevice:
    """An open device.

    Args:
        path: of the device file.

    Raises:
        InputDeviceError: it is missing, may not be read, is in use, or is not an input device.
    """

    #: The kernel reports a disconnection, so silence means that nothing changes.
    silence_limit_s: float | None = None

    def __init__(self, path: str) -> None:
        self.path = path
        self._decoder = EventDecoder(NATIVE_RECORD)
        self._descriptor = open_device(path)
        try:
            self.capabilities = read_capabilities(self._descriptor, path)
        except BaseException:
            self.close()
            raise

    def grab(self) -> None:
        """Grab the device exclusively for this process. Raises InputDeviceError."""
        try:
            fcntl.ioctl(self._descriptor, EVIOCGRAB, 1)
        except OSError as error:
            if error.errno == errno.EBUSY:
                raise InputDeviceError(
                    f"{self.capabilities.name} ({self.path}) is in use: another program uses it "
                    "exclusively; close that program, such as a second run, Steam or a key mapper (sudo lsof "
                    f"{self.path} names it)"
                ) from error
            raise DeviceDisconnected(f"{self.path} is gone: {error.strerror}") from error

    def read(self, timeout_s: float) -> list[InputEvent]:
        """Wait for records. Raises DeviceDisconnected."""
        ready, _, _ = select.select([self._descriptor], [], [], timeout_s)
        if not ready:
            return []
        try:
            data = os.read(self._descriptor, NATIVE_RECORD.size * _READ_RECORDS)
        except BlockingIOError:
            return []
        except OSError as error:
            raise DeviceDisconnected(
                f"{self.path} is disconnected: unplugged, or its battery is empty"
            ) from error
        return self._decoder.feed(data)

    def resynchronise(self) -> Capabilities:
        """Return the present state after records were lost."""
        self.capabilities = read_capabilities(self._descriptor, self.path)
        return self.capabilities

    def close(self) -> None:
        """Close the device. Idempotent."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(descriptor)


def open_device(path: str) -> int:
    """Open a device file for reading. Raises InputDeviceError."""
    try:
        return os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError:
        raise InputDeviceError(f"there is no {path}; run joshua find-gamepads to list the gamepads") from None
    except PermissionError:
        raise InputDeviceError(
            f"{path} may not be read by this user: add the user to the group input "
            "(sudo usermod -aG input $USER, then log in again)"
        ) from None
    except OSError as error:
        raise InputDeviceError(f"{path} cannot be opened: {error.strerror}") from error


def read_capabilities(descriptor: int, path: str) -> Capabilities:
    """Query the capabilities of a device. Raises InputDeviceError, DeviceDisconnected."""
    try:
        name = fcntl.ioctl(descriptor, EVIOCGNAME, bytes(_NAME_BYTES)).split(b"\0")[0]
        identity = _ID.unpack(fcntl.ioctl(descriptor, EVIOCGID, bytes(_ID.size)))
        keys = _bits(fcntl.ioctl(descriptor, eviocgbit(EV_KEY, _KEY_BYTES), bytes(_KEY_BYTES)))
        held = _bits(fcntl.ioctl(descriptor, EVIOCGKEY, bytes(_KEY_BYTES)))
        axes = _bits(fcntl.ioctl(descriptor, eviocgbit(EV_ABS, _ABS_BYTES), bytes(_ABS_BYTES)))
        ranges = {
            axis: AxisRange(*_ABSINFO.unpack(fcntl.ioctl(descriptor, eviocgabs(axis), bytes(_ABSINFO.size))))
            for axis in axes
        }
    except OSError as error:
        if error.errno == errno.ENODEV:
            raise DeviceDisconnected(f"{path} is disconnected: unplugged, or its battery is empty") from error
        raise InputDeviceError(
            f"{path} is not an input device ({error.strerror}); joshua find-gamepads lists gamepads"
        ) from error
    return Capabilities(
        name.decode(errors="replace"), identity, keys=frozenset(keys), held=frozenset(held), axes=ranges
    )


def _bits(data: bytes) -> list[int]:
    return [8 * index + bit for index, byte in enumerate(data) for bit in range(8) if byte >> bit & 1]
