"""Where what outlasts a run is kept, also for users whom the system does not know."""

from __future__ import annotations

import os
import pwd
from pathlib import Path
from typing import NoReturn

import pytest
from joshua.ipc import run_bases
from joshua.ipc.run_bases import state_home
from joshua.planner.calibration_place import state_folder
from joshua.supervisor.log_files import log_directory


@pytest.fixture
def homeless(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """As a container's process whose user id stands in no list; the folder that stands for /tmp."""

    def unknown(uid: int) -> NoReturn:
        raise KeyError(f"getpwuid(): uid not found: {uid}")

    for name in ("HOME", "XDG_STATE_HOME", "XDG_RUNTIME_DIR", "JOSHUA_LOG_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    monkeypatch.setattr(run_bases, "_FALLBACK", tmp_path)
    return tmp_path


def test_a_user_has_it_at_home() -> None:
    assert state_home({"XDG_STATE_HOME": "/s"}) == Path("/s/joshua")
    assert state_home({"XDG_STATE_HOME": "relative"}) == Path.home() / ".local/state/joshua"


def test_a_user_without_a_home_has_it_beside_the_running_systems(homeless: Path) -> None:
    base = homeless / f"joshua-{os.getuid()}"
    assert log_directory(os.environ) == base / "state/log"
    assert base.stat().st_mode & 0o777 == 0o700, "the run takes it for its own only so"
    assert state_folder(state_home(os.environ), "arm 1") == base / "state/emulated/arm_1"
    assert log_directory({"XDG_STATE_HOME": "/s"}) == Path("/s/joshua/log")


def test_a_folder_that_is_not_its_own_is_left_to_the_run_to_refuse(homeless: Path) -> None:
    base = homeless / f"joshua-{os.getuid()}"
    base.mkdir(mode=0o755)
    base.chmod(0o755)
    assert log_directory(os.environ) == base / "state/log"
