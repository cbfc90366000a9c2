"""CSV, JSON Lines and Parquet: one row per sample, a time column, a column per joint."""

from __future__ import annotations

import csv
import json
from array import array
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from joshua.features import ACTION, STATE
from joshua.tools import install, parse_json

from joshua_mujoco_sim.trajectories.trajectory import (
    LONGEST_LINE,
    Budget,
    FloatArray,
    MissingExtraError,
    Trajectory,
    TrajectoryError,
)

TIME_COLUMNS = ("time_s", "timestamp")

#: Columns of a data set that hold all joints, several as a list; commanded positions take precedence.
VECTOR_COLUMNS = (ACTION, STATE)

#: Columns that are not joints.
_OTHER_COLUMNS = ("stamp_ns", "frame_index", "episode_index", "index", "task_index", "task", "next.done")


def read_csv(path: Path, budget: Budget) -> Trajectory:
    """Read a CSV file whose first line names its columns. Raises TrajectoryError with the line."""
    names: list[str] = []
    rows = _Rows(str(path), budget)
    try:
        with path.open(newline="", encoding="utf-8") as file:
            for number, row in enumerate(csv.reader(_lines(path, file)), start=1):
                if not row:
                    continue
                if not names:
                    names = [name.strip() for name in row]
                    continue
                if len(row) != len(names):
                    raise TrajectoryError(
                        f"{path}, line {number}: {len(row)} columns, and line 1 names {len(names)} "
                        f"({', '.join(names)})"
                    )
                rows.add(f"{path}, line {number}", dict(zip(names, row, strict=True)))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise TrajectoryError(f"{path} cannot be read: {error}") from error
    if not names:
        raise TrajectoryError(f"{path} is empty: its first line names the columns, time_s and each joint")
    return rows.trajectory()


def read_json_lines(path: Path, budget: Budget) -> Trajectory:
    """Read a file with one JSON object on each line. Raises TrajectoryError with the line."""
    rows = _Rows(str(path), budget)
    try:
        with path.open(encoding="utf-8") as file:
            for number, line in enumerate(_lines(path, file), start=1):
                if not line.strip():
                    continue
                where = f"{path}, line {number}"
                try:
                    record = parse_json(line)
                except json.JSONDecodeError as error:
                    raise TrajectoryError(f"{where}: {error.msg} in column {error.colno}") from error
                except (ValueError, RecursionError) as error:  # thousands of digits or brackets
                    raise TrajectoryError(f"{where}: is no sample: {error}") from error
                if not isinstance(record, dict):
                    raise TrajectoryError(f"{where}: a JSON object is needed, found {line.strip()[:40]}")
                rows.add(where, record)
    except (OSError, UnicodeDecodeError) as error:
        raise TrajectoryError(f"{path} cannot be read: {error}") from error
    return rows.trajectory()


def read_parquet(path: Path, budget: Budget) -> Trajectory:
    """Read a Parquet file. Raises TrajectoryError."""
    return from_columns(str(path), parquet_columns(path, budget))


def parquet_columns(path: Path, budget: Budget, *further: str) -> dict[str, Any]:
    """Return the trajectory columns of a Parquet file, and further ones if present.

    A column of lists becomes an array with a row for each of them. Raises TrajectoryError.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        command = install("joshua-mujoco-sim", "parquet")
        raise MissingExtraError(f"{path}: Parquet needs an extra: {command}") from error
    try:
        with pyarrow.parquet.ParquetFile(path) as file:
            names = _needed(file.schema_arrow.names, further)
            budget.take(path, _stored(file.metadata, names))
            table = file.read(columns=names)
        return {name: _as_array(f"{path}: {name}", table.column(name).combine_chunks()) for name in names}
    except (OSError, pyarrow.ArrowException) as error:
        raise TrajectoryError(f"{path} cannot be read as Parquet: {error}") from error


def from_columns(source: str, columns: Mapping[str, Any], vector_names: Sequence[str] = ()) -> Trajectory:
    """Return a trajectory from columns, one of which holds times. Raises TrajectoryError."""
    time = next((name for name in TIME_COLUMNS if name in columns), None)
    if time is None:
        raise TrajectoryError(
            f"{source}: no column {' or '.join(TIME_COLUMNS)}; it has {', '.join(columns) or 'none'}"
        )
    vector = next((name for name in VECTOR_COLUMNS if name in columns), None)
    try:
        time_s = np.asarray(columns[time], dtype=np.float64)
        if vector is not None:
            position: FloatArray = np.asarray(columns[vector], dtype=np.float64)
            if position.ndim == 1:  # LeRobot stores a single joint as a number
                position = position[:, np.newaxis]
            names = tuple(vector_names)
        else:
            chosen = [name for name in columns if name != time and name not in _OTHER_COLUMNS]
            for prefix in (f"{name}." for name in VECTOR_COLUMNS):  # named as in JOSHUA's CSV files
                if any(name.startswith(prefix) for name in chosen):
                    chosen = [name for name in chosen if name.startswith(prefix)]
                    names = tuple(name.removeprefix(prefix) for name in chosen)
                    break
            else:
                names = tuple(chosen)
            position = np.array([columns[name] for name in chosen], dtype=np.float64).T
    except (ValueError, TypeError) as error:
        raise TrajectoryError(f"{source}: a value is no number: {error}") from error
    if position.ndim != 2 or not position.shape[1]:
        raise TrajectoryError(f"{source}: no column of joint positions beside {time}")
    if names and len(names) != position.shape[1]:
        raise TrajectoryError(
            f"{source}: {position.shape[1]} values in {vector}, and {len(names)} names ({', '.join(names)})"
        )
    return Trajectory(source, names, time_s - time_s[0] if len(time_s) else time_s, position)


class _Rows:
    """Samples of a text file, with eight bytes per number."""

    def __init__(self, source: str, budget: Budget) -> None:
        self._source, self._budget = source, budget
        self._count = 0
        self._values: dict[str, array[float]] = {}
        self._lengths: dict[str, int | None] = {}

    def add(self, where: str, record: Mapping[str, Any]) -> None:
        """Add a sample. Raises TrajectoryError."""
        numbers = _numbers(where, record)
        self._count += 1
        if self._count == 1:
            self._values = {name: array("d") for name in numbers}
            self._lengths = {name: _length(value) for name, value in numbers.items()}
        if list(numbers) != list(self._values):
            raise TrajectoryError(
                f"{self._source}: sample {self._count} has {', '.join(numbers)}, and the first has "
                f"{', '.join(self._values)}"
            )
        for name, value in numbers.items():
            if _length(value) != self._lengths[name]:
                raise TrajectoryError(f"{where}: {name} has another length than in the first sample")
            row = value if isinstance(value, list) else (value,)
            self._budget.take(self._source, len(row))
            self._values[name].extend(row)

    def trajectory(self) -> Trajectory:
        """Return the trajectory of all samples. Raises TrajectoryError."""
        if not self._count:
            raise TrajectoryError(f"{self._source} has no samples: record some first")
        columns = {
            name: np.frombuffer(values)
            if self._lengths[name] is None
            else np.frombuffer(values).reshape(self._count, -1)
            for name, values in self._values.items()
        }
        return from_columns(self._source, columns)


def _lines(path: Path, file: TextIO) -> Iterator[str]:
    """Yield the lines of a file, with a length limit. Raises TrajectoryError."""
    number = 0
    while line := file.readline(LONGEST_LINE + 1):
        number += 1
        if len(line) > LONGEST_LINE:
            raise TrajectoryError(
                f"{path}, line {number}: is longer than {LONGEST_LINE} characters, as no sample is: name a "
                "recording"
            )
        yield line


def _numbers(where: str, record: Mapping[str, Any]) -> dict[str, float | list[float]]:
    converted: dict[str, float | list[float]] = {}
    for name, value in record.items():
        if name in _OTHER_COLUMNS:
            continue
        try:
            converted[name] = [float(item) for item in value] if isinstance(value, list) else float(value)
        except (TypeError, ValueError, OverflowError) as error:
            found = repr(value)[:40]
            raise TrajectoryError(f"{where}: {name} is {found}, and a number is needed") from error
    return converted


def _length(value: float | list[float]) -> int | None:
    return len(value) if isinstance(value, list) else None


def _needed(names: Sequence[str], further: Sequence[str]) -> list[str]:
    """Return the columns to read; skips large pictures and texts if one list holds all joints."""
    times = [name for name in TIME_COLUMNS if name in names][:1]
    vectors = [name for name in VECTOR_COLUMNS if name in names][:1]
    joints = vectors or [name for name in names if name not in (*times, *_OTHER_COLUMNS)]
    return list(dict.fromkeys([*times, *joints, *(name for name in further if name in names)]))


def _stored(metadata: Any, names: Sequence[str]) -> int:
    """Return the number of values in columns from the metadata, before reading any."""
    groups = (metadata.row_group(index) for index in range(metadata.num_row_groups))
    return sum(
        column.num_values
        for group in groups
        for column in (group.column(index) for index in range(group.num_columns))
        if any(f"{column.path_in_schema}.".startswith(f"{name}.") for name in names)
    )


def _as_array(source: str, column: Any) -> Any:
    import pyarrow.compute
    from pyarrow import types

    kind = column.type
    if not (types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)):
        return column.to_numpy(zero_copy_only=False)
    lengths = pyarrow.compute.unique(pyarrow.compute.list_value_length(column)).to_pylist()
    if len(lengths) > 1 or None in lengths:
        raise TrajectoryError(f"{source} has rows of different lengths")
    values = column.flatten().to_numpy(zero_copy_only=False)
    return values.reshape(len(column), -1) if len(column) else values
