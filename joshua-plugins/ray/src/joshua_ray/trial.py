"""A trial of a sweep: one run of ``joshua`` in a worker, whose metrics go to Ray Tune.

Imports Ray Tune. Only ``joshua sweep`` and its workers load this module.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from joshua.api.files import safe_name
from ray.tune import Trainable

from joshua_ray.locks import free_domain, wait_for
from joshua_ray.outcomes import COMPLETE, FAILED, fields
from joshua_ray.rows import Rows
from joshua_ray.spaces import as_text

#: How often metrics are read.
POLL_S = 0.1

#: How long a step waits for metrics, which is how long a stop waits for the step.
STEP_S = 1.0

#: How long a run that is stopped early may take for its last checkpoint.
STOP_S = 90.0

_LAST_LINES = 12


class Trial(Trainable):  # type: ignore[misc,unused-ignore]
    """One run of a file. ``config`` holds the varied fields, and under ``sweep`` what all trials share."""

    def setup(self, config: dict[str, Any]) -> None:
        """Start the run; continue it if a lost worker left a checkpoint."""
        sweep = config["sweep"]
        self._metric: str = sweep["metric"]
        self._complete: Sequence[str] = sweep["complete"]
        folder = Path(sweep["folder"]) / number(self.trial_id)
        self._runs = folder / "runs"
        self._runs.mkdir(parents=True, exist_ok=True)
        self._rows = Rows()
        overrides = [*sweep["fixed"], *(f"{name}={as_text(value)}" for name, value in fields(config).items())]
        overrides.append(f'{sweep["block"]}.output_folder="{self._runs}"')
        self._lock = folder / ".lock"
        with self._lock.open("w") as lock:
            wait_for(lock, STOP_S)  # until the run of a lost worker has ended
            self._known = set(self._runs.iterdir())
            resumed = [path for path in sorted(self._known) if any((path / "checkpoints").glob("step_*"))]
            if resumed:
                overrides.append(f'{sweep["block"]}.resume_run="{resumed[-1]}"')
                self._known -= {resumed[-1]}
            command = [sys.executable, "-m", "joshua_ray.child", str(os.getpid()), "--config", sweep["file"]]
            for override in overrides:
                command += ["--set", override]
            self._log = folder / "output.log"
            domain, taken = free_domain()
            with self._log.open("ab") as log, taken:
                self._process = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=log,
                    env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
                    pass_fds=[lock.fileno(), taken.fileno()],
                    start_new_session=True,  # Ctrl-C in a terminal is for the sweep, which stops its trials
                )

    def step(self) -> dict[str, Any]:
        """Return the next row of metrics, or an empty one if there is none for a while."""
        until_s = time.monotonic() + STEP_S
        while True:
            code = self._process.poll()
            row = self._next_row()
            if row is not None:
                return row
            if code is not None:
                return self._last_row(code)
            if time.monotonic() >= until_s:
                return {"run": self._run()}
            time.sleep(POLL_S)

    def cleanup(self) -> None:
        """Stop the run, which saves a checkpoint."""
        if self._process.poll() is None:
            self._process.terminate()
            self._process.wait()
            with self._lock.open("w") as lock, contextlib.suppress(BlockingIOError):
                wait_for(lock, STOP_S)

    def _last_row(self, code: int) -> dict[str, Any]:
        """Return the end of the run. Raises RuntimeError if it was killed with its node; Tune tries again."""
        if code < 0:
            raise RuntimeError(f"the process of the run was killed by signal {-code}")
        why = f"it ended with exit code {code}" if code else self._rows.lacking(self._metric)
        return self._failed(why) if why else {"run": self._run(), "ended": COMPLETE, "done": True}

    def _failed(self, why: str) -> dict[str, Any]:
        """Return the end of a run that failed, with the end of its log."""
        lines = self._log.read_text(encoding="utf-8", errors="replace").splitlines()[-_LAST_LINES:]
        said = "\n".join((f"{why} ({self._log})", *lines))
        return {"run": self._run(), "ended": FAILED, "error": said, "done": True}

    def _run(self) -> str:
        """Return the folder of the run, "" before it has one."""
        made = sorted(set(self._runs.iterdir()) - self._known)
        return str(made[-1]) if made else ""

    def _next_row(self) -> dict[str, Any] | None:
        """Return the next row that has the metric, or the end if none will have it; None if there is none."""
        run = self._run()
        if not run:
            return None
        while (row := self._rows.next(Path(run, "metrics.jsonl"))) is not None:
            value = row.get(self._metric)
            if isinstance(value, (int, float)):
                return {self._metric: float(value), "steps": int(row["steps"]), "run": run}
            if why := self._rows.lacking(self._metric, self._complete):
                return self._failed(why)
        return None


def number(trial_id: str) -> str:
    """Return the number of a trial, which is the end of its id and the name of its folder.

    Raises:
        UnsafePathError: it cannot be a part of a path.
    """
    return safe_name(trial_id.rpartition("_")[2], "the number of the trial")
