"""Kills trainings on MuJoCo XLA by SIGKILL, continues them, and compares them with a whole run.

``soak_mjx.py [--kills 20] [--seed 0]``; the exit code is 0 where all are equal. ``./test -s mjx -- soak``
runs it. Each kill comes after a further checkpoint of the process: most of a start is compilation.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from joshua.testing.domain import reserved_domain
from killed_trainings import soak
from mjx_trainings import start


def main() -> int:
    """Runs the soak."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="soak-") as folder, reserved_domain() as domain:

        def begin(name: str, run: Path | None) -> subprocess.Popen[str]:
            own = [f'resume_run="{run}"'] if run is not None else []
            return start(Path(folder) / name, domain, "total_timesteps=960", *own)

        wrong = soak(Path(folder), begin, arguments.kills, arguments.seed)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
