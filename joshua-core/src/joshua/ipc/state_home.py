"""Where programs of this user keep what must outlast a run: logs, and what emulated devices remember."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path

from joshua.ipc.run_bases import RunDirectoryError, base_directory, private


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
