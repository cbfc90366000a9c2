"""Kills trainings by SIGKILL at random moments, continues them, and compares them with a whole run.

``soak_resume.py [--kills 20] [--seed 0] [--algorithm PPO|SAC|ACT]``; the exit code is 0 where all are equal.
``./test -s learn -- soak`` runs it.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import test_imitation_runs as imitation
import test_ppo_trainer as reinforcement
from joshua_training.run_folder import RunFolder
from test_ppo_trainer import curve
from tiny_recordings import write_recording

#: Kills that one run survives before it may end.
_OF_A_RUN = 4

#: Longest time between a row of the metrics and the kill, s: it may hit a checkpoint that is being written.
_LATER_S = 0.5

SAC = 'algorithm: "SAC" learning_starts: 200 updates_per_step: 1 hidden_sizes: [16]'


#: Starts a run by its name and further settings.
Start = Callable[[str, str], "subprocess.Popen[str]"]


def killed(process: subprocess.Popen[str], folder: Path, rows: int, later_s: float) -> bool:
    """Kills a run some time after its metrics have a number of rows; False where it ended before."""
    while process.poll() is None and rows_of(folder) < rows:
        time.sleep(0.01)
    try:
        process.communicate(timeout=later_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return True
    return False


def rows_of(folder: Path) -> int:
    """Rows of the metrics of all runs in a folder."""
    return sum(path.read_bytes().count(b"\n") for path in folder.glob("*/metrics.jsonl"))


def resumed(folder: Path, name: str) -> str:
    """What continues the newest run of a name that has a checkpoint; "" for none: it begins anew."""
    runs = sorted((folder / name).glob("*")) if (folder / name).is_dir() else []
    for run in reversed(runs):
        if (run / "run.json").is_file() and RunFolder(run).checkpoints():
            return f'resume_run: "{name}/{run.name}"'
    return ""


def files_of(checkpoint: Path) -> dict[Path, bytes]:
    """The content of a checkpoint, by path."""
    return {
        path.relative_to(checkpoint): path.read_bytes() for path in checkpoint.rglob("*") if path.is_file()
    }


def soak(folder: Path, kills: int, seed: int, start: Start) -> int:
    """Returns how many kills a run did not survive unchanged."""
    whole = start("whole", "")
    said, _ = whole.communicate(timeout=600)
    if whole.returncode:
        sys.stderr.write(said)
        return kills
    (reference,) = (folder / "whole").iterdir()
    expected = curve(reference)
    generator = random.Random(seed)
    done = wrong = number = fresh = 0
    while done < kills:
        number += 1
        name, survived = f"run{number}", 0
        while True:
            own = resumed(folder, name)
            fresh += not own and survived > 0
            process = start(name, own)
            at = generator.randrange(min(rows_of(folder / name), len(expected) - 1), len(expected))
            if survived < min(_OF_A_RUN, kills - done) and killed(
                process, folder / name, at, generator.uniform(0, _LATER_S)
            ):
                survived += 1
                continue
            said = process.communicate(timeout=600)[0] if process.returncode is None else ""
            break
        run = sorted(path for path in (folder / name).iterdir() if (path / "run.json").is_file())[-1]
        same = process.returncode == 0 and curve(run) == expected
        last = [max((path / "checkpoints").iterdir()) for path in (run, reference)]
        same = same and files_of(last[0]) == files_of(last[1])
        wrong += 0 if same else survived
        done += survived
        print(f"{name}: {survived} kills, {'same' if same else 'OTHER'} curve; {done} of {kills}", flush=True)
        if not same:
            sys.stderr.write(said)
    print(f"{done - wrong} of {done} kills survived with the same curve and the same last checkpoint")
    print(f"{fresh} came before the first checkpoint")
    return wrong


def main() -> int:
    """Runs the soak."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=4000)
    parser.add_argument("--algorithm", choices=("PPO", "SAC", "ACT"), default="PPO")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="soak-") as name:
        folder = Path(name)
        if arguments.algorithm == "ACT":
            start = partial(start_imitation, folder, write_recording(folder / "recording"))
        else:
            start = partial(start_reinforcement, folder, arguments.steps, arguments.algorithm)
        wrong = soak(folder, arguments.kills, arguments.seed, start)
    return 1 if wrong else 0


def start_reinforcement(
    folder: Path, steps: int, algorithm: str, name: str, more: str
) -> subprocess.Popen[str]:
    """Starts a training of PPO or SAC."""
    return reinforcement.start(folder, name, steps=steps, more=f"{SAC if algorithm == 'SAC' else ''} {more}")


def start_imitation(folder: Path, recording: Path, name: str, more: str) -> subprocess.Popen[str]:
    """Starts a training of ACT, which lasts longer than its imports."""
    return imitation.start(folder, name, recording, epochs=40, more=more)


if __name__ == "__main__":
    sys.exit(main())
