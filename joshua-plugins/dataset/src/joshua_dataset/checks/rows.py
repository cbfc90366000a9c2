"""Read the index columns of all tables of frames, as LeRobot does: one table after the other, by their names.

The columns of the features are checked by episode, see ``recording``; here only their names and types are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
from joshua.api.files import file_inside
from joshua.tools import parse_json

from joshua_dataset.checks.contents import Contents, tables
from joshua_dataset.checks.problem import Kind, Problem, of_episodes, repairing
from joshua_dataset.checks.schema import index_columns, problems_of_schema
from joshua_dataset.metadata import INDEX_COLUMNS, STAMP
from joshua_dataset.reader import MOST_ROWS

#: Columns that say which frame a row is.
_COLUMNS = tuple(name for name in INDEX_COLUMNS if name != STAMP)

Columns = Mapping[str, npt.NDArray[Any]]


@dataclass
class Stretch:
    """Rows of one episode that follow each other in one table.

    Attributes:
        episode: its index; file: with the rows; first: place of the first row among all rows, None behind
            a table that cannot be read; count: of rows.
        tasks: indices of the tasks of the rows; None without the column.
        frames_are_right: ``frame_index`` counts from 0; None without the column.
        times: timestamps, s; None without the column.
    """

    episode: int
    file: Path
    first: int | None
    count: int
    tasks: frozenset[int] | None = None
    frames_are_right: bool | None = None
    times: npt.NDArray[np.float64] | None = None


@dataclass
class Rows:
    """What the tables of frames say.

    Attributes:
        stretches: in order; files: tables that could be read.
        are_all_read: no table is torn or lacks ``episode_index``.
        count: rows of the tables that could be read.
        problems: found while reading.
    """

    stretches: list[Stretch] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    are_all_read: bool = True
    count: int = 0
    problems: list[Problem] = field(default_factory=list)

    def by_episode(self) -> dict[int, list[Stretch]]:
        """Return the stretches of each episode."""
        found: dict[int, list[Stretch]] = {}
        for stretch in self.stretches:
            found.setdefault(stretch.episode, []).append(stretch)
        return found


def read(contents: Contents) -> Rows:
    """Read the index columns of all tables of frames."""
    found = Rows()
    if contents.has_messages or contents.is_empty:
        return found
    try:
        paths = tables(contents.folder, Path("data"), contents.suffix)
    except OSError as error:
        found.are_all_read = False
        found.problems.append(contents.refused(contents.folder / "data", error, Kind.ROWS_MISSING))
        return found
    if not paths:
        found.are_all_read = False
        text = f"data contains no table ({contents.suffix})"
        found.problems.append(Problem(Kind.ROWS_MISSING, text, remedy=repairing(contents.folder)))
    counter, described = _Counter(contents, found), contents.tables()
    for path in paths:
        try:
            columns = _columns(contents, found, path)
        except (OSError, ValueError, TypeError, pa.ArrowException) as error:
            found.are_all_read = False
            problem = contents.refused(path, error, Kind.ROWS_TORN)
            found.problems.append(of_episodes(problem, described.get(path, ())))
            counter.lose()
            continue
        found.files.append(path)
        counter.add(path, columns)
    return found


def _columns(contents: Contents, found: Rows, path: Path) -> Columns:
    """Return the index columns of a table that are usable; add the problems of the others.

    Raises:
        OSError, ValueError, TypeError, pyarrow.ArrowException: the table cannot be read.
    """
    file_inside(contents.folder, path)
    if path.suffix == ".parquet":
        with pq.ParquetFile(path) as file:
            if file.metadata.num_rows > MOST_ROWS:
                raise ValueError(f"it has {file.metadata.num_rows} rows; at most {MOST_ROWS} are read")
            schema = file.schema_arrow
            table = file.read([name for name in INDEX_COLUMNS if name in schema.names])
    elif path.suffix == ".csv":
        table = pa_csv.read_csv(path)
        schema = table.schema
    else:
        with path.open(encoding="utf-8") as lines:
            table = pa.Table.from_pylist([parse_json(line) for line in lines])
        schema = table.schema
    for problem in problems_of_schema(contents, path, schema):
        if problem not in found.problems:  # what is wrong with every table is said once
            found.problems.append(problem)
    wanted = (*_COLUMNS, STAMP) if STAMP in table.column_names else _COLUMNS  # LeRobot has none
    columns, problems = index_columns(contents, path, table, wanted)
    found.problems += problems
    return columns


class _Counter:
    """Counts the rows of one table after the other.

    Args:
        contents: of the data set; found: to which stretches and problems are added.
    """

    def __init__(self, contents: Contents, found: Rows) -> None:
        self._contents, self._found = contents, found
        self._first: int | None = 0
        self._expected: int | None = 0

    def lose(self) -> None:
        """Take note of a table that cannot be read: nobody knows how many rows it had."""
        self._first = self._expected = None

    def add(self, path: Path, columns: Columns) -> None:
        """Take the columns of the next table."""
        found = self._found
        if "index" in columns:
            found.problems += self._index(path, columns["index"])
        count = len(next(iter(columns.values()), ()))
        if "episode_index" in columns:
            found.stretches += _stretches(path, columns, self._first)
        else:
            found.are_all_read = False
        found.count += count
        if not columns:
            self.lose()
        elif self._first is not None:
            self._first += count

    def _index(self, path: Path, index: npt.NDArray[Any]) -> Iterator[Problem]:
        """Yield at most one problem of each kind for a table."""
        if not len(index):
            return
        name, remedy = self._contents.name(path), repairing(self._contents.folder)
        before = self._expected
        if before is not None and index[0] != before:
            kind = Kind.INDEX_OFFSET
            said = "its first row"
            if before:
                kind = Kind.INDEX_GAP if index[0] > before else Kind.INDEX_REPEATED
                said = "its first row, the row behind that of the table before it"
            text = f"{name}: index of {said} is {index[0]}; it must be {before}"
            yield Problem(kind, text, remedy=remedy)
        steps = np.diff(index)
        for kind, places in (
            (Kind.INDEX_GAP, np.flatnonzero(steps > 1)),
            (Kind.INDEX_REPEATED, np.flatnonzero(steps < 1)),
        ):
            if len(places):
                row = int(places[0])
                more = f", and {len(places) - 1} more such steps" if len(places) > 1 else ""
                text = f"{name}: index goes from {index[row]} to {index[row + 1]} at row {row + 1}{more}"
                yield Problem(kind, text, remedy=remedy)
        self._expected = int(index[-1]) + 1 if before is None else before + len(index)


def _stretches(path: Path, columns: Columns, first: int | None) -> Iterator[Stretch]:
    episodes = columns["episode_index"]
    if not len(episodes):
        return
    cuts = np.flatnonzero(np.diff(episodes)) + 1
    bounds = [0, *cuts.tolist(), len(episodes)]
    for begin, end in pairwise(bounds):
        part = slice(begin, end)
        found = Stretch(int(episodes[begin]), path, None if first is None else first + begin, end - begin)
        if "task_index" in columns:
            found.tasks = frozenset(np.unique(columns["task_index"][part]).tolist())
        if "frame_index" in columns:
            found.frames_are_right = np.array_equal(columns["frame_index"][part], np.arange(end - begin))
        if "timestamp" in columns:
            found.times = columns["timestamp"][part].astype(np.float64)
        yield found
