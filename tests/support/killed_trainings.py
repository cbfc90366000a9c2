"""Kills trainings by SIGKILL at random moments, continues them, and compares them with a whole run."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from joshua_training.run_folder import RunFolder

#: Starts a training below a folder of a name, or continues a run there.
Begin = Callable[[str, Path | None], "subprocess.Popen[str]"]

#: Longest time between a checkpoint and the kill, s: it may hit the next one while that is written.
_LATER_S = 1.0

#: Kills that one run survives before it may end.
_OF_A_RUN = 4


def curve(run: Path) -> list[dict[str, float]]:
    """Metrics of a run, without its rates."""
    found = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    return [{key: value for key, value in row.items() if not key.startswith("rate/")} for row in found]


def same(run: Path, reference: Path) -> bool:
    """Whether two runs have equal curves, and equal last checkpoints byte for byte."""
    one, other = (_files_of(max((path / "checkpoints").iterdir())) for path in (run, reference))
    return curve(run) == curve(reference) and one == other


def _files_of(folder: Path) -> dict[Path, bytes]:
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def newest_checkpoint(folder: Path) -> str:
    """Name of the newest checkpoint of the runs in a folder; "" for none."""
    return max((path.name for path in folder.glob("*/checkpoints/step_*")), default="")


def killed_while_learning(
    process: subprocess.Popen[str], folder: Path, generator: random.Random, most_s: float
) -> bool:
    """Kills a run at a random moment after its next checkpoint; False where it ended before."""
    before = newest_checkpoint(folder)
    while newest_checkpoint(folder) <= before and process.poll() is None:
        time.sleep(0.01)
    try:
        process.communicate(timeout=generator.uniform(0.0, most_s))
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return True
    return False


def run_to_continue(folder: Path) -> Path | None:
    """The newest run in a folder that has a checkpoint; None for none: it begins anew."""
    for run in sorted(folder.glob("*"), reverse=True):
        if (run / "run.json").is_file() and RunFolder(run).checkpoints():
            return run
    return None


def soak(folder: Path, begin: Begin, kills: int, seed: int) -> int:
    """Returns how many kills a run did not survive unchanged.

    Each kill comes at a random moment after a further checkpoint: most of a start is imports or compilation.
    """
    whole = begin("whole", None)
    said, _ = whole.communicate(timeout=600)
    if whole.returncode:
        sys.stderr.write(said)
        return kills
    (reference,) = (folder / "whole").iterdir()
    generator = random.Random(seed)
    done = wrong = number = 0
    while done < kills:
        number += 1
        name, survived = f"run{number}", 0
        while True:
            own = run_to_continue(folder / name)
            process = begin(name, own)
            if survived < min(_OF_A_RUN, kills - done) and killed_while_learning(
                process, folder / name, generator, _LATER_S
            ):
                survived += 1
                continue
            said, _ = process.communicate(timeout=600) if process.returncode is None else ("", "")
            break
        run = sorted(path for path in (folder / name).iterdir() if (path / "run.json").is_file())[-1]
        is_same = process.returncode == 0 and same(run, reference)
        wrong += 0 if is_same else survived
        done += survived
        print(
            f"{name}: {survived} kills, {'same' if is_same else 'OTHER'} curve; {done} of {kills}", flush=True
        )
        if not is_same:
            sys.stderr.write(said)
    print(f"{done - wrong} of {done} kills survived with the same curve and the same last checkpoint")
    return wrong
