"""Node of the trainer: reads the data set, learns on its own thread, writes the run's folder."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from concurrent.futures import Future
from pathlib import Path
from threading import Thread
from typing import Any

from joshua.api import NodeContext
from joshua_jobs.choice import opened
from joshua_training.clusters import on_cluster
from joshua_training.run_folder import LibraryMissing, RunError, refuse_other
from joshua_training.trainer import LearningNode

from joshua_imitation.settings import ImitationSettings


class ImitationTrainer(LearningNode):
    """Trains a policy of LeRobot on recorded episodes, and ends the run when all epochs are done."""

    UNIT = "updates"
    SHOWN = (
        ("loss/train", "loss {:.4g}"),
        ("loss/validation", "validation {:.4g}"),
        ("robot/success_rate", "robot {:.0%}"),
        ("rate/updates_per_s", "{:.3g} updates/s"),
        ("rate/loader_share", "loader {:.0%}"),
        ("workers_lost", "{:.0f} workers lost"),
    )
    FREE = (
        *("num_epochs", "max_steps", "learning_rate", "backbone_learning_rate", "checkpoint_steps"),
        *("report_steps", "validation_steps", "validation_batches", "workers", "threads"),
        *("picture_cache_mb", "output_folder", "resume_run", "environment", "environment_id", "dataset"),
        *("machine_rank", "main_address", "robot_evaluation_steps", "robot_episodes", "robot_wait_s"),
    )

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._settings = ImitationSettings.model_validate(context.spec.settings)
        self._album: Any = None
        self._learner: Any = None
        self._group: Any = None
        self._crew: Any = None
        self._executor: Any = None
        self._lost = 0
        self._continued: Path | None = None
        self._robot: Any = None
        self._owes_round = False

    def configure(self) -> None:
        """Make or open the run, and make the policy."""
        os.environ.setdefault("TOKENIZERS_PARALLELISM", "false")
        settings = self._settings
        try:
            import tensorboard  # noqa: F401
            import torch

            from joshua_imitation.build import build, is_emulated
            from joshua_imitation.group import Group
        except ImportError as error:
            raise LibraryMissing(
                f"imitation learning requires {error.name}, which is not installed for the interpreter of "
                "this run: make an environment that has it, tools/policies.sh policies (1 to 9 GB), and run "
                "policies/bin/joshua"
            ) from error
        cores = max(1, len(os.sched_getaffinity(0)) // settings.processes)
        torch.set_num_threads(settings.threads or cores)
        facts: dict[str, Any] = {
            "method": "METHOD_IMITATION",
            "policy": settings.policy_type,
            "dataset": settings.dataset,
            "seed": settings.seed,
            "settings": settings.model_dump(mode="json", exclude={"output_folder", "resume_run", "tracking"}),
        }
        if settings.cluster:  # its workers are the processes, whose number changes what is learnt
            facts["settings"]["processes"] = settings.size
        self.checkpoint_steps = settings.checkpoint_steps
        continued = self.reopen(settings.resume_run, facts)
        if settings.cluster:
            with on_cluster():
                self._executor = opened(("ray", settings.cluster), settings.cluster_workers)
        made = build(settings, continued, Group(settings.size) if settings.cluster else None)
        self._album, self._group, self._continued = made.album, made.group, continued
        self.halves = settings.halves(made.group.device)
        if continued is None:
            self.begin(settings.output_folder, settings.policy_type, facts | {"features": made.features})
        else:
            refuse_other(self.folder.facts(), {"features": made.features}, ())
        if is_emulated(settings, made.group.device):
            self.warn(
                "this processor has no instructions for bfloat16, and emulates it in ten times the time, or "
                "more: remove precision"
            )
        self._learner = made.learner(self.folder)
        if continued is not None:
            self._learner.restore(continued)
            self.continue_after(continued)
        if settings.cluster:
            self._follow_workers()
        if settings.is_on_robot:
            from joshua_imitation.robot import RobotRounds

            self._robot = RobotRounds(self.context, settings, self.folder, self.warn)
            self._owes_round = self._robot.is_due(self.steps)  # a stop has interrupted it
        self.context.log.info(
            "%s: training %d weights on %d frames of %d episodes; %d episodes are for validation",
            *(settings.policy_type, made.weights, made.frames, made.learned, made.kept_back),
        )

    def _follow_workers(self) -> None:
        """Let the workers of the cluster learn, from the checkpoint that was restored here to check it."""
        from joshua_imitation.spread import SpreadLearner

        self._album.close()
        with on_cluster():
            self._learner = SpreadLearner(
                *(self._executor, self._settings, self.folder, self.steps, self.total, self.rewind)
            )

    def release(self) -> None:
        """End the loader and the other processes, and remove the decoded pictures."""
        for part in (self._learner, self._group, self._crew, self._album, self._executor):
            if part is not None:
                part.close()

    @property
    def steps(self) -> int:
        """Updates so far."""
        return int(self._learner.steps)

    @property
    def total(self) -> int:
        """Updates of the whole training."""
        return int(self._learner.total)

    def prepare(self) -> bool:
        """Decode the pictures, and meet the other processes."""
        if self._settings.cluster:
            self.context.log.info(
                "waiting for %d workers of the cluster %s", self._group.size, self._settings.cluster
            )
            return True
        self._group.take_gpu()
        if not self._album.fill(_Told(self.context, self._album.frames)):
            return False
        if self._group.size > 1:
            from joshua_imitation.group import Crew

            self._crew = Crew(
                self._settings, self._group, self.folder.path, self._album.shared, self._continued
            )
            return self._joined()
        return self._robot is None or bool(self._robot.try_out(self.save()))

    def _joined(self) -> bool:
        """Wait for the other processes; return False if the run stops."""
        met: Future[None] = Future()

        def join() -> None:
            try:
                self._group.join()
                self._learner.begin()
                met.set_result(None)
            except Exception as error:  # noqa: BLE001 (raised again on the thread of the learner)
                met.set_exception(error)

        self.context.log.info("waiting for %d processes at %s", self._group.size, self._group.address)
        Thread(target=join, name="join", daemon=True).start()
        while not met.done():
            if self.context.stopping:
                return False
            if failure := self._crew.failure():
                raise RunError(failure)
            time.sleep(0.1)
        met.result()
        self.context.log.info("%d processes learn together", self._group.size)
        return True

    @property
    def is_asked_to_stop(self) -> bool:
        """Whether to stop: several processes stop after the same update."""
        stopping = self.context.stopping
        if self._group.size == 1 and not self._settings.cluster:
            return stopping
        self._learner.stops = stopping
        return bool(self._learner.stopped)

    def advance(self) -> Mapping[str, float] | None:
        """Make one update, or follow those of a cluster."""
        if self._settings.cluster:
            return self._followed()
        from joshua_imitation.group import PARTING_S, OthersError

        row: Mapping[str, float] | None = None
        try:
            if not self._owes_round:
                row = self._learner.update()
        except OthersError as error:
            raise RunError(self._crew.failure(PARTING_S) or str(error)) from error
        self._owes_round = False
        self.context.progress("training", float(self.steps), float(self.total), unit=self.UNIT)
        if self._robot is not None and self._robot.is_due(self.steps):
            began_s = time.perf_counter()
            found = self._robot.play(self.steps, self.save(), self.total)
            self._learner.paused(time.perf_counter() - began_s)
            row = {"steps": self.steps, **(row or {}), **found} if found else row
        return row

    def _followed(self) -> Mapping[str, float] | None:
        """Wait a moment for the workers; those that were lost are counted."""
        learner, before, learned = self._learner, self._learner.checkpoint, self._learner.learns
        row = learner.update()
        if learner.learns and not learned:
            self.context.log.info("%d workers learn together", self._group.size)
        if learner.lost > self._lost:
            self.context.log.warning(
                "workers lost: %d; all begin again from the last checkpoint", learner.lost - self._lost
            )
            self._lost = learner.lost
            self.context.show(self._shown({"workers_lost": float(self._lost)}))
        if learner.checkpoint != before:
            self.context.log.info("checkpoint %s", learner.checkpoint)
        self.context.progress("training", float(self.steps), float(self.total), unit=self.UNIT)
        return None if row is None else {**row, "workers_lost": float(self._lost)}

    def _save(self) -> None:
        """Save, unless the workers of a cluster do."""
        if not self._settings.cluster:
            super()._save()

    def save(self) -> Path:
        """Write a checkpoint in LeRobot's format."""
        return Path(self._learner.save())

    def result(self) -> str:
        """Return where the policy is."""
        return f"the policy is in {self.folder.checkpoints()[-1] / 'pretrained_model'}"


class _Told:
    """Shows the progress of decoding; false when the run stops."""

    def __init__(self, context: NodeContext, frames: int) -> None:
        self._context, self._frames, self._done = context, frames, 0

    def __call__(self, count: int) -> bool:
        self._done += count
        self._context.progress("decoding", float(self._done), float(self._frames), unit="pictures")
        return not self._context.stopping
