"""MLflow: the client of its own library, for a tracking server or a folder."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from joshua_training.run_folder import RunError, RunFolder
from joshua_training.tracking import Row, Service, facts_of, refused
from joshua_training.tracking_settings import MlflowSettings

#: Limits of a message: numbers and parameters, and of the length of a parameter.
_METRICS, _PARAMETERS, _LONGEST = 1000, 100, 500

#: How long a start waits for the server.
START_S = 5.0

_REMEDY = "check the address and the credentials in the environment"


class MlflowService(Service):
    """Records a run at a tracking server, or in a folder."""

    NAME = "MLflow"

    def __init__(self, settings: MlflowSettings, runs: Path) -> None:
        self._experiment = settings.experiment
        self._server = settings.server or os.environ.get("MLFLOW_TRACKING_URI", "")
        if not self._server:
            self._server = str(runs.parent / "mlruns")
        self._client: Any = None
        self._run = ""

    def start(self, folder: RunFolder, identity: str) -> str:
        """See ``Service``."""
        is_remote = "://" in self._server and not self._server.startswith("file:")
        if is_remote:
            _reach(self._server)
        # the thread of the rows tries again by itself
        os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "1")
        os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", "10")
        os.environ.setdefault("MLFLOW_ALLOW_FILE_STORE", "true")
        try:
            from mlflow.entities import Param
            from mlflow.tracking import MlflowClient

            address = (
                self._server if is_remote else Path(self._server.removeprefix("file:")).resolve().as_uri()
            )
            self._client = client = MlflowClient(tracking_uri=address)
            if identity:
                client.update_run(identity, status="RUNNING")
                newest = client.get_run(identity).data.to_proto().metrics
                self.sent = max((metric.step for metric in newest), default=-1)
                self.sent_names = frozenset(item.key for item in newest if item.step == self.sent)
                self._run = identity
                return identity
            known = client.get_experiment_by_name(self._experiment)
            number = known.experiment_id if known else client.create_experiment(self._experiment)
            self._run = str(client.create_run(number, run_name=folder.path.name).info.run_id)
            facts = [Param(key, value[:_LONGEST]) for key, value in facts_of(folder).items()]
            for first in range(0, len(facts), _PARAMETERS):
                client.log_batch(self._run, params=facts[first : first + _PARAMETERS])
        except Exception as error:  # of mlflow and of what it stands on
            raise refused(self.NAME, error, _REMEDY) from error
        return self._run

    def send(self, rows: Sequence[tuple[int, Row]]) -> None:
        """See ``Service``."""
        from mlflow.entities import Metric

        now_ms = int(time.time() * 1000)
        metrics = [Metric(name, value, now_ms, steps) for steps, row in rows for name, value in row.items()]
        for first in range(0, len(metrics), _METRICS):
            self._client.log_batch(self._run, metrics=metrics[first : first + _METRICS])

    def finish(self, succeeded: bool) -> None:
        """See ``Service``."""
        self._client.set_terminated(self._run, status="FINISHED" if succeeded else "FAILED")

    def place(self) -> str:
        """See ``Service``."""
        return f"{self._server}, run {self._run}"


def _reach(server: str) -> None:
    """Connect once, so that a wrong address is said at once. Raises RunError."""
    parts = urlsplit(server)
    if parts.scheme not in ("http", "https") or parts.hostname is None:
        return  # such as databricks, which the library resolves
    port = parts.port or (443 if parts.scheme == "https" else 80)
    try:
        socket.create_connection((parts.hostname, port), START_S).close()
    except OSError as error:
        raise RunError(
            f"MLflow does not reply at {server}: {error.strerror or error}: start it, or correct "
            "ai.training.mlflow.server"
        ) from error
