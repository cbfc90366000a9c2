"""What can be read of a data set, piece by piece: a file that cannot be read hides nothing of the others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from joshua.api.files import UnsafePathError, file_inside, inside
from joshua.tools import describe_pointer

from joshua_dataset.checks.problem import Kind, Problem, repairing
from joshua_dataset.meta_files import read_info, read_lines, read_tasks
from joshua_dataset.metadata import INFO, MESSAGES, SUFFIXES, TASKS
from joshua_dataset.reader import VERSIONS, Dataset, DatasetError, Episode

EPISODES = Path("meta") / "episodes"
EPISODE_LINES = Path("meta") / "episodes.jsonl"
STATISTICS_LINES = Path("meta") / "episodes_stats.jsonl"
TASK_LINES = Path("meta") / "tasks.jsonl"

#: Prefix of the columns with the statistics of an episode.
STATISTICS = "stats/"


@dataclass(frozen=True)
class EpisodeRow:
    """One row of the tables of episodes.

    Attributes:
        file: of the row; number: of the row among those of all files; values: by column, without
            statistics.
    """

    file: Path
    number: int
    values: Mapping[str, Any]


@dataclass
class Contents:
    """A data set as far as it can be read.

    Attributes:
        folder: of the data set; info: content of ``meta/info.json``, empty if it cannot be read.
        version: of the layout, by ``info`` or by the files.
        dataset: what ``info`` describes; None if that cannot be used.
        tasks: index and text of each row of the table of tasks; None if it cannot be read.
        rows: of the tables of episodes, in order.
        columns: names of the columns of each table of episodes.
        has_all_rows: no table of episodes is missing or torn.
        is_empty: no episode was recorded yet.
        problems: found while reading.
    """

    folder: Path
    info: dict[str, Any] = field(default_factory=dict)
    version: str = ""
    dataset: Dataset | None = None
    tasks: list[tuple[Any, Any]] | None = None
    rows: list[EpisodeRow] = field(default_factory=list)
    columns: dict[Path, pa.Schema] = field(default_factory=dict)
    has_all_rows: bool = True
    is_empty: bool = False
    problems: list[Problem] = field(default_factory=list)

    @property
    def is_v3(self) -> bool:
        """Whether the layout is LeRobot's v3.0, as that of all our formats."""
        return self.version == "v3.0"

    @property
    def format(self) -> str:
        """Format of the tables."""
        return self.dataset.format if self.dataset is not None else "lerobot"

    @property
    def suffix(self) -> str:
        """Suffix of the tables of frames; "" for messages."""
        return SUFFIXES.get(self.format, ".parquet")

    @property
    def has_messages(self) -> bool:
        """Whether the data set contains messages in the place of frames."""
        return self.dataset is not None and self.dataset.pictures == MESSAGES

    @property
    def features(self) -> dict[str, Mapping[str, Any]]:
        """What ``info`` says of each feature, empty where that is no object."""
        features = self.info.get("features")
        items = features.items() if isinstance(features, Mapping) else ()
        return {str(key): value if isinstance(value, Mapping) else {} for key, value in items}

    def name(self, path: Path) -> str:
        """Return the path of a file in the data set, for messages."""
        return path.relative_to(self.folder).as_posix() if path.is_relative_to(self.folder) else str(path)

    def add(self, kind: Kind, text: str, **others: Any) -> None:
        """Add a problem that a repair cures."""
        self.problems.append(Problem(kind, text, **{"remedy": repairing(self.folder)} | others))

    def refused(self, path: Path, error: Exception, kind: Kind) -> Problem:
        """Return the problem of a file that cannot be read.

        Args:
            kind: of a file whose content is the fault.
        """
        pointer = describe_pointer(path)
        if pointer is not None:
            return Problem(Kind.POINTER, ". ".join(pointer))
        if isinstance(error, UnsafePathError):
            return Problem(Kind.ELSEWHERE, str(error))
        text = f"{self.name(path)} cannot be read: {str(error).rstrip('. ')}"
        if is_of_system(error):
            return Problem(Kind.UNREADABLE, text)
        return Problem(kind, text, remedy=repairing(self.folder))

    def tables(self) -> dict[Path, list[int]]:
        """Return the episodes of each table of frames, as the tables of episodes describe them."""
        found: dict[Path, list[int]] = {}
        for row in self.rows if self.dataset is not None else ():
            try:
                path = self.dataset.table_of(row.values) if self.dataset is not None else self.folder
                found.setdefault(path, []).append(int(row.values["episode_index"]))
            except DatasetError:
                continue  # the check of the table of episodes says why
        return found

    def episodes(self) -> Iterator[Episode]:
        """Yield the episodes that can be understood, with their statistics. Requires ``dataset``."""
        dataset = self.dataset
        assert dataset is not None
        described = self._with_statistics() if self.is_v3 else self._lines_with_statistics()
        for row in described:
            if is_whole(row.get("episode_index")) and is_whole(row.get("length")):
                try:
                    yield dataset.episode_of(row)
                except DatasetError:
                    continue  # the check of the rows has named it

    def _with_statistics(self) -> Iterator[Mapping[str, Any]]:
        for path in self.columns:
            with pq.ParquetFile(path) as file:
                for batch in file.iter_batches(batch_size=64):
                    yield from batch.to_pylist()

    def _lines_with_statistics(self) -> Iterator[Mapping[str, Any]]:
        known: dict[Any, Any] = {}
        try:
            for line in read_lines(self.folder, self.folder / STATISTICS_LINES, False):
                known[line.get("episode_index")] = line.get("stats") or {}
        except (DatasetError, TypeError):
            known = {}  # the check of the statistics names it
        for row in self.rows:
            yield {**row.values, "stats": known.get(row.values.get("episode_index"), {})}


def is_whole(value: Any) -> bool:
    """Return whether a value is a whole number that is not negative."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def is_of_system(error: BaseException) -> bool:
    """Return whether an error is one of rights, devices or space, and not of the content of a file."""
    cause = error if isinstance(error, OSError) else error.__cause__
    is_missing = isinstance(cause, FileNotFoundError | IsADirectoryError | NotADirectoryError)
    return isinstance(cause, OSError) and cause.errno is not None and not is_missing


def shown(value: Any) -> str:
    """Return a value of a file for a message: printable, and not long."""
    text = ascii(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def read(folder: Path) -> Contents:
    """Read the metadata of a data set.

    Raises:
        DatasetError: the folder is not a data set, or a change of it was interrupted.
    """
    found = Contents(folder)
    try:
        found.info = read_info(folder)
    except DatasetError as error:
        if not any((folder / name).exists() for name in (INFO, EPISODES, EPISODE_LINES)):
            raise
        found.problems.append(found.refused(folder / INFO, error, Kind.INFO_TORN))
    found.version = _version(found)
    try:
        if found.info:
            found.dataset = Dataset.of(folder, {**found.info, "codebase_version": found.version})
    except DatasetError as error:
        found.problems.append(Problem(Kind.INFO_FIELD, str(error)))
    if found.info.get("total_episodes") == 0 and not _has_tables(found):
        found.is_empty = True
        found.add(Kind.EPISODES_MISSING, "no episode was recorded yet", serious=False, remedy=None)
        return found
    _read_tasks(found)
    if found.is_v3:
        _read_tables(found)
    else:
        _read_lines(found)
    return found


def _has_tables(found: Contents) -> bool:
    places = [found.folder / "data", found.folder / EPISODES]
    has_files = any(any(place.rglob("*.*")) for place in places if place.is_dir())
    return has_files or (found.folder / EPISODE_LINES).exists()


def _version(found: Contents) -> str:
    """Return the version that the files have; say where ``info`` has another."""
    has_tables = (found.folder / EPISODES).is_dir()
    has_lines = (found.folder / EPISODE_LINES).exists()
    told = str(found.info.get("codebase_version", ""))
    seen = "v3.0" if has_tables or not has_lines else "v2.1"
    is_of_seen = told == seen or (told == "v2.0" and seen == "v2.1") or not (has_tables or has_lines)
    if told in VERSIONS and is_of_seen:
        return told
    if found.info:
        found.add(
            Kind.INFO_VERSION,
            f"{INFO} has the codebase_version {shown(told)}, and the files have the layout of {seen}. "
            f"Allowed: {', '.join(VERSIONS)}",
            remedy=None,
        )
    return seen


def _read_tasks(found: Contents) -> None:
    path = found.folder / (TASKS if found.is_v3 else TASK_LINES)
    if not path.exists() and not path.is_symlink():
        if not found.has_messages:
            found.add(Kind.TASKS_MISSING, f"{found.name(path)} is missing: LeRobot needs it")
        return
    try:
        file_inside(found.folder, path)
        found.tasks = read_tasks(found.folder, found.version)
    except UnsafePathError as error:
        found.problems.append(Problem(Kind.ELSEWHERE, str(error)))
    except (DatasetError, OSError) as error:
        found.problems.append(found.refused(path, error, Kind.TASKS_TORN))
    except (KeyError, TypeError, ValueError) as error:
        found.add(
            Kind.TASKS_TORN,
            f"{found.name(path)} does not have the columns task_index and task: "
            f"{type(error).__name__}: {shown(str(error))}",
        )


def _read_lines(found: Contents) -> None:
    path = found.folder / EPISODE_LINES
    try:
        for line in read_lines(found.folder, path, True):
            found.rows.append(EpisodeRow(path, len(found.rows), line))
    except DatasetError as error:
        found.has_all_rows = False
        kind = Kind.EPISODES_TORN if path.exists() else Kind.EPISODES_MISSING
        found.problems.append(found.refused(path, error, kind))


def _read_tables(found: Contents) -> None:
    try:
        paths = tables(found.folder, EPISODES, ".parquet")
    except OSError as error:
        found.has_all_rows = False
        found.problems.append(found.refused(found.folder / EPISODES, error, Kind.EPISODES_MISSING))
        return
    if not paths:
        found.has_all_rows = False
        found.add(Kind.EPISODES_MISSING, f"{EPISODES} contains no table of episodes")
    for path in paths:
        _read_table(found, path)


def _read_table(found: Contents, path: Path) -> None:
    try:
        file_inside(found.folder, path)
        with pq.ParquetFile(path) as file:
            schema = file.schema_arrow
            names = [name for name in schema.names if not name.startswith(STATISTICS)]
            rows: list[Any] = []
            for batch in file.iter_batches(batch_size=64):  # the statistics can be torn, too
                rows += batch.select(names).to_pylist()
    except (OSError, ValueError, pa.ArrowException) as error:
        found.has_all_rows = False
        found.problems.append(found.refused(path, error, Kind.EPISODES_TORN))
        return
    found.columns[path] = schema
    for values in rows:
        found.rows.append(EpisodeRow(path, len(found.rows), values))


def tables(folder: Path, name: Path, suffix: str) -> list[Path]:
    """Return the tables below a folder of a data set, in the order in which LeRobot reads them.

    Args:
        name: of the folder in the data set; suffix: of the tables.

    Raises:
        UnsafePathError: a folder is elsewhere. OSError: one cannot be read.
    """
    found: list[Path] = []
    place = inside(folder, name)
    if not place.is_dir():
        return []
    for chunk in sorted(place.iterdir()):
        if not inside(folder, chunk).is_dir() or chunk.name.startswith("."):
            continue
        found += sorted(path for path in chunk.iterdir() if path.suffix == suffix)
    return found
