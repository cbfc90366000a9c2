"""A sweep with Ray Tune: samples, early stopping by ASHA. Imports Ray Tune."""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
import signal
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from joshua_jobs.executor import JobError
from ray import tune
from ray.tune.schedulers import ASHAScheduler
from ray.tune.search import BasicVariantGenerator

from joshua_ray.cluster import Cluster
from joshua_ray.outcomes import Outcome, Record, Sweep
from joshua_ray.spaces import Space
from joshua_ray.trial import Trial, number

#: Losses of its worker that a trial survives.
RETRIES = 3

#: ASHA keeps this share of the trials at each of its rungs: one of so many.
FACTOR = 3


class Watch(tune.Callback):  # type: ignore[misc,unused-ignore]
    """Records the trials.

    Args:
        record: of the sweep; cluster: that runs them; shown: called with each trial that begins or ends.
        stopping: called at Ctrl-C.
    """

    def __init__(
        self,
        record: Record,
        cluster: Cluster,
        shown: Callable[[Outcome], None],
        stopping: Callable[[], None],
    ) -> None:
        self._record, self._shown, self._stopping = record, shown, stopping
        self._patience = cluster.patience(record.sweep.cores)
        self._of_tune: Any = None

    def on_step_begin(self, iteration: int, trials: Any, **info: Any) -> None:
        """See ``Callback``. Raises JobError if all workers are lost."""
        del iteration, trials, info
        if self._of_tune is None:
            self._of_tune = signal.signal(signal.SIGINT, self._interrupt)
        self._patience.check()

    def _interrupt(self, number: int, frame: Any) -> None:
        """Say that the sweep stops, and let Tune stop it, which lets a second Ctrl-C interrupt that."""
        self._stopping()
        self._of_tune(number, frame)

    def on_trial_start(self, iteration: int, trials: Any, trial: Any, **info: Any) -> None:
        """See ``Callback``."""
        del iteration, trials, info
        self._shown(self._of(trial))

    def on_trial_result(self, iteration: int, trials: Any, trial: Any, result: Any, **info: Any) -> None:
        """See ``Callback``."""
        del iteration, trials, info
        self._record.add(self._of(trial), result)

    def on_trial_recover(self, iteration: int, trials: Any, trial: Any, **info: Any) -> None:
        """See ``Callback``."""
        del iteration, trials, info
        self._of(trial).lost += 1

    def on_trial_complete(self, iteration: int, trials: Any, trial: Any, **info: Any) -> None:
        """See ``Callback``."""
        del iteration, trials, info
        self._ended(self._of(trial))

    def on_trial_error(self, iteration: int, trials: Any, trial: Any, **info: Any) -> None:
        """See ``Callback``."""
        del iteration, trials, info
        outcome = self._of(trial)
        error = Path(trial.error_file) if trial.error_file else None
        said = error.read_text(encoding="utf-8", errors="replace") if error and error.is_file() else ""
        self._ended(outcome, said or "its worker was lost")

    def _ended(self, outcome: Outcome, error: str = "") -> None:
        self._record.end(outcome, error)
        self._shown(outcome)
        _note(self._record)

    def _of(self, trial: Any) -> Outcome:
        return self._record.of(number(trial.trial_id), trial.config)


def _note(record: Record) -> None:
    """Write what is known so far; the end of the sweep says why that fails."""
    with contextlib.suppress(JobError):
        record.write()


def run(
    sweep: Sweep,
    spaces: list[Space],
    cluster: Cluster,
    limit: int | None,
    shown: Callable[[Outcome], None],
    stopping: Callable[[], None],
) -> Record:
    """Run the trials on a connected cluster. Ctrl-C ends them early.

    Args:
        limit: of trials at the same time; shown: called with each trial that begins or ends.
        stopping: called at Ctrl-C.

    Raises:
        JobError: all workers are lost.
    """
    record = Record(sweep)
    scratch = Path(sweep.folder) / ".tune"  # of Tune, which writes pickles
    os.environ["TUNE_DISABLE_AUTO_CALLBACK_LOGGERS"] = "1"  # they would repeat the metrics of the runs
    os.environ["TUNE_DISABLE_STRICT_METRIC_CHECKING"] = "1"  # rows without the metric say that a trial lives
    os.environ["RAY_AIR_NEW_OUTPUT"] = "0"  # with ``verbose=0``, the older output prints nothing
    logging.getLogger("ray.tune").setLevel(logging.CRITICAL)  # the record says what became of each trial
    tuner = tune.Tuner(
        tune.with_resources(Trial, {"cpu": sweep.cores}),
        param_space={**{item.field: item.of_tune(tune) for item in spaces}, "sweep": asdict(sweep)},
        tune_config=tune.TuneConfig(
            metric=sweep.metric,
            mode=sweep.mode,
            num_samples=sweep.trials,
            scheduler=ASHAScheduler(
                time_attr="steps",
                max_t=10 * max(sweep.total, FACTOR**3 * sweep.grace),  # a run ends by itself
                grace_period=sweep.grace,
                reduction_factor=FACTOR,
            ),
            search_alg=BasicVariantGenerator(random_state=sweep.seed, max_concurrent=limit or 0),
        ),
        run_config=tune.RunConfig(
            name="trials",
            storage_path=str(scratch),
            checkpoint_config=tune.CheckpointConfig(checkpoint_at_end=False),  # runs have their own
            failure_config=tune.FailureConfig(max_failures=RETRIES),
            callbacks=[Watch(record, cluster, shown, stopping)],
            verbose=0,
        ),
    )
    usual = signal.getsignal(signal.SIGINT)
    try:
        tuner.fit()
    except BaseException:  # Ctrl-C again, too
        record.interrupt()
        raise
    finally:
        signal.signal(signal.SIGINT, usual)
        shutil.rmtree(scratch, ignore_errors=True)
        _note(record)
    return record
