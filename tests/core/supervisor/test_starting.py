from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from joshua.supervisor.starting import started_processes, starting

KILLED = """
import os, sys
from pathlib import Path
from joshua.supervisor.starting import starting
with starting(Path(sys.argv[1])):
    os._exit(0)
"""


def test_a_run_shows_from_its_first_moment_that_it_starts(tmp_path: Path) -> None:
    base = tmp_path / "joshua"
    assert started_processes([base]) == set()
    with starting(base):
        assert started_processes([tmp_path / "other", base]) == {os.getpid()}
    assert started_processes([base]) == set()
    assert list((base / "starting").iterdir()) == []


def test_one_that_was_killed_starts_no_more(tmp_path: Path) -> None:
    base = tmp_path / "joshua"
    subprocess.run([sys.executable, "-c", KILLED, str(base)], check=True, timeout=60)
    assert len(list((base / "starting").iterdir())) == 1
    assert started_processes([base]) == set()
    assert list((base / "starting").iterdir()) == []


def test_a_base_that_cannot_be_used_is_left_to_the_run(tmp_path: Path) -> None:
    base = tmp_path / "joshua"
    base.mkdir(mode=0o755)
    base.chmod(0o755)
    with starting(base):
        assert started_processes([base]) == set()
