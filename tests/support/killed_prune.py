"""Kills ``joshua runs prune`` before each of its file operations in turn, see ``killed_steps``."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

from joshua.cli.main import main
from joshua_training.run_folder import RunFolder
from killed_steps import kill_at_each_step


def make(place: Path) -> None:
    """Two old runs, and one that is new, with two checkpoints each."""
    for name in ("old", "older", "new"):
        path = place / "runs" / name
        path.mkdir(parents=True)
        run = RunFolder(path)
        run.write_json("run.json", {"environment": "joshua/Ant-v0"})
        for steps in (1, 2):
            run.save(steps, {"weights": b"0" * 100})


def prune(place: Path) -> Callable[[], object]:
    for name, days in (("old", 10), ("older", 100)):
        folder = place / "runs" / name
        if folder.exists():
            for path in (folder, *folder.rglob("*")):
                os.utime(path, (path.stat().st_mtime - days * 86400,) * 2)
    words = ["runs", "prune", str(place / "runs"), "--older-than", "50", "--keep-checkpoints", "1", "--yes"]
    return lambda: main(words)


def look(place: Path) -> None:
    for run in (place / "runs").glob("[a-z]*"):  # what has a name is complete
        assert (run / "run.json").is_file(), run
        for checkpoint in RunFolder(run).checkpoints():
            assert (checkpoint / "weights").read_bytes() == b"0" * 100, checkpoint
    assert main(["runs", "show", str(place / "runs" / "old")]) == 0
    prune(place)()
    left = sorted(path.name for path in (place / "runs").iterdir())
    assert left == ["new", "old"], left
    kept = sorted(path.name for path in (place / "runs" / "old" / "checkpoints").iterdir())
    assert kept == ["step_000000000002"], kept
    assert len(RunFolder(place / "runs" / "new").checkpoints()) == 2


if __name__ == "__main__":
    kill_at_each_step(Path(sys.argv[1]) / "prune", make, prune, look)
