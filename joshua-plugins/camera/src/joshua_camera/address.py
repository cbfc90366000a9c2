"""Connects to a camera at an address, and explains failures."""

from __future__ import annotations

import base64
import errno
import http.client
import os
import select
import socket
import ssl
import threading
import time
from urllib.parse import unquote, urlsplit

from joshua.api import DeviceError

from joshua_camera.source import CameraSource
from joshua_camera.source_text import scheme

_STEP_S = 0.05  # latency of a stop request
_PICTURE_TYPES = ("multipart/x-mixed-replace", "image/", "video/", "application/octet-stream")


def connect(source: CameraSource, endpoint: tuple[str, int], stop: threading.Event, timeout_s: float) -> None:
    """Check that a server listens at the camera's address.

    Args:
        endpoint: host and port.
        stop: aborts the wait.
        timeout_s: longest wait for an answer.

    Raises:
        DeviceError: no reply. The message says why and what to do.
    """
    host, port = endpoint
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:  # the latter if the host is not a valid name
        raise DeviceError(
            f"{source.label} cannot be reached: the host {host} is unknown ({_reason(error)}): "
            "check its name, or write its IP address"
        ) from error
    deadline_s = time.monotonic() + timeout_s
    problem: OSError = TimeoutError(errno.ETIMEDOUT, "no answer")
    for family, kind, protocol, _, address in addresses:
        with socket.socket(family, kind, protocol) as probe:
            probe.setblocking(False)
            code = probe.connect_ex(address)
            while code in (errno.EINPROGRESS, errno.EALREADY) and time.monotonic() < deadline_s:
                if stop.is_set():
                    raise DeviceError(f"{source.label} was closed while opening: open it again")
                if select.select([], [probe], [], _STEP_S)[1]:
                    code = probe.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            if code == 0:
                return
            if code not in (errno.EINPROGRESS, errno.EALREADY):
                problem = OSError(code, os.strerror(code))
    raise DeviceError(
        f"{source.label} cannot be reached: {_reason(problem)} at {host} port {port}: start the stream on "
        "the camera or the phone, check the port, and that both are in the same network"
    )


def explain(source: CameraSource, waited_s: float, timeout_s: float) -> DeviceError:
    """Explain why a responding address is not a camera, by another HTTP request."""
    if scheme(source.target) not in ("http", "https"):
        late = waited_s >= timeout_s
        reason = f"it sent nothing within {timeout_s:g} s" if late else "its reply could not be read"
        return DeviceError(
            f"{source.label} is not a video stream: {reason}: check path, user name and password"
        )
    try:
        status, reason, kind = _ask(source.target, timeout_s)
    except (OSError, http.client.HTTPException) as error:
        return DeviceError(
            f"{source.label} does not answer like a camera: {_reason(error)}: check scheme and port"
        )
    if status in (401, 403):
        return DeviceError(
            f"{source.label} denies access (HTTP {status} {reason}): "
            "add user name and password to the address, as in http://USER:PASSWORD@HOST/PATH"
        )
    if status != 200:
        return DeviceError(
            f"{source.label} has no stream (HTTP {status} {reason}): "
            "copy the path of the stream from the camera's or the phone's page"
        )
    if not kind.startswith(_PICTURE_TYPES):
        return DeviceError(
            f"{source.label} is not a video stream but {kind or 'of no known type'}: "
            "copy the address of the stream itself, not of the page that shows it"
        )
    return DeviceError(
        f"{source.label} cannot be read as {kind}: choose Motion JPEG or H.264 on the camera's page"
    )


def _ask(address: str, timeout_s: float) -> tuple[int, str, str]:
    """Return the HTTP status, its reason and the content type of an address."""
    parts = urlsplit(address)
    host, port = parts.hostname or "", parts.port
    connection = (
        http.client.HTTPSConnection(host, port, timeout=timeout_s)
        if scheme(address) == "https"
        else http.client.HTTPConnection(host, port, timeout=timeout_s)
    )
    try:
        path = parts.path or "/"
        headers = {}
        if parts.username is not None:
            secret = f"{unquote(parts.username)}:{unquote(parts.password or '')}".encode()
            headers["Authorization"] = f"Basic {base64.b64encode(secret).decode('ascii')}"
        connection.request("GET", f"{path}?{parts.query}" if parts.query else path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.reason, answer.getheader("Content-Type", "").partition(";")[0]
    finally:
        connection.close()


def _reason(error: Exception) -> str:
    if isinstance(error, ssl.SSLError):
        return f"its certificate or encryption was rejected ({error.reason or error})"
    if isinstance(error, TimeoutError):
        return "no answer"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower()
    return str(error) or type(error).__name__
