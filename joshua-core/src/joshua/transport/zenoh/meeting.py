"""Where the sessions of one user meet: UNIX sockets in folders that only this user can enter.

A router listens on ``zenoh/<port>.sock`` in the folder of running systems. The process that hosts it holds
the lock ``zenoh/<port>.host``, which says how far the router reaches.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import secrets
import socket
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from joshua.ipc.run_bases import (
    MAX_PATH_BYTES,
    RunDirectoryError,
    base_directories,
    private,
    short_base_directory,
)
from joshua.plan import TransportSettings
from joshua.transport.transports import TransportError
from joshua.transport.zenoh.endpoints import read_endpoint

Reach = Literal["this user", "certificates", "everyone"]
"""Who may command over a router: this user, who holds a certificate, or everyone who reaches it."""

_FOLDER = "zenoh"
_PATH_BYTES = len("/zenoh/65535.sock")
_ROUTER = "router.sock"


def reach_of(settings: TransportSettings) -> Reach:
    """Who may command over the router that these settings describe.

    Raises:
        TransportError: an endpoint is malformed.
    """
    if settings.open_to_local_users:
        return "everyone"
    listens = [read_endpoint(text) for text in settings.listen_endpoints]
    connects = [read_endpoint(text) for text in settings.connect_endpoints]
    if any(not end.encrypted for end in connects) or any(
        not end.encrypted and not end.loopback for end in listens
    ):
        return "everyone"
    return "certificates" if any(end.encrypted for end in (*listens, *connects)) else "this user"


@dataclass(frozen=True)
class Hosted:
    """What a process says about the router that it hosts."""

    process_id: int
    endpoints: tuple[str, ...]
    reach: Reach


class MeetingPlace:
    """The socket on which this user's sessions find the router of one port.

    Args:
        settings: of the transport. The port of the first endpoint names the place.

    Raises:
        TransportError: no folder of this user can be used.
    """

    def __init__(self, settings: TransportSettings) -> None:
        self._name = str(read_endpoint(settings.listen_endpoints[0]).port)
        try:
            base = private(short_base_directory(os.environ, _PATH_BYTES))
            self._folder = private(base / _FOLDER)
        except RunDirectoryError as error:
            raise TransportError(str(error)) from error
        self._lock: int | None = None

    @property
    def socket(self) -> Path:
        """Path of the router's UNIX socket."""
        return self._folder / f"{self._name}.sock"

    def take(self, hosted: Hosted) -> bool:
        """Become the host; False if another process of this user is.

        Raises:
            TransportError: the folder cannot be used.
        """
        try:
            private(self._folder.parent)
            private(self._folder)
            descriptor = os.open(self.lock_file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except (RunDirectoryError, OSError) as error:
            raise TransportError(str(error)) from error
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # a run with another environment may host it in another folder of this user
            elsewhere = any(path != self.socket for path in live_sockets(self._name))
            if not elsewhere:
                os.ftruncate(descriptor, 0)
                os.pwrite(descriptor, json.dumps(asdict(hosted)).encode(), 0)
        except BlockingIOError:
            elsewhere = True
        except OSError as error:
            os.close(descriptor)
            raise TransportError(f"{self.lock_file}: {error.strerror}. Free space there") from error
        if elsewhere:
            os.close(descriptor)
            return False
        self._lock = descriptor
        return True

    def leave(self) -> None:
        """Stop being the host. Idempotent."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def hosted(self) -> Hosted | None:
        """What the present host says; None if it is not known."""
        for path in live_sockets(self._name):
            with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
                said = json.loads(path.with_suffix(".host").read_bytes())
                return Hosted(int(said["process_id"]), tuple(said["endpoints"]), said["reach"])
        return None

    @property
    def sockets(self) -> list[Path]:
        """Every path at which the router of this user may be, whichever process hosts it."""
        return list(dict.fromkeys([self.socket, *_paths(self._name)]))

    @property
    def lock_file(self) -> Path:
        """The file that the host of the router has locked."""
        return self._folder / f"{self._name}.host"


def live_socket(settings: TransportSettings) -> Path | None:
    """The UNIX socket of the router that a process of this user hosts; None if there is none."""
    found = live_sockets(str(read_endpoint(settings.listen_endpoints[0]).port))
    return found[0] if found else None


def live_sockets(name: str) -> list[Path]:
    """UNIX sockets of this user on which the router of a port accepts connections."""
    return [path for path in _paths(name) if _is_ours(path.parent) and _accepts(path)]


def own_socket(folder: str) -> Path:
    """An unused socket path for one session in the folder of a run."""
    return Path(folder) / f"{secrets.token_hex(4)}.sock"


def router_socket(folder: str) -> Path:
    """Socket of a run's own router in the folder of the run."""
    return Path(folder) / _ROUTER


def unix_endpoint(path: Path) -> str:
    """A path as a Zenoh endpoint."""
    return f"unixsock-stream/{path}"


def _paths(name: str) -> list[Path]:
    """Paths of the socket in every folder of this user that a run may have chosen."""
    bases = dict.fromkeys([short_base_directory(os.environ, _PATH_BYTES), *base_directories(os.environ)])
    paths = [base / _FOLDER / f"{name}.sock" for base in bases]
    return [path for path in paths if len(os.fsencode(path)) <= MAX_PATH_BYTES]


def _is_ours(folder: Path) -> bool:
    try:
        status = folder.lstat()
    except OSError:
        return False
    return status.st_uid == os.getuid() and not status.st_mode & 0o077


def _accepts(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            return False
        return True
