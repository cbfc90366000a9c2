"""A second user of this machine, for tests of what other users can reach.

Root makes an account by ``useradd`` and removes it afterwards. Where there is no ``useradd``, the programs
run under a user id without an account. The id of the test says which of the two it was.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import pwd
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

#: User id without an account.
NOBODY_KNOWN = 61234

_PREFIX = "joshua-test-"
_HAS_ACCOUNTS = bool(shutil.which("useradd") and shutil.which("userdel"))

needs_second_user = pytest.mark.skipif(
    os.geteuid() != 0 or not sys.platform.startswith("linux"),
    reason="only root can start a program of another user, and only Linux tells whose a connection is",
)


@dataclass(frozen=True)
class SecondUser:
    """A user that is neither this one nor root.

    Attributes:
        uid: its id; shown: how messages name it.
    """

    uid: int
    shown: str


@pytest.fixture(scope="module", params=["made by useradd" if _HAS_ACCOUNTS else "an id without an account"])
def second_user(request: pytest.FixtureRequest) -> Iterator[SecondUser]:
    """A second user, whose account is removed afterwards."""
    if not _HAS_ACCOUNTS:
        yield SecondUser(NOBODY_KNOWN, str(NOBODY_KNOWN))
        return
    name = f"{_PREFIX}{os.getpid()}"
    with _accounts():
        _remove_leftovers()
        subprocess.run(
            ["useradd", "--system", "--no-create-home", "--shell", "/bin/false", name],
            check=True,
            capture_output=True,
        )
    try:
        uid = pwd.getpwnam(name).pw_uid
        yield SecondUser(uid, f"{name} ({uid})")
    finally:
        with _accounts():
            _remove(name)


@contextlib.contextmanager
def _accounts() -> Iterator[None]:
    """Let one process at a time change the accounts: the tools refuse to wait for each other."""
    with (Path(tempfile.gettempdir()) / f"{_PREFIX}accounts.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _remove_leftovers() -> None:
    """Remove the accounts of test processes that were killed."""
    for entry in pwd.getpwall():
        found = re.fullmatch(rf"{_PREFIX}(\d+)", entry.pw_name)
        if found and not Path("/proc", found[1]).exists():
            _remove(entry.pw_name)


def _remove(name: str) -> None:
    # Code 8: a process of the user still ends. The account goes nevertheless.
    subprocess.run(["userdel", "--force", name], check=True, capture_output=True)
