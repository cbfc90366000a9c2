"""Messages for video devices that cannot be used."""

from __future__ import annotations

import errno
import os

from joshua.api import DeviceError

from joshua_camera.devices import holders, list_devices


def explain_device(path: str, error: OSError) -> DeviceError:
    """Return the error for a failed system call on a device, with its remedy."""
    code = error.errno or 0
    if code in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return refuse(path, "does not exist", f"plug the camera in, or choose another; {others(path)}")
    if code in (errno.EACCES, errno.EPERM):
        return refuse(
            path,
            "may not be opened by this user",
            "add the user to the group video (sudo usermod -aG video $USER) and log in again",
        )
    if code == errno.EBUSY:
        found = holders(path)
        who = f"by {', '.join(found)}" if found else "by another process, possibly of another user"
        return refuse(path, f"is in use {who}", "end that program, or choose another camera")
    if code in (errno.ENOTTY, errno.EINVAL):
        return refuse(path, "is not a video device", f"choose another; {others(path)}")
    return refuse(
        path,
        f"cannot be opened ({os.strerror(code).lower()})",
        "unplug it and plug it in again; if that does not help, use another socket",
    )


def refuse(subject: str, problem: str, remedy: str) -> DeviceError:
    """Return an error that names the camera, the problem and the remedy."""
    return DeviceError(f"{subject} {problem}: {remedy}")


def others(path: str) -> str:
    """Return a hint that lists the other devices."""
    found = [
        f"{entry.path} ({entry.name})" if entry.name else entry.path
        for entry in list_devices()
        if entry.path != path
    ]
    return f"found: {', '.join(found)}" if found else "this machine has no other camera"
