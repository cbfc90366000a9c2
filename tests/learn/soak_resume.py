"""Kills trainings by SIGKILL at random moments, continues them, and compares them with a whole run.

``soak_resume.py [--kills 20] [--seed 0] [--algorithm PPO|SAC]``; the exit code is 0 where all are equal.
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
from pathlib import Path

from joshua_training.run_folder import RunFolder
from test_ppo_trainer import curve, start

#: Kills that one run survives before it may end.
_OF_A_RUN = 4

SAC = 'algorithm: "SAC" learning_starts: 200 updates_per_step: 1 hidden_sizes: [16]'


def killed(process: subprocess.Popen[str], after_s: float) -> bool:
    """Kills a run after a time; False where it ended before."""
    try:
        process.communicate(timeout=after_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return True
    return False


def resumed(folder: Path, name: str) -> str:
    """What continues the newest run of a name that has a checkpoint; "" for none: it begins anew."""
    runs = sorted((folder / name).glob("*")) if (folder / name).is_dir() else []
    for run in reversed(runs):
        if (run / "run.json").is_file() and RunFolder(run).checkpoints():
            return f'resume_run: "{name}/{run.name}"'
    return ""


def soak(folder: Path, kills: int, seed: int, steps: int, more: str) -> int:
    """Returns how many kills a run did not survive unchanged."""
    begun_s = time.monotonic()
    whole = start(folder, "whole", steps=steps, more=more)
    said, _ = whole.communicate(timeout=600)
    if whole.returncode:
        sys.stderr.write(said)
        return kills
    duration_s = time.monotonic() - begun_s
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
            process = start(folder, name, steps=steps, more=f"{more} {own}")
            if survived < min(_OF_A_RUN, kills - done) and killed(
                process, generator.uniform(0.2, 1.0) * duration_s
            ):
                survived += 1
                continue
            said, _ = process.communicate(timeout=600) if process.returncode is None else ("", "")
            break
        run = sorted(path for path in (folder / name).iterdir() if (path / "run.json").is_file())[-1]
        same = process.returncode == 0 and curve(run) == expected
        last = [max((path / "checkpoints").iterdir()) for path in (run, reference)]
        same = same and all(
            (last[0] / item.name).read_bytes() == item.read_bytes() for item in last[1].iterdir()
        )
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
    parser.add_argument("--algorithm", choices=("PPO", "SAC"), default="PPO")
    arguments = parser.parse_args()
    more = SAC if arguments.algorithm == "SAC" else ""
    with tempfile.TemporaryDirectory(prefix="soak-") as folder:
        wrong = soak(Path(folder), arguments.kills, arguments.seed, arguments.steps, more)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
