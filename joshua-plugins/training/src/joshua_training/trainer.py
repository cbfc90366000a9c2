"""Base classes of the nodes of trainings and evaluations: thread, run folder, metrics, checkpoints."""

from __future__ import annotations

import logging
import threading
from abc import abstractmethod
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, ClassVar

from joshua.api import NodeContext, Trainer
from joshua_jobs.executor import JobError

from joshua_training.board import Board
from joshua_training.clusters import on_cluster
from joshua_training.curves import draw
from joshua_training.memory import is_out_of_memory, remedied
from joshua_training.run_folder import RunError, RunFolder, described, refuse_other, unwritable
from joshua_training.run_log import RunLog
from joshua_training.settings import SAVE_S
from joshua_training.tracking import CLOSE_S, Trackers, services_of
from joshua_training.tracking_settings import TrackingSettings

#: Beginning of the copy of the configuration.
CONFIGURATION = """\
# The configuration of this run{part}, with the content of included files and the options of --set.
# To {again}, copy it to the folder of its paths, {place}.

"""


class RunNode(Trainer):
    """A node that works on a thread of its own, in the folder of a run, until it ends the run.

    ``configure`` calls ``begin``, which creates the folder. ``deactivate`` waits for the thread.
    """

    #: Name of the thread; what is in the folder, for the log; what a late stop costs.
    THREAD: ClassVar[str] = "learner"
    CONTENT: ClassVar[str] = "run"
    LATE: ClassVar[str] = "its last checkpoint is complete"

    #: Longest time without a heartbeat, during an update on a slow machine.
    HANG_S: ClassVar[float] = 1800.0

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._ended = threading.Event()
        self._ended.set()
        self._folder: RunFolder | None = None
        self._run_log = RunLog(context.log)

    @property
    def folder(self) -> RunFolder:
        """Folder of the run, after ``begin``."""
        assert self._folder is not None
        return self._folder

    @abstractmethod
    def work(self) -> None:
        """Do the work, on its thread: poll ``context.stopping``, and call ``end_run`` at the end."""

    def begin(self, parent: str, name: str, facts: Mapping[str, Any]) -> None:
        """Create the folder of a new run, with the configuration, versions and git state. Raises RunError."""
        self._folder = RunFolder.create(Path(parent), name, {**facts, **described(self._place)})
        self._folder.lock()
        self.keep_configuration("config.pbtxt")
        self._run_log.open(self._folder)

    def keep_configuration(self, name: str, part: str = "") -> None:
        """Write the configuration of the run, or of a part of it, to its folder. Raises RunError."""
        again = "continue the run from its last checkpoint" if part else "run it again"
        head = CONFIGURATION.format(part=part, again=again, place=self._place)
        self.folder.write(name, (head + self.facts.configuration).encode())

    @property
    def _place(self) -> Path:
        """Folder of the paths in the configuration."""
        return Path(self.facts.folder or ".").absolute()

    def warn(self, text: str) -> None:
        """Report a warning of the run, on any thread."""
        self._run_log.note(logging.WARNING, text)
        self.context.warn(text)

    def end_run(self, reason: str) -> None:
        """End the run, because its work is done."""
        self._run_log.note(logging.INFO, reason)
        self.context.end_run(reason)

    def activate(self) -> None:
        """Start the work."""
        self.context.log.info("this %s is in %s", self.CONTENT, self.folder.path)
        self._ended.clear()
        self.context.spawn_thread(self._work, name=self.THREAD, hang_after_s=self.HANG_S)

    def deactivate(self) -> None:
        """Wait for the last files, and for the services that record the run."""
        limit_s = SAVE_S + CLOSE_S
        if not self._ended.wait(limit_s):
            self.context.log.warning("the %s did not stop within %g s: %s", self.THREAD, limit_s, self.LATE)

    def cleanup(self) -> None:
        """Release what the work used, unless it still uses it."""
        if self._ended.is_set():
            self.release()
            if self._folder is not None:
                self._folder.unlock()
            self._run_log.close()

    def release(self) -> None:
        """Close environments, files and the like."""

    def _work(self) -> None:
        try:
            self.work()
        except Exception as error:
            if hasattr(error, "exit_code"):
                self._run_log.note(logging.ERROR, str(error))
            else:  # a defect, whose place is worth more than its message
                self._run_log.note(logging.ERROR, f"{type(error).__name__}: {error}", error)
            raise
        finally:
            self._ended.set()


class LearningNode(RunNode):
    """A node that learns in steps, with metrics, checkpoints, and runs that can be continued.

    ``configure`` calls ``reopen`` first, and then ``begin``, or ``continue_after`` if there is a run to
    continue.
    """

    #: Unit of the steps.
    UNIT: ClassVar[str] = "steps"

    #: Metrics of the status line: name and format.
    SHOWN: ClassVar[tuple[tuple[str, str], ...]] = ()

    #: Settings that a continued run may change.
    FREE: ClassVar[Collection[str]] = ()

    #: Steps from one checkpoint to the next, set in ``configure``.
    checkpoint_steps = 1000

    #: What halves the memory of the training, set in ``configure``.
    halves = "halve batch_size"

    #: Steps of the last checkpoint.
    _saved = -1

    _board: Board | None = None

    @property
    @abstractmethod
    def steps(self) -> int:
        """Complete steps so far, those of the next checkpoint."""

    @property
    @abstractmethod
    def total(self) -> int:
        """Steps of the whole training."""

    @abstractmethod
    def advance(self) -> Mapping[str, float] | None:
        """Learn for a while; return a row of metrics if one is due.

        Raises:
            RunError: learning cannot go on; the state from before is saved.
        """

    @abstractmethod
    def save(self) -> Path:
        """Write a checkpoint of the complete steps, by ``folder.save`` or ``save_by``. Raises RunError."""

    @property
    def is_asked_to_stop(self) -> bool:
        """Whether to stop before the next step."""
        return self.context.stopping

    def prepare(self) -> bool:
        """Do what takes long and precedes the first step; return False if the run stops."""
        return True

    def result(self) -> str:
        """Return where the result is, for the last line of the run."""
        return str(self.folder.path)

    def reopen(self, run: str, facts: Mapping[str, Any]) -> Path | None:
        """Open the run to continue, and return its last checkpoint; None if ``run`` is "".

        Raises:
            RunError: there is none, it has no checkpoint, it was started with other settings, or another
                process continues it.
        """
        if not run:
            return None
        self._folder = RunFolder.open(Path(run))
        refuse_other(self._folder.facts(), facts, self.FREE)
        self._folder.lock()
        self._run_log.open(self._folder)
        whole = self._folder.checkpoints()
        if not whole:
            raise RunError(f"{self._folder.path} has no checkpoint to continue from: start a new run")
        return whole[-1]

    def continue_after(self, checkpoint: Path) -> None:
        """Continue after the steps of a checkpoint, which is restored. Raises RunError."""
        self._saved = self.steps
        self.keep_configuration(f"config_{self.steps}.pbtxt", f" after {self.steps} {self.UNIT}")
        self.rewind(self.steps)
        self.context.log.info("continuing after %d %s from %s", self.steps, self.UNIT, checkpoint)

    def rewind(self, steps: int) -> None:
        """Forget the rows after some steps, which are computed again. Raises RunError and OSError."""
        self.folder.cut_metrics(steps)
        if self._board is not None:
            self._board.rewind(steps)

    def work(self) -> None:
        """Learn to the end, or until the run stops, and save."""
        tracking = TrackingSettings.model_validate(self.context.spec.settings.get("tracking") or {})
        trackers = Trackers(services_of(tracking, self.folder.path.parent), self.context.log)
        trackers.start(self.folder)
        well = False
        try:
            with remedied(self.halves, self.folder), on_cluster(self.folder):
                if self.prepare():
                    self._learn(trackers)
            well = True
        except OSError as error:
            path = Path(error.filename or self.folder.path)
            raise unwritable(path, error, f", and {self.folder.then}") from error
        finally:
            trackers.close(well)

    def _learn(self, trackers: Trackers) -> None:
        self._board = board = Board(self.folder.path / "tensorboard", self.steps)
        latest: dict[str, float] = {}
        try:
            while self.steps < self.total and not self.is_asked_to_stop:
                row = self.advance()
                if row is not None:
                    latest |= row
                    self.folder.add_metrics(row)
                    board.add(row, self.steps)
                    trackers.add(row, self.steps)
                    self.context.show(self._shown(latest))
                if self.steps - max(self._saved, 0) >= self.checkpoint_steps:
                    self._save()
            self._save()
            picture = draw(self.folder)
            if self.steps >= self.total:
                drawn = f", its curves in {picture}" if picture is not None else ""
                shown = f": {self._shown(latest)}" if self._shown(latest) else ""
                self.end_run(f"{self.steps} {self.UNIT} learned{shown}; {self.result()}{drawn}")
            elif not self.context.stopping:
                self.end_run(f"stopped after {self.steps} {self.UNIT}, as another machine asked")
        except Exception as error:
            if isinstance(error, (JobError, RunError)) or is_out_of_memory(error):
                self._save_if_possible()  # the state from before the failure
            raise
        finally:
            board.close()

    def _save(self) -> None:
        if self.steps in (0, self._saved):  # nothing was learned, or nothing new
            return
        self._saved = self.steps  # a checkpoint that cannot be written is not tried again
        path = self.save()
        self.context.log.info("checkpoint %s", path)

    def _save_if_possible(self) -> None:
        try:
            self._save()
        except Exception as error:  # noqa: BLE001 (which must not hide why learning ended)
            self.context.log.error("no checkpoint of the last steps: %s", error)

    def _shown(self, row: Mapping[str, float]) -> str:
        return ", ".join(form.format(row[key]) for key, form in self.SHOWN if key in row)
