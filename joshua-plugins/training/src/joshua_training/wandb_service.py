"""Weights & Biases: its own library writes and sends the record of a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from joshua_training.run_folder import RunFolder
from joshua_training.tracking import Row, Service, facts_of, refused
from joshua_training.tracking_settings import WandbSettings

#: How long a start waits for the server.
START_S = 30.0


class WandbService(Service):
    """Records a run at Weights & Biases, or in the folder of the run for ``wandb sync``."""

    NAME = "Weights & Biases"

    def __init__(self, settings: WandbSettings) -> None:
        self._settings = settings
        self._run: Any = None

    def start(self, folder: RunFolder, identity: str) -> str:
        """See ``Service``."""
        import wandb

        settings = self._settings
        try:
            self._run = wandb.init(
                project=settings.project,
                entity=settings.entity or None,
                name=folder.path.name,
                dir=str(folder.path),
                config=facts_of(folder),
                id=identity or None,
                resume="allow" if identity else None,
                mode="offline" if settings.is_offline else "online",
                # nothing goes out but the metrics and the facts of the run
                settings=wandb.Settings(
                    base_url=settings.address,
                    console="off",
                    disable_code=True,
                    disable_git=True,
                    init_timeout=START_S,
                    silent=True,
                    x_disable_meta=True,
                    x_disable_stats=True,
                ),
            )
        except Exception as error:  # wandb's errors and those of its settings have no common base class
            raise refused(self.NAME, error, "check the server and the key, or add offline: true") from error
        return str(self._run.id)

    def send(self, rows: Sequence[tuple[int, Row]]) -> None:
        """See ``Service``; the library sends in the background, and again after a lost connection.

        It ignores steps before the newest one.
        """
        for steps, row in rows:
            self._run.log(dict(row), step=steps)

    def finish(self, succeeded: bool) -> None:
        """See ``Service``."""
        import wandb

        self._run.finish(exit_code=0 if succeeded else 1)
        wandb.teardown()  # waits for the process that writes and sends

    def place(self) -> str:
        """See ``Service``."""
        if self._settings.is_offline:
            return f"{Path(self._run.dir).parent}, for wandb sync"
        return str(self._run.url or "")
