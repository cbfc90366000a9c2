"""Read what is there of a damaged data set: each file for itself, so that a torn one hides no other."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
from joshua.api.files import file_inside, inside, is_system_error
from joshua.features import EpisodeError
from joshua.tools import parse_json

from joshua_dataset.metadata import EPISODES_STATS, INDEX_COLUMNS, INFO, OURS, SUFFIXES, TASKS, array_of
from joshua_dataset.reader import MOST_ROWS, VERSIONS

_TABLE = re.compile(r"data/chunk-(\d+)/(file-|episode_)(\d+)\.(parquet|csv|jsonl)")

_EPISODES = re.compile(r"meta/episodes/chunk-(\d+)/(file-)(\d+)\.parquet")

#: Errors of a file that cannot be read, unless they are of the system.
_ERRORS = (OSError, ValueError, TypeError, KeyError, AttributeError, pa.ArrowException)


@dataclass(frozen=True)
class Rows:
    """One table of rows.

    Attributes:
        path: of the file; number: in its name, counted over all chunks in LeRobot's layout v2.
        table: its rows; index: its columns that count frames, (N,) each, as far as they are numbers.
    """

    path: Path
    number: int
    table: pa.Table
    index: dict[str, npt.NDArray[np.float64]]


@dataclass(frozen=True)
class Evidence:
    """What is there of a data set.

    Attributes:
        folder: of the data set; info: the content of ``meta/info.json``.
        version: of LeRobot's layout; suffix: of the tables of rows.
        rows: the tables that can be read, in order; unreadable: why the others cannot, by their name.
        described: the rows of the table of episodes, by episode.
        tasks: texts by index; None without a table of tasks.
    """

    folder: Path
    info: dict[str, Any]
    version: str
    suffix: str
    rows: list[Rows]
    unreadable: dict[str, str]
    described: dict[int, dict[str, Any]]
    tasks: dict[int, str] | None

    @property
    def is_v3(self) -> bool:
        """Whether several episodes can share a file."""
        return self.version == "v3.0"


def read(folder: Path) -> Evidence:
    """Read what is there of a data set.

    Raises:
        EpisodeError: its description cannot be read, or there is no table of rows.
        OSError: the system does not let a file be read.
    """
    info = _info(folder)
    ours = info.get(OURS, {"format": "lerobot"})
    kind = str(ours.get("format", "lerobot")) if isinstance(ours, dict) else ""
    suffix = SUFFIXES.get(kind, "")
    if not suffix:
        raise EpisodeError(
            f"{folder / INFO} has the format {kind!r}, whose tables no repair mends; "
            f"allowed: {', '.join(name for name, found in SUFFIXES.items() if found)}. Nothing was changed"
        )
    names = [(path, match) for path, match in _matching(folder, "data", _TABLE) if path.suffix == suffix]
    version = str(info.get("codebase_version", ""))
    is_v2 = any(match[2] == "episode_" for _, match in names)
    if version not in VERSIONS or is_v2 == (version == "v3.0"):
        has_statistics = (folder / EPISODES_STATS).exists()
        version = ("v2.1" if has_statistics else "v2.0") if is_v2 else "v3.0"
    rows, unreadable = [], {}
    for path, match in names:
        try:
            table = _table(file_inside(folder, path, "the table"))
        except _ERRORS as error:
            if is_system_error(error):
                raise
            unreadable[path.relative_to(folder).as_posix()] = str(error)
            continue
        rows.append(Rows(path, int(match[3]), table, _index(table)))
    described = _described_v3(folder) if version == "v3.0" else _described_v2(folder)
    return Evidence(folder, info, version, suffix, rows, unreadable, described, _tasks(folder, version))


def _info(folder: Path) -> dict[str, Any]:
    try:
        info = parse_json(file_inside(folder, folder / INFO).read_text(encoding="utf-8"))
        if isinstance(info, dict) and isinstance(info.get("features"), dict):
            return info
        reason = "it does not describe features"
    except _ERRORS as error:
        if is_system_error(error):
            raise
        reason = str(error)
    raise EpisodeError(
        f"{folder / INFO} cannot be used: {reason}. Only this file says what the columns mean, so nothing "
        "was changed. Restore it from a copy, then run the same command again"
    )


def _matching(folder: Path, top: str, pattern: re.Pattern[str]) -> list[tuple[Path, re.Match[str]]]:
    """Return the files below a folder that have a name of the layout, by their numbers."""
    found = []
    for path in inside(folder, top).rglob("*"):
        match = pattern.fullmatch(path.relative_to(folder).as_posix())
        if match is not None:
            found.append((path, match))
    return sorted(found, key=lambda item: (int(item[1][1]), int(item[1][3])))


def _table(path: Path) -> pa.Table:
    """Read a table of rows; of a text, the whole lines. Raises ``_ERRORS``."""
    if path.suffix == ".parquet":
        count = pq.read_metadata(path).num_rows
        if count > MOST_ROWS:
            raise ValueError(f"it has {count} rows; at most {MOST_ROWS} are read")
        return pq.read_table(path)
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)
    if path.suffix == ".jsonl":
        return pa.Table.from_pylist(list(_parsed(lines)))
    whole = []
    for line in lines:
        if not line.endswith("\n") or line.count(",") != lines[0].count(","):
            break
        whole.append(line)
    return pa_csv.read_csv(io.BytesIO("".join(whole).encode()))


def _parsed(lines: list[str]) -> Iterator[dict[str, Any]]:
    """Yield the objects up to the first line that is not one."""
    for line in lines:
        try:
            record = parse_json(line)
        except ValueError:
            return
        if not isinstance(record, dict):
            return
        yield record


def _index(table: pa.Table) -> dict[str, npt.NDArray[np.float64]]:
    found = {}
    for name in (name for name in INDEX_COLUMNS if table.column_names.count(name) == 1):
        values = array_of(table.column(name))
        if values.ndim == 2 and values.shape[1] == 1:
            values = values[:, 0]
        if values.ndim == 1 and values.dtype.kind in "iuf":
            found[name] = values.astype(np.float64)
    return found


def _described_v3(folder: Path) -> dict[int, dict[str, Any]]:
    found: dict[int, dict[str, Any]] = {}
    for path, _ in _matching(folder, "meta", _EPISODES):
        table = _tolerant(lambda path=path: pq.read_table(file_inside(folder, path)))  # type: ignore[misc]
        for row in table.to_pylist() if table is not None else ():
            _add(found, row)
    return found


def _described_v2(folder: Path) -> dict[int, dict[str, Any]]:
    found: dict[int, dict[str, Any]] = {}
    for row in _lines(folder, "episodes"):
        _add(found, row)
    for row in _lines(folder, "episodes_stats"):
        number, values = row.get("episode_index"), row.get("stats")
        if isinstance(number, int) and number in found and isinstance(values, dict):
            flat = {
                f"stats/{key}/{name}": value
                for key, figures in values.items()
                if isinstance(figures, dict)
                for name, value in figures.items()
            }
            found[number] |= flat
    return found


def _add(found: dict[int, dict[str, Any]], row: dict[str, Any]) -> None:
    number = row.get("episode_index")
    if isinstance(number, int) and number >= 0:
        found.setdefault(number, row)


def _lines(folder: Path, name: str) -> list[dict[str, Any]]:
    path = folder / "meta" / f"{name}.jsonl"
    text = _tolerant(lambda: file_inside(folder, path).read_text(encoding="utf-8", errors="replace"))
    found = []
    for line in (text or "").splitlines():
        with contextlib.suppress(ValueError):
            record = parse_json(line)
            if isinstance(record, dict):
                found.append(record)
    return found


def _tasks(folder: Path, version: str) -> dict[int, str] | None:
    if version == "v3.0":
        table = _tolerant(lambda: pq.read_table(file_inside(folder, folder / TASKS)))
        if table is None or "task_index" not in table.column_names or table.num_columns < 2:
            return None
        name = next(name for name in table.column_names if name != "task_index")
        pairs = zip(table.column("task_index").to_pylist(), table.column(name).to_pylist(), strict=True)
    else:
        rows = _lines(folder, "tasks")
        pairs = zip((row.get("task_index") for row in rows), (row.get("task") for row in rows), strict=True)
    found: dict[int, set[str]] = {}
    for index, text in pairs:
        if isinstance(index, int) and index >= 0 and isinstance(text, str):
            found.setdefault(index, set()).add(text)
    return {index: next(iter(texts)) for index, texts in found.items() if len(texts) == 1} or None


def _tolerant(read_file: Callable[[], Any]) -> Any:
    """Return what a function reads; None if the file is missing or damaged. Raises OSError of the system."""
    try:
        return read_file()
    except _ERRORS as error:
        if is_system_error(error):
            raise
        return None
