"""Node of the trainer: reads the data set, learns on its own thread, writes the run's folder."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

from joshua.api import NodeContext, Trainer
from joshua_training.curves import draw
from joshua_training.run_folder import LibraryMissing, RunError, RunFolder, described, refuse_other

from joshua_imitation.settings import SAVE_S, ImitationSettings

#: Longest time without a heartbeat, during an update on a slow machine.
HANG_S = 1800.0

#: Settings that a continued run may change.
FREE = (
    *(
        "num_epochs",
        "max_steps",
        "learning_rate",
        "backbone_learning_rate",
        "checkpoint_steps",
        "report_steps",
    ),
    *("validation_steps", "validation_batches", "workers", "threads", "picture_cache_mb", "output_folder"),
    *("resume_run", "environment", "dataset"),
)


class ImitationTrainer(Trainer):
    """Trains a policy of LeRobot on recorded episodes, and ends the run when all epochs are done."""

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._settings = ImitationSettings.model_validate(context.spec.settings)
        self._ended = threading.Event()
        self._ended.set()
        self._folder: RunFolder | None = None
        self._album: Any = None
        self._learner: Any = None
        self._saved = -1

    def configure(self) -> None:
        """Make or open the run, and make the policy."""
        os.environ.setdefault("TOKENIZERS_PARALLELISM", "false")
        settings = self._settings
        try:
            import torch
            from torch.utils import tensorboard  # noqa: F401

            from joshua_imitation.build import build
        except ImportError as error:
            raise LibraryMissing(
                f"imitation learning requires {error.name}, which is not installed for the interpreter of "
                "this run: make an environment that has it, tools/policies.sh policies (1 to 9 GB), and run "
                "policies/bin/joshua"
            ) from error
        torch.set_num_threads(settings.threads or len(os.sched_getaffinity(0)))
        facts = {
            "method": "METHOD_IMITATION",
            "policy": settings.policy_type,
            "dataset": settings.dataset,
            "seed": settings.seed,
            "settings": settings.model_dump(mode="json", exclude={"output_folder", "resume_run"}),
        }
        continued: Path | None = None
        if settings.resume_run:
            self._folder = RunFolder.open(Path(settings.resume_run))
            refuse_other(self._folder.facts(), facts, FREE)
            whole = self._folder.checkpoints()
            if not whole:
                raise RunError(f"{self._folder.path} has no checkpoint to continue from: start a new run")
            continued = whole[-1]
        made = build(settings, continued)
        facts["features"] = made.features
        if self._folder is None:
            about = {**facts, **described(Path(self.facts.folder or "."))}
            self._folder = RunFolder.create(Path(settings.output_folder), settings.policy_type, about)
        else:
            refuse_other(self._folder.facts(), {"features": made.features}, ())
        self._album = made.album
        self._learner = made.learner(self._folder)
        if continued is not None:
            self._learner.restore(continued)
            self._saved = self._learner.steps
            self._folder.cut_metrics(self._learner.steps)
            self.context.log.info("continuing after %d updates from %s", self._learner.steps, continued)
        self.context.log.info(
            "%s: %d weights learn from %d frames of %d episodes; %d episodes are kept back",
            *(settings.policy_type, made.weights, made.frames, made.learned, made.kept_back),
        )

    def activate(self) -> None:
        """Start learning."""
        assert self._folder is not None
        self.context.log.info("this run is in %s", self._folder.path)
        self._ended.clear()
        self.context.spawn_thread(self._learn, name="learner", hang_after_s=HANG_S)

    def deactivate(self) -> None:
        """Wait for the last checkpoint."""
        if not self._ended.wait(SAVE_S):
            self.context.log.warning(
                "the learner did not stop within %g s; its last checkpoint is complete", SAVE_S
            )

    def cleanup(self) -> None:
        """Remove the decoded pictures."""
        album, self._album = self._album, None
        if album is not None and self._ended.is_set():
            album.close()

    def _learn(self) -> None:
        folder, learner, album = self._folder, self._learner, self._album
        assert folder is not None
        board: Any = None
        try:
            if not album.fill(_Told(self.context, album.frames)):
                return
            from torch.utils.tensorboard import SummaryWriter

            board = SummaryWriter(str(folder.path / "tensorboard"), purge_step=learner.steps or None)
            row: dict[str, float] = {}
            while learner.steps < learner.total and not self.context.stopping:
                new = learner.update()
                self.context.progress("training", float(learner.steps), float(learner.total), unit="updates")
                if new is not None:
                    row = row | new
                    self._report(new, board)
                    self.context.show(_shown(row))
                if learner.steps - max(self._saved, 0) >= self._settings.checkpoint_steps:
                    self._save()
            self._save()
            picture = draw(folder)
            if learner.steps >= learner.total:
                drawn = f", its curves in {picture}" if picture is not None else ""
                self.context.end_run(
                    f"{learner.steps} updates learned: {_shown(row)}; the policy is in "
                    f"{folder.checkpoints()[-1] / 'pretrained_model'}{drawn}"
                )
        except OSError as error:
            raise RunError(
                f"{folder.path} cannot be written: {error.strerror or error}: free some space, and continue "
                "with resume_run"
            ) from error
        except RunError:
            self._save_if_possible()  # the state from before the failure
            raise
        finally:
            if board is not None:
                board.close()
            learner.close()
            self._ended.set()

    def _report(self, row: dict[str, float], board: Any) -> None:
        assert self._folder is not None
        self._folder.add_metrics(row)
        for name, value in row.items():
            if "/" in name:
                board.add_scalar(name, value, self._learner.steps)

    def _save(self) -> None:
        learner = self._learner
        if learner.steps == self._saved:
            return
        path = learner.save()
        self._saved = learner.steps
        self.context.log.info("checkpoint %s", path)

    def _save_if_possible(self) -> None:
        try:
            self._save()
        except RunError as error:
            self.context.log.error("%s", error)


class _Told:
    """Shows the progress of decoding; false when the run stops."""

    def __init__(self, context: NodeContext, frames: int) -> None:
        self._context, self._frames, self._done = context, frames, 0

    def __call__(self, count: int) -> bool:
        self._done += count
        self._context.progress("decoding", float(self._done), float(self._frames), unit="pictures")
        return not self._context.stopping


def _shown(row: dict[str, float]) -> str:
    """Format the figures of an update for the status line."""
    names = (
        ("loss/train", "loss {:.4g}"),
        ("loss/validation", "validation {:.4g}"),
        ("rate/updates_per_s", "{:.3g} updates/s"),
        ("rate/loader_share", "loader {:.0%}"),
    )
    return ", ".join(form.format(row[key]) for key, form in names if key in row)
