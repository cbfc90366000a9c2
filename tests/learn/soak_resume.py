"""Kills trainings by SIGKILL at random moments, continues them, and compares them with a whole run.

``soak_resume.py [--kills 20] [--seed 0] [--algorithm PPO|SAC|ACT]``; the exit code is 0 where all are equal.
``./test -s learn -- soak`` runs it.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import test_imitation_runs as imitation
import test_ppo_trainer as reinforcement
from killed_trainings import soak
from tiny_recordings import write_recording

SAC = 'algorithm: "SAC" learning_starts: 200 updates_per_step: 1 hidden_sizes: [16]'


def begin_reinforcement(
    folder: Path, steps: int, algorithm: str, name: str, run: Path | None
) -> subprocess.Popen[str]:
    """Starts or continues a training of PPO or SAC."""
    more = f"{SAC if algorithm == 'SAC' else ''} {resume(run)}"
    return reinforcement.start(folder, name, steps=steps, more=more)


def begin_imitation(folder: Path, recording: Path, name: str, run: Path | None) -> subprocess.Popen[str]:
    """Starts or continues a training of ACT."""
    return imitation.start(folder, name, recording, epochs=40, more=resume(run))


def resume(run: Path | None) -> str:
    """The field that continues a run."""
    return f'resume_run: "{run}"' if run is not None else ""


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
            begin = partial(begin_imitation, folder, write_recording(folder / "recording"))
        else:
            begin = partial(begin_reinforcement, folder, arguments.steps, arguments.algorithm)
        wrong = soak(folder, begin, arguments.kills, arguments.seed)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
