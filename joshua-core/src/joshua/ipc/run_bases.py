"""Directories of running systems, what outlives a run, and addresses of UNIX sockets."""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

_RUNTIME_FOLDERS = Path("/run/user")
_FALLBACK = Path("/tmp")  # noqa: S108 (owner and mode of the folder there are checked)

#: Longest path of a UNIX socket on every system (``sun_path``: 104 bytes on macOS, one of them zero).
MAX_PATH_BYTES = 103


class RunDirectoryError(Exception):
    """The directory for running systems cannot be used. The message says why and what to do."""


def base_directory(environment: Mapping[str, str]) -> Path:
    """``$XDG_RUNTIME_DIR/joshua``, else ``/tmp/joshua-<uid>``."""
    given = _given_base(environment)
    if given is not None and os.access(given.parent, os.W_OK):
        return given
    return _fallback()


def _given_base(environment: Mapping[str, str]) -> Path | None:
    runtime = environment.get("XDG_RUNTIME_DIR", "")
    if Path(runtime).is_absolute() and os.path.isdir(runtime):  # noqa: PTH112
        return Path(runtime) / "joshua"
    return None


def short_base_directory(environment: Mapping[str, str], bytes_below: int) -> Path:
    """The base directory, or ``/tmp/joshua-<uid>`` if a socket's path below it would be too long."""
    base = base_directory(environment)
    return base if len(os.fsencode(base)) + bytes_below <= MAX_PATH_BYTES else _fallback()


def base_directories(environment: Mapping[str, str], *, make: bool = False) -> list[Path]:
    """Every base directory of this user's systems, that of this environment first.

    A service, a container or ``su`` often lacks the ``XDG_RUNTIME_DIR`` of a terminal, but a command that
    stops a robot must find its run. A user who set the variable to a folder of their own uses only that one.
    A folder that has become read-only since the start of a run counts, too.

    Args:
        make: create missing directories.

    Raises:
        RunDirectoryError: with ``make``, no directory can be used.
    """
    if make:
        _make_runtime_folder(environment)
    own = base_directory(environment)
    others = other_bases(own, make=make)
    given = _given_base(environment)
    if given is not None and given not in (own, *others) and _is_ours(given, make=False):
        others.insert(0, given)
    if make and not _is_ours(own, make=True):
        if not others:
            private(own)  # raises
        return others  # a robot that runs there must not wait until ``own`` is repaired
    return [own, *others]


def _make_runtime_folder(environment: Mapping[str, str]) -> None:
    """Creates ``XDG_RUNTIME_DIR`` again if it has vanished: a run may still look for latches there."""
    runtime = Path(environment.get("XDG_RUNTIME_DIR", ""))
    if runtime.is_absolute():
        with contextlib.suppress(OSError):  # of a system that lets only root create it
            runtime.mkdir(mode=0o700, parents=True, exist_ok=True)


def other_bases(base: Path, *, make: bool = False) -> list[Path]:
    """The other usual places. Empty if the user chose ``base``."""
    usual = [_RUNTIME_FOLDERS / str(os.getuid()) / "joshua", _fallback()]
    return [path for path in usual if path != base and _is_ours(path, make=make)] if base in usual else []


def _fallback() -> Path:
    return _FALLBACK / f"joshua-{os.getuid()}"


def _is_ours(path: Path, *, make: bool) -> bool:
    """Whether the directory exists and belongs to this user. Other users' files are never read."""
    try:
        return (make or os.path.lexists(path)) and bool(private(path))
    except RunDirectoryError:
        return False


def private(path: Path) -> Path:
    """Creates a directory that only this user can enter, or checks the existing one."""
    try:
        path.mkdir(mode=0o700, exist_ok=True)
        status = path.lstat()
    except OSError as error:
        raise RunDirectoryError(
            f"{path} cannot be created: {error.strerror}. Set XDG_RUNTIME_DIR to another folder"
        ) from error
    mode = stat.S_IMODE(status.st_mode)
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid():
        raise RunDirectoryError(
            f"{path} belongs to user {status.st_uid} or is not a directory, so another user could "
            "impersonate a running robot there; remove it or set XDG_RUNTIME_DIR to a folder of your own"
        )
    if mode & 0o077:
        raise RunDirectoryError(f"{path} has mode {mode:04o}: other users can enter it. Run chmod 700 {path}")
    return path


def state_home(environment: Mapping[str, str]) -> Path:
    """``joshua`` in ``XDG_STATE_HOME`` or ``~/.local/state``, or beside the runs for a user without home."""
    given = Path(environment.get("XDG_STATE_HOME", ""))
    if given.is_absolute():
        return given / "joshua"
    try:
        return Path.home() / ".local" / "state" / "joshua"
    except RuntimeError:  # a user id of a container that is in no list
        base = base_directory(environment)
        with contextlib.suppress(RunDirectoryError):  # the run reports it with the remedy
            private(base)
        return base / "state"


@contextmanager
def socket_address(path: Path) -> Iterator[str]:
    """Yields an address for ``bind`` or ``connect``, valid inside the context, for a path of any length.

    Raises:
        OSError: the path is too long and the system has no ``/proc/self/fd``, or its folder is missing.
    """
    if len(os.fsencode(path)) <= MAX_PATH_BYTES:
        yield str(path)
        return
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield f"/proc/self/fd/{folder}/{path.name}"
    finally:
        os.close(folder)
