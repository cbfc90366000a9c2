"""What a run leaves in its directory for an e-stop: how to reach each device, and what became of it."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from joshua.guardian.latch import write_whole

#: Folder below the directory of a run.
FOLDER_NAME = "estop"


@dataclass(frozen=True)
class EstopReport:
    """What an e-stop has reached at one actuator.

    Attributes:
        latch: identifier of the e-stop.
        by: ``driver``, ``guardian`` or ``command``.
        complete: whether nothing speaks against the torque being off.
        verified: whether the device itself has said so; joints: what it has said of each.
        detail: what stood in the way, "" where nothing did.
    """

    latch: str
    node: str
    by: str
    complete: bool
    verified: bool
    joints: Mapping[str, str] = field(default_factory=dict)
    detail: str = ""


class EstopFiles:
    """The folder of one run.

    Args:
        path: of the folder; "" for a run without directory, of which nothing is written.
    """

    def __init__(self, path: str) -> None:
        self._path = Path(path) if path else None

    def report(self, report: EstopReport) -> None:
        """Leaves a report, in place of an older one of the same actuator; does its best."""
        self._write(report.node, "report", asdict(report))

    def read_report(self, node: str, latch: str) -> EstopReport | None:
        """The report of an actuator about one e-stop; None where there is none yet."""
        values = self._read(node, "report")
        with contextlib.suppress(TypeError):
            report = EstopReport(**values)
            return report if report.latch == latch else None
        return None

    def leave_order(self, node: str, implementation: str, request: Mapping[str, Any]) -> None:
        """Leaves what releases an actuator without its driver; does its best."""
        self._write(node, "order", {"implementation": implementation, "request": request})

    def read_order(self, node: str) -> tuple[str, dict[str, Any]] | None:
        """Import string of the action and its request; None where the driver has left none."""
        values = self._read(node, "order")
        if isinstance(values.get("implementation"), str) and isinstance(values.get("request"), dict):
            return values["implementation"], values["request"]
        return None

    def _write(self, node: str, kind: str, values: Mapping[str, Any]) -> None:
        if self._path is not None:
            with contextlib.suppress(OSError):  # a full disk must not keep anything from stopping
                self._path.mkdir(mode=0o700, exist_ok=True)
                write_whole(self._file(node, kind), values)

    def _read(self, node: str, kind: str) -> dict[str, Any]:
        if self._path is not None:
            with contextlib.suppress(OSError, ValueError):
                values = json.loads(self._file(node, kind).read_text())
                return values if isinstance(values, dict) else {}
        return {}

    def _file(self, node: str, kind: str) -> Path:
        assert self._path is not None
        return self._path / f"{node.strip('/').replace('/', '.')}.{kind}.json"
