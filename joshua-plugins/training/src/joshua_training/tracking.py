"""Further records of a training: the metrics that go to Weights & Biases and MLflow.

Metrics are sent on a thread of their own. A lost server costs rows there, never the training, and every row
stays in ``metrics.jsonl``.
"""

from __future__ import annotations

import json
import math
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping, Sequence
from logging import Logger, LoggerAdapter
from pathlib import Path
from typing import Any, ClassVar

from joshua.tools import parse_json

from joshua_training.run_folder import RunError, RunFolder
from joshua_training.tracking_settings import TrackingSettings

#: File in the folder of a run with the identity of the run at each service, for a continued run.
IDENTITIES = "tracking.json"

#: Rows kept while a service does not reply, and most rows of one message.
KEPT_ROWS, SENT_ROWS = 20_000, 100

#: Wait before a row is sent once more, at first and at most, and for the last rows at the end of a run.
RETRY_S, LONGEST_RETRY_S, CLOSE_S = 1.0, 60.0, 6.0

Log = Logger | LoggerAdapter[Any]
Row = Mapping[str, float]


class Service(ABC):
    """A record of a run elsewhere.

    Attributes:
        sent: steps of the newest row there, known after ``start``; -1 if there is none, or if the service
            ignores repeated rows by itself. sent_names: what this row has.
    """

    NAME: ClassVar[str]

    sent = -1
    sent_names: frozenset[str] = frozenset()

    @abstractmethod
    def start(self, folder: RunFolder, identity: str) -> str:
        """Start the record of a run, or continue it; return its identity.

        Args:
            folder: of the run; identity: that of the run when it was started, "" for a new one.

        Raises:
            RunError: the service does not reply or refuses.
        """

    @abstractmethod
    def send(self, rows: Sequence[tuple[int, Row]]) -> None:
        """Send rows of metrics with their steps. May raise anything, and is then called again."""

    @abstractmethod
    def finish(self, succeeded: bool) -> None:
        """End the record. May raise anything."""

    def place(self) -> str:
        """Return where to look at the run, for the log."""
        return ""


class Trackers:
    """Sends the metrics of a run to the services of its file.

    Args:
        services: see ``services_of``; log: for the state of the services.
    """

    def __init__(self, services: Sequence[Service], log: Log) -> None:
        self._log = log
        self._services = tuple(services)
        self._boxes: list[_Outbox] = []

    def start(self, folder: RunFolder) -> None:
        """Start the record of a run at each service. Raises RunError."""
        known = _identities(folder)
        for service in self._services:
            key = service.NAME
            known[key] = service.start(folder, known.get(key, ""))
            folder.write_json(IDENTITIES, known)
            self._log.info("%s records this run%s", key, f": {place}" if (place := service.place()) else "")
            self._boxes.append(_Outbox(service, self._log))

    def add(self, row: Row, steps: int) -> None:
        """Add a row of metrics; those whose names have a group are sent, as in ``loss/train``.

        A row that is computed again is not sent again.
        """
        values = {k: float(v) for k, v in row.items() if "/" in k and math.isfinite(v)}
        if values:
            for box in self._boxes:
                box.add(steps, values)

    def close(self, succeeded: bool) -> None:
        """Send what is left, for a few seconds at most. Idempotent."""
        boxes, self._boxes = self._boxes, []
        for box in boxes:
            box.end(succeeded)
        end_s = time.monotonic() + CLOSE_S
        for box in boxes:
            box.wait(max(0.0, end_s - time.monotonic()))


def services_of(settings: TrackingSettings, runs: Path) -> list[Service]:
    """Return the services of a file; ``runs`` is the folder of the runs."""
    found: list[Service] = []
    if settings.wandb is not None:
        from joshua_training.wandb_service import WandbService

        found.append(WandbService(settings.wandb))
    if settings.mlflow is not None:
        from joshua_training.mlflow_service import MlflowService

        found.append(MlflowService(settings.mlflow, runs))
    return found


class _Outbox:
    """The thread of one service: sends rows in order, and again if the service does not reply."""

    def __init__(self, service: Service, log: Log) -> None:
        self._service, self._log = service, log
        self._rows: deque[tuple[int, Row]] = deque()
        self._newest, self._names = service.sent, set(service.sent_names)
        self._news = threading.Condition()
        self._ending: bool | None = None
        self._lost = 0
        self._silent = False
        self._thread = threading.Thread(target=self._run, name=f"{service.NAME} rows", daemon=True)
        self._thread.start()

    def add(self, steps: int, row: Row) -> None:
        if steps == self._newest:  # such as the round on the robot that a continued run still owes
            row = {name: value for name, value in row.items() if name not in self._names}
        if steps < self._newest or not row:
            return
        self._names = {*row, *(self._names if steps == self._newest else ())}
        self._newest = steps
        with self._news:
            if len(self._rows) >= KEPT_ROWS:
                self._rows.popleft()
                self._lost += 1
            self._rows.append((steps, row))
            self._news.notify()

    def end(self, succeeded: bool) -> None:
        with self._news:
            self._ending = succeeded
            self._news.notify()

    def wait(self, timeout_s: float) -> None:
        self._thread.join(timeout_s)
        missing = self._lost + len(self._rows)
        if missing:
            self._log.warning(
                "%s did not get %d rows of metrics; metrics.jsonl has all of them",
                self._service.NAME,
                missing,
            )
        elif self._thread.is_alive():
            self._log.warning("%s did not confirm the end of the run", self._service.NAME)

    def _run(self) -> None:
        delay_s = RETRY_S
        while True:
            with self._news:
                self._news.wait_for(lambda: self._rows or self._ending is not None)
                batch = [self._rows[k] for k in range(min(SENT_ROWS, len(self._rows)))]
            if not batch:
                break
            try:
                self._service.send(batch)
            except Exception as error:  # noqa: BLE001 (of any library; nothing may stop a training)
                self._tell_lost(error)
                with self._news:
                    self._news.wait_for(lambda: self._ending is not None, delay_s)
                    if self._ending is not None:
                        time.sleep(RETRY_S / 4)  # ``wait`` bounds the whole
                delay_s = min(2 * delay_s, LONGEST_RETRY_S)
                continue
            delay_s = RETRY_S
            with self._news:
                for sent in batch:
                    if self._rows and self._rows[0] is sent:  # a full box drops its oldest rows
                        self._rows.popleft()
            if self._silent:
                self._silent = False
                self._log.info("%s replies again", self._service.NAME)
        try:
            self._service.finish(bool(self._ending))
        except Exception as error:  # noqa: BLE001 (as above)
            self._log.warning("%s did not take the end of the run: %s", self._service.NAME, _said(error))

    def _tell_lost(self, error: Exception) -> None:
        if not self._silent:
            self._silent = True
            name, said = self._service.NAME, _said(error)
            self._log.warning("%s does not take metrics; the training goes on: %s", name, said)


def _identities(folder: RunFolder) -> dict[str, str]:
    try:
        found = parse_json((folder.path / IDENTITIES).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return {str(k): str(v) for k, v in found.items()} if isinstance(found, dict) else {}


def facts_of(folder: RunFolder) -> dict[str, str]:
    """Return the settings and facts of ``run.json`` as texts by name, for a service."""
    facts = folder.facts()
    flat = {key: value for key, value in facts.items() if not isinstance(value, Mapping)}
    for group in ("settings", "versions", "git"):
        entries = facts.get(group)
        if isinstance(entries, Mapping):
            prefix = "" if group == "settings" else f"{group}."
            flat |= {f"{prefix}{key}": value for key, value in entries.items()}
    return {key: value if isinstance(value, str) else json.dumps(value) for key, value in flat.items()}


def refused(name: str, error: Exception, remedy: str) -> RunError:
    """Return the error for a service that cannot be used."""
    return RunError(f"{name} cannot record this run: {_said(error)}: {remedy}")


def _said(error: Exception) -> str:
    return str(error).strip().partition("\n")[0][:200]
