"""Where running systems have their directories, and what outlasts a run."""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Mapping
from pathlib import Path

from joshua.guardian.socket_address import MAX_PATH_BYTES

_RUNTIME_FOLDERS = Path("/run/user")
_FALLBACK = Path("/tmp")  # noqa: S108 (owner and mode of the folder there are checked)


class RunDirectoryError(Exception):
    """The directory for running systems cannot be used; the message says why and what to do."""


def base_directory(environment: Mapping[str, str]) -> Path:
    """``$XDG_RUNTIME_DIR/joshua``, else ``/tmp/joshua-<uid>``."""
    runtime = environment.get("XDG_RUNTIME_DIR", "")
    if Path(runtime).is_absolute() and os.path.isdir(runtime) and os.access(runtime, os.W_OK):  # noqa: PTH112
        return Path(runtime) / "joshua"
    return _FALLBACK / f"joshua-{os.getuid()}"


def short_base_directory(environment: Mapping[str, str], bytes_below: int) -> Path:
    """The base directory, else ``/tmp/joshua-<uid>`` where a socket's path below it would be too long."""
    base = base_directory(environment)
    fits = len(os.fsencode(base)) + bytes_below <= MAX_PATH_BYTES
    return base if fits else _FALLBACK / f"joshua-{os.getuid()}"


def base_directories(environment: Mapping[str, str], *, make: bool = False) -> list[Path]:
    """Every base at which systems of this user may run, that of this environment first.

    A service, a container or ``su`` often lacks the ``XDG_RUNTIME_DIR`` that a terminal has: whoever stops a
    robot must find it all the same. Who has set the variable to a folder of his own looks only there.

    Args:
        make: make those that are not there.

    Raises:
        RunDirectoryError: with ``make``, none can be used.
    """
    own = base_directory(environment)
    others = other_bases(own, make=make)
    if make and not _is_ours(own, make=True):
        if not others:
            private(own)  # says why
        return others  # a robot that runs there does not wait until the first one is put right
    return [own, *others]


def other_bases(base: Path, *, make: bool = False) -> list[Path]:
    """The other usual places; none for a base that somebody has chosen."""
    usual = _usual_places()
    return [path for path in usual if path != base and _is_ours(path, make=make)] if base in usual else []


def _usual_places() -> list[Path]:
    return [_RUNTIME_FOLDERS / str(os.getuid()) / "joshua", _FALLBACK / f"joshua-{os.getuid()}"]


def _is_ours(path: Path, *, make: bool) -> bool:
    """Whether a base is there and this user's own; what another user has put there is never read."""
    try:
        return (make or os.path.lexists(path)) and bool(private(path))
    except RunDirectoryError:
        return False


def private(path: Path) -> Path:
    """Makes a directory that only this user can enter, or checks the one that is there."""
    try:
        path.mkdir(mode=0o700, exist_ok=True)
        status = path.lstat()
    except OSError as error:
        raise RunDirectoryError(f"{path} cannot be made: {error.strerror}; set XDG_RUNTIME_DIR") from error
    mode = stat.S_IMODE(status.st_mode)
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid():
        raise RunDirectoryError(
            f"{path} belongs to user {status.st_uid} or is no directory, so another user could pose as a "
            f"running robot there; remove it or set XDG_RUNTIME_DIR to a folder of your own"
        )
    if mode & 0o077:
        raise RunDirectoryError(f"{path} has mode {mode:04o}, so others can enter it: chmod 700 {path}")
    return path


def state_home(environment: Mapping[str, str]) -> Path:
    """``joshua`` in ``XDG_STATE_HOME`` or ``~/.local/state``.

    A user without a home, as a container may have whose user id stands in no list, keeps it beside the
    running systems.
    """
    given = Path(environment.get("XDG_STATE_HOME", ""))
    if given.is_absolute():
        return given / "joshua"
    try:
        return Path.home() / ".local" / "state" / "joshua"
    except RuntimeError:
        base = base_directory(environment)
        with contextlib.suppress(RunDirectoryError):  # the run is refused for it, with what to do
            private(base)
        return base / "state"
