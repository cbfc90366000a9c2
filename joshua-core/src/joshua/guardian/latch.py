"""The e-stop: a latch that keeps torque off, and reports of its effect.

The latch is a file, which is the whole state. Drivers, guardians and commands read it themselves: it works
whichever process is dead, hung or not started. Light to import.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

#: Of the latches below the base directory, and of the reports below the directory of a run.
FOLDER_NAME = "estop"

_SUFFIX = ".json"


@dataclass(frozen=True)
class Latch:
    """One e-stop.

    Attributes:
        identifier: of this e-stop, different for each e-stop of a robot.
        robot: ``general.id`` of the file; source: the file.
        domain_id, nodes: the actuators, by fully qualified name.
        since: local time; process_id: of the program that set it.
    """

    identifier: str
    robot: str
    source: str
    domain_id: int
    nodes: tuple[str, ...]
    since: str
    process_id: int

    def covers(self, subject: Subject) -> bool:
        """Whether an actuator belongs to the stopped robot."""
        if self.robot and self.robot == subject.robot:
            return True
        return self.domain_id == subject.domain_id and subject.node in self.nodes

    @property
    def text(self) -> str:
        """Text for a person, with the remedy."""
        return (
            f"the e-stop of {self.robot or self.source or 'this robot'} is latched since {self.since}: "
            "look at the robot, then joshua estop --release"
        )


@dataclass(frozen=True)
class Subject:
    """An actuator that may be stopped."""

    robot: str
    domain_id: int
    node: str


class LatchFolder:
    """The latches of this user on this machine.

    Args:
        path: of the folder; it need not exist.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._known: dict[str, Latch] = {}

    def standing(self, subject: Subject) -> Latch | None:
        """The newest latch that covers an actuator. Takes microseconds if there is none."""
        return next((latch for latch in self.all() if latch.covers(subject)), None)

    def all(self) -> list[Latch]:
        """Every latch, newest first. A latch that cannot be read covers every actuator."""
        try:
            names = [name for name in os.listdir(self.path) if name.endswith(_SUFFIX)]  # noqa: PTH208 (hot)
        except OSError:
            return []
        if not names:
            return []
        self._known = {name: self._known.get(name) or _read(self.path / name) for name in names}
        return sorted(self._known.values(), key=lambda latch: latch.since, reverse=True)

    def set(self, robot: str, source: str, domain_id: int, nodes: Sequence[str]) -> Latch:
        """Latches the actuators of one robot and replaces its older latch. Raises OSError."""
        latch = Latch(
            identifier=secrets.token_hex(8),
            robot=robot,
            source=source,
            domain_id=domain_id,
            nodes=tuple(nodes),
            since=time.strftime("%Y-%m-%d %H:%M:%S"),
            process_id=os.getpid(),
        )
        older = [item for item in self.all() if _same_robot(item, latch)]
        self.path.mkdir(mode=0o700, exist_ok=True)
        write_whole(self.path / (latch.identifier + _SUFFIX), asdict(latch))
        for item in older:
            self.clear(item)
        return latch

    def clear(self, latch: Latch) -> None:
        """Releases one latch. Idempotent. Raises OSError."""
        (self.path / (latch.identifier + _SUFFIX)).unlink(missing_ok=True)


def _same_robot(older: Latch, newer: Latch) -> bool:
    if (older.robot, older.domain_id) != (newer.robot, newer.domain_id):
        return False
    return set(older.nodes) <= set(newer.nodes)


def _read(path: Path) -> Latch:
    try:
        values = json.loads(path.read_text())
        return Latch(**{**values, "nodes": tuple(values["nodes"])})
    except FileNotFoundError:
        return Latch(path.stem, "", "", -1, (), "", 0)  # just released
    except (OSError, ValueError, TypeError, KeyError):
        return _Unreadable(path.stem, "", str(path), -1, (), "an unknown time", 0)


class _Unreadable(Latch):
    def covers(self, subject: Subject) -> bool:
        del subject
        return True


def write_whole(path: Path, values: Mapping[str, Any]) -> None:
    """Writes a JSON file atomically. Raises OSError."""
    temporary = path.with_suffix(f".{os.getpid()}-{secrets.token_hex(2)}")
    try:
        temporary.write_text(json.dumps(values))
        temporary.chmod(0o600)
        temporary.replace(path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise


@dataclass(frozen=True)
class EstopReport:
    """Effect of an e-stop at one actuator.

    Attributes:
        latch: identifier of the e-stop.
        by: ``driver``, ``guardian`` or ``command``.
        complete: whether the torque is off as far as known.
        verified: whether the device confirmed it; joints: state of each.
        detail: what prevented it, "" for nothing.
    """

    latch: str
    node: str
    by: str
    complete: bool
    verified: bool
    joints: Mapping[str, str] = field(default_factory=dict)
    detail: str = ""


class EstopFiles:
    """Reports and orders of one run. Writing does its best: a full disk must not prevent a stop.

    Args:
        path: of the folder; "" for a run without directory, which writes nothing.
    """

    def __init__(self, path: str) -> None:
        self._path = Path(path) if path else None

    def report(self, report: EstopReport) -> None:
        """Writes a report in place of an older one of the same actuator."""
        self._write(report.node, "report", asdict(report))

    def read_report(self, node: str, latch: str) -> EstopReport | None:
        """Report of an actuator about one e-stop, None if there is none yet."""
        values = self._read(node, "report")
        with contextlib.suppress(TypeError):
            report = EstopReport(**values)
            return report if report.latch == latch else None
        return None

    def leave_order(self, node: str, implementation: str, request: Mapping[str, Any]) -> None:
        """Writes the action that takes the torque off without the driver."""
        self._write(node, "order", {"implementation": implementation, "request": request})

    def read_order(self, node: str) -> tuple[str, dict[str, Any]] | None:
        """Import string of the action and its request, None if the driver wrote none."""
        values = self._read(node, "order")
        if isinstance(values.get("implementation"), str) and isinstance(values.get("request"), dict):
            return values["implementation"], values["request"]
        return None

    def _write(self, node: str, kind: str, values: Mapping[str, Any]) -> None:
        if self._path is not None:
            with contextlib.suppress(OSError):
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
