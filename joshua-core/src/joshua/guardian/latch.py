"""The e-stop: a latch that keeps torque off, and reports of its effect.

The latch is a file, which is the whole state. Drivers, guardians and commands read it themselves: it works
whichever process is dead, hung or not started. Nothing that an e-stop needs requires free space: a spare file
is renamed to the latch, and reports overwrite a file of the same size. Light to import.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

#: Of the latches below the base directory, and of the reports below the directory of a run.
FOLDER_NAME = "estop"

_SUFFIX = ".json"

#: The empty file in the folder of the latches that an e-stop renames if it cannot write one.
SPARE_NAME = "spare"

#: Orders and reports fill whole blocks of this size: on a full file system they are overwritten in place.
_BLOCK_BYTES = 4096


def latch_folder(base: Path) -> Path:
    """Folder of the e-stop latches of this user's robots, beside the runs, because a latch outlives a run."""
    return base / FOLDER_NAME


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

    @property
    def has_content(self) -> bool:
        """Whether the latch names its robot. One without content covers every actuator."""
        return True

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
        latch = new_latch(robot, source, domain_id, nodes)
        older = [item for item in self.all() if _same_robot(item, latch)]
        self.path.mkdir(mode=0o700, exist_ok=True)
        write_whole(self._file(latch.identifier), json.dumps(asdict(latch)).encode())
        for item in older:
            with contextlib.suppress(OSError):  # two latches of one robot are no problem
                self.clear(item)
        return latch

    def set_for_all(self) -> Latch:
        """Latches every actuator that looks for latches here. Raises OSError."""
        identifier = new_latch("", "", -1, ()).identifier
        self.path.mkdir(mode=0o700, exist_ok=True)
        write_whole(self._file(identifier), b"")
        return _read(self._file(identifier))

    def set_without_space(self, latch: Latch) -> Latch:
        """Latches actuators by renaming a file, which works on a full file system.

        The file is an older latch of the same actuators, or the spare file. Each e-stop gets an identifier of
        its own, so that drivers obey and report again.

        Args:
            latch: which could not be written.

        Returns:
            The latch as others read it. That of the spare file has no content: it covers every actuator.

        Raises:
            OSError: the file system is read-only, or there is no spare file.
        """
        place = self._file(latch.identifier)
        for older in self.all():
            if not older.has_content or _covers_all(older, latch):
                with contextlib.suppress(FileNotFoundError):  # another command released or renamed it
                    self._file(older.identifier).rename(place)
                    return _read(place)
        spare = self.path / SPARE_NAME
        os.truncate(spare, 0)
        spare.rename(place)
        return _read(place)

    def clear(self, latch: Latch) -> None:
        """Releases one latch, whose file becomes the spare file. Idempotent. Raises OSError."""
        file = self._file(latch.identifier)
        if os.path.exists(file):  # noqa: PTH110 (raises nothing; a read-only file system refuses any rename)
            with contextlib.suppress(FileNotFoundError):  # another command released it
                file.replace(self.path / SPARE_NAME)

    def keep_spare(self) -> None:
        """Creates the spare file. Idempotent. Called before torque is enabled.

        Raises:
            OSError: it cannot be created, so an e-stop might not be possible.
        """
        spare = self.path / SPARE_NAME
        if os.path.exists(spare):  # noqa: PTH110 (raises nothing)
            return
        self.path.mkdir(mode=0o700, exist_ok=True)
        os.close(os.open(spare, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o600))

    def _file(self, identifier: str) -> Path:
        return self.path / (identifier + _SUFFIX)


def new_latch(robot: str, source: str, domain_id: int, nodes: Sequence[str]) -> Latch:
    """An e-stop by this process, which is not set yet."""
    return Latch(
        identifier=os.urandom(8).hex(),
        robot=robot,
        source=source,
        domain_id=domain_id,
        nodes=tuple(nodes),
        since=time.strftime("%Y-%m-%d %H:%M:%S"),
        process_id=os.getpid(),
    )


def latch_of(values: Mapping[str, Any]) -> Latch:
    """Reads the fields of a latch. Raises TypeError and KeyError."""
    return Latch(**{**values, "nodes": tuple(values["nodes"])})


def _same_robot(older: Latch, newer: Latch) -> bool:
    if (older.robot, older.domain_id) != (newer.robot, newer.domain_id):
        return False
    return set(older.nodes) <= set(newer.nodes)


def _covers_all(older: Latch, newer: Latch) -> bool:
    return all(older.covers(Subject(newer.robot, newer.domain_id, node)) for node in newer.nodes)


def _read(path: Path) -> Latch:
    try:
        # The file may have been renamed since it was written.
        return latch_of({**json.loads(path.read_text()), "identifier": path.stem})
    except FileNotFoundError:
        return Latch(path.stem, "", "", -1, (), "", 0)  # just released
    except (OSError, ValueError, TypeError, KeyError):
        return _WithoutContent(path.stem, "", str(path), -1, (), "an unknown time", 0)


class _WithoutContent(Latch):
    @property
    def text(self) -> str:
        return (
            f"an e-stop without a name is latched and counts for every actuator ({self.source}): look at the "
            "robots, then joshua estop --release"
        )

    @property
    def has_content(self) -> bool:
        return False

    def covers(self, subject: Subject) -> bool:
        del subject
        return True


def write_whole(path: Path, data: bytes) -> None:
    """Writes a file atomically. Raises OSError."""
    temporary = path.with_suffix(f".{os.getpid()}-{os.urandom(2).hex()}")
    try:
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
        temporary.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise


def _overwrite(path: Path, data: bytes) -> None:
    """Writes over a file of the same size, which takes no space. Raises OSError.

    A reader may find half of it, which is no JSON, and then reads it again.
    """
    descriptor = os.open(path, os.O_WRONLY | os.O_CLOEXEC)
    try:
        os.pwrite(descriptor, data, 0)
    finally:
        os.close(descriptor)


#: In place of the identifier of an e-stop: what a guardian did without one, and could not log.
NO_LATCH = "none"


@dataclass(frozen=True)
class EstopReport:
    """Effect of an e-stop at one actuator.

    Attributes:
        latch: identifier of the e-stop, or ``NO_LATCH``.
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


@dataclass(frozen=True)
class EstopOrder:
    """How an e-stop reaches a device without its driver.

    Attributes:
        implementation: import string of the action that takes the torque off; request: its values.
        processes: driver and guardian, which may hold the device, as ``ProcessMark.to_values`` gives them.
    """

    implementation: str
    request: Mapping[str, Any]
    processes: Sequence[Mapping[str, Any]] = ()


class EstopFiles:
    """Reports and orders of one run.

    Args:
        path: of the folder; "" for a run without directory, which writes nothing.
    """

    def __init__(self, path: str) -> None:
        self._path = Path(path) if path else None

    def report(self, report: EstopReport) -> bool:
        """Writes a report in place of an older one of the same actuator, and returns whether it could."""
        try:
            self._write(report.node, "report", asdict(report))
        except OSError:
            return False
        return True

    def read_report(self, node: str, latch: str) -> EstopReport | None:
        """Report of an actuator about one e-stop, None if there is none yet."""
        values = self._read(node, "report")
        with contextlib.suppress(TypeError):
            report = EstopReport(**values)
            return report if report.latch == latch else None
        return None

    def leave_order(self, node: str, order: EstopOrder) -> None:
        """Writes what an e-stop needs if the driver does not respond, and makes room for the report.

        Raises:
            OSError: it cannot be written.
        """
        self._write(node, "order", asdict(order))
        if not self.has_order(node):
            self._write(node, "report", {})

    def has_order(self, node: str) -> bool:
        """Whether there is an order and room for a report: both vanish with the folder of the run."""
        return self._path is None or (self._has(node, "order") and self._has(node, "report"))

    def read_order(self, node: str) -> EstopOrder | None:
        """The order of an actuator, None if its driver wrote none."""
        values = self._read(node, "order")
        with contextlib.suppress(TypeError):
            order = EstopOrder(**values)
            if isinstance(order.implementation, str) and isinstance(order.request, dict):
                return order
        return None

    def _write(self, node: str, kind: str, values: Mapping[str, Any]) -> None:
        if self._path is None:
            return
        data = json.dumps(values).encode()
        data = data.ljust(-(-len(data) // _BLOCK_BYTES) * _BLOCK_BYTES)
        path = self._file(node, kind)
        try:
            self._path.mkdir(mode=0o700, exist_ok=True)
            write_whole(path, data)
        except OSError:
            if not self._has(node, kind) or path.stat().st_size < len(data):
                raise
            _overwrite(path, data.ljust(path.stat().st_size))

    def _read(self, node: str, kind: str) -> dict[str, Any]:
        if self._path is not None:
            with contextlib.suppress(OSError, ValueError):
                values = json.loads(self._file(node, kind).read_text())
                return values if isinstance(values, dict) else {}
        return {}

    def _has(self, node: str, kind: str) -> bool:
        return os.path.exists(self._file(node, kind))  # noqa: PTH110 (raises nothing)

    def _file(self, node: str, kind: str) -> Path:
        assert self._path is not None
        return self._path / f"{node.strip('/').replace('/', '.')}.{kind}.json"
