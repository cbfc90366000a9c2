"""Node of the trainer: reads the data set, learns on its own thread, writes the run's folder."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from joshua.api import NodeContext
from joshua_training.run_folder import LibraryMissing, refuse_other
from joshua_training.trainer import LearningNode

from joshua_imitation.settings import SAVE_S, ImitationSettings


class ImitationTrainer(LearningNode):
    """Trains a policy of LeRobot on recorded episodes, and ends the run when all epochs are done."""

    UNIT = "updates"
    SAVE_S = SAVE_S
    SHOWN = (
        ("loss/train", "loss {:.4g}"),
        ("loss/validation", "validation {:.4g}"),
        ("rate/updates_per_s", "{:.3g} updates/s"),
        ("rate/loader_share", "loader {:.0%}"),
    )
    FREE = (
        *("num_epochs", "max_steps", "learning_rate", "backbone_learning_rate", "checkpoint_steps"),
        *("report_steps", "validation_steps", "validation_batches", "workers", "threads"),
        *("picture_cache_mb", "output_folder", "resume_run", "environment", "environment_id", "dataset"),
    )

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._settings = ImitationSettings.model_validate(context.spec.settings)
        self._album: Any = None
        self._learner: Any = None

    def configure(self) -> None:
        """Make or open the run, and make the policy."""
        os.environ.setdefault("TOKENIZERS_PARALLELISM", "false")
        settings = self._settings
        try:
            import tensorboard  # noqa: F401
            import torch

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
            "settings": settings.model_dump(mode="json", exclude={"output_folder", "resume_run", "tracking"}),
        }
        self.checkpoint_steps = settings.checkpoint_steps
        continued = self.reopen(settings.resume_run, facts)
        made = build(settings, continued)
        self._album = made.album
        if continued is None:
            self.begin(settings.output_folder, settings.policy_type, facts | {"features": made.features})
        else:
            refuse_other(self.folder.facts(), {"features": made.features}, ())
        self._learner = made.learner(self.folder)
        if continued is not None:
            self._learner.restore(continued)
            self.continue_after(continued)
        self.context.log.info(
            "%s: training %d weights on %d frames of %d episodes; %d episodes are for validation",
            *(settings.policy_type, made.weights, made.frames, made.learned, made.kept_back),
        )

    def release(self) -> None:
        """End the loader, and remove the decoded pictures."""
        for part in (self._learner, self._album):
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
        """Decode the pictures."""
        return bool(self._album.fill(_Told(self.context, self._album.frames)))

    def advance(self) -> Mapping[str, float] | None:
        """Make one update."""
        row: Mapping[str, float] | None = self._learner.update()
        self.context.progress("training", float(self.steps), float(self.total), unit=self.UNIT)
        return row

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
