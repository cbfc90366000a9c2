"""What became of the trials of a sweep: rows as they come, the order at the end. Without Ray."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from joshua_jobs.executor import JobError

#: States of a trial.
RUNNING, COMPLETE, STOPPED_EARLY, FAILED, INTERRUPTED = (
    *("running", "complete", "stopped early", "failed", "interrupted"),
)


@dataclass(frozen=True)
class Sweep:
    """What all trials share.

    Attributes:
        file: absolute; block: path of the trainer's block in it; fixed: overrides of every trial.
        folder: of the trials; metric, mode: of their metrics; grace, total: steps of a trial before it can be
            stopped, and at its end, 0 if unknown; trials: samples; seed: of the samples; cores: of a trial.
        complete: see ``Rows.lacking``.
    """

    file: str
    block: str
    fixed: tuple[str, ...]
    folder: str
    metric: str
    mode: str
    grace: int
    total: int
    trials: int
    seed: int
    cores: float
    complete: tuple[str, ...]


@dataclass
class Outcome:
    """What became of a trial.

    Attributes:
        fields: its values; value: last of the metric, that of its last checkpoint; run: its folder;
        state: one of those above; lost: how often its worker was lost; error: why it failed.
    """

    trial: str
    fields: dict[str, Any]
    value: float | None = None
    steps: int = 0
    state: str = RUNNING
    run: str = ""
    lost: int = 0
    error: str = ""


@dataclass
class Record:
    """The trials of a sweep so far, by their number."""

    sweep: Sweep
    outcomes: dict[str, Outcome] = field(default_factory=dict)

    def of(self, trial: str, config: Mapping[str, Any]) -> Outcome:
        """Return the outcome of a trial, which begins if it is new."""
        if trial not in self.outcomes:
            self.outcomes[trial] = Outcome(trial, fields(config))
        return self.outcomes[trial]

    def add(self, outcome: Outcome, row: Mapping[str, Any]) -> None:
        """Add a row of metrics; one without the metric changes nothing but the end."""
        value = row.get(self.sweep.metric)
        if value is not None:
            outcome.value = float(value)
            outcome.steps = int(row["steps"])
        outcome.run = str(row.get("run") or outcome.run)
        if row.get("ended"):
            outcome.state, outcome.error = str(row["ended"]), str(row.get("error") or "")

    def end(self, outcome: Outcome, error: str = "") -> None:
        """Note that a trial ended; the scheduler stopped one that did not end by itself."""
        if error:
            outcome.state, outcome.error = FAILED, error
        elif outcome.state == RUNNING and 0 < self.sweep.total <= outcome.steps:
            outcome.state = COMPLETE  # stopped after its last row
        elif outcome.state == RUNNING:
            outcome.state = STOPPED_EARLY

    def interrupt(self) -> bool:
        """Note that the trials that still run were interrupted; return whether there are any."""
        running = [outcome for outcome in self.outcomes.values() if outcome.state == RUNNING]
        for outcome in running:
            outcome.state = INTERRUPTED
        return bool(running)

    def ranked(self) -> list[Outcome]:
        """Return the trials from the best to the worst, then those without a result."""
        sign = 1.0 if self.sweep.mode == "min" else -1.0

        def key(outcome: Outcome) -> tuple[bool, float, str]:
            number = outcome.value
            if number is None or not math.isfinite(number) or outcome.state == FAILED:
                return True, 0.0, outcome.trial
            return False, sign * number, outcome.trial

        return sorted(self.outcomes.values(), key=key)

    def best(self) -> Outcome | None:
        """Return the best trial; None if none has a result."""
        first = next(iter(self.ranked()), None)
        if first is None or first.state == FAILED or first.value is None or not math.isfinite(first.value):
            return None
        return first

    def write(self) -> None:
        """Write ``sweep.json`` atomically. Raises JobError."""
        from joshua_training.run_folder import RunError, RunFolder

        trials = [asdict(outcome) for outcome in self.ranked()]
        content = {"format": 1, "sweep": asdict(self.sweep), "trials": trials}
        text = json.dumps(content, indent=2) + "\n"
        try:
            RunFolder(Path(self.sweep.folder)).write("sweep.json", text.encode())
        except RunError as error:
            raise JobError(str(error)) from error


def fields(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return the varied fields of a trial."""
    return {name: value for name, value in config.items() if name != "sweep"}
