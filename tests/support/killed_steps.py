"""Kills an operation before each of its file operations in turn, each time in a fresh copy of a folder."""

from __future__ import annotations

import json
import os
import shutil
import sys
import traceback
from collections.abc import Callable
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, NoReturn

_EVENTS = ("open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.truncate")
_KILLED = 77


def kill_at_each_step(
    place: Path,
    make: Callable[[Path], object],
    prepare: Callable[[Path], Callable[[], object]],
    look: Callable[[Path], object],
) -> NoReturn:
    """Print the number of operations, and those after which something was wrong, as JSON.

    Args:
        place: folder that does not exist; make: makes what is there before.
        prepare: returns what is to be killed; look: asserts what must hold afterwards.
    """
    base, work = place / "base", place / "work"
    base.mkdir(parents=True)
    wrong: list[int] = []
    if _in_child(lambda: make(base)):
        sys.exit("the folder cannot be made")
    for number in count(1):
        shutil.rmtree(work, ignore_errors=True)
        shutil.copytree(base, work, symlinks=True)
        code = _in_child(partial(_act, number, prepare, work))
        if code not in (0, _KILLED):
            sys.stderr.write(f"it failed before operation {number}\n")
            wrong.append(number)
        if _in_child(lambda: look(work)):
            sys.stderr.write(f"after a kill before operation {number}\n")
            wrong.append(number)
        if code != _KILLED:
            break
    json.dump({"operations": number - 1, "wrong": wrong}, sys.stdout)
    sys.exit(0)


def _act(number: int, prepare: Callable[[Path], Callable[[], object]], work: Path) -> None:
    act = prepare(work)
    _die_before(number, work)
    act()


def _die_before(number: int, place: Path) -> None:
    """End this process before one of its operations on files in a folder."""
    seen = 0
    root = os.fspath(place)

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        nonlocal seen
        if event not in _EVENTS or not isinstance(arguments[0], (str, os.PathLike)):
            return
        flags = arguments[2] if event == "open" else os.O_RDWR
        if not isinstance(flags, int) or not flags & (os.O_WRONLY | os.O_RDWR):
            return
        name = os.fspath(arguments[0])
        # shutil.rmtree names files relative to their folder
        if isinstance(name, str) and (name.startswith(root) or not name.startswith("/")):
            seen += 1
            if seen == number:
                os._exit(_KILLED)

    sys.addaudithook(hook)


def _in_child(act: Callable[[], object]) -> int:
    sys.stderr.flush()
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    sys.stdout = sys.stderr  # of commands
    try:
        act()
    except BaseException:  # noqa: BLE001 - the exit code says it
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
    os._exit(0)
