"""CSV, JSON Lines and Parquet: one row for each sample, a column of times, a column for each joint."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from joshua_mujoco_sim.trajectories.trajectory import (
    FloatArray,
    MissingExtraError,
    Trajectory,
    TrajectoryError,
)

TIME_COLUMNS = ("time_s", "timestamp")

#: Columns of a recorded data set that hold all joints as one list, the commanded positions first.
VECTOR_COLUMNS = ("action", "observation.state")

#: Columns that count and describe, and are no joints.
_OTHER_COLUMNS = ("frame_index", "episode_index", "index", "task_index", "task", "next.done")


def read_csv(path: Path) -> Trajectory:
    """Reads a CSV file whose first line names its columns. Raises TrajectoryError with the line."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = [(number, row) for number, row in enumerate(csv.reader(file), start=1) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise TrajectoryError(f"{path} cannot be read: {error}") from error
    if not rows:
        raise TrajectoryError(f"{path} is empty: its first line names the columns, time_s and each joint")
    names = [name.strip() for name in rows[0][1]]
    records = []
    for number, row in rows[1:]:
        if len(row) != len(names):
            raise TrajectoryError(
                f"{path}, line {number}: {len(row)} columns, and line 1 names {len(names)} "
                f"({', '.join(names)})"
            )
        records.append(_numbers(f"{path}, line {number}", dict(zip(names, row, strict=True))))
    return _from_records(str(path), records)


def read_json_lines(path: Path) -> Trajectory:
    """Reads a file with one JSON object on each line. Raises TrajectoryError with the line."""
    records = []
    try:
        with path.open(encoding="utf-8") as file:
            for number, line in enumerate(file, start=1):
                if not line.strip():
                    continue
                where = f"{path}, line {number}"
                try:
                    record = json.loads(line)
                except json.JSONDecodeError as error:
                    raise TrajectoryError(f"{where}: {error.msg} in column {error.colno}") from error
                if not isinstance(record, dict):
                    raise TrajectoryError(f"{where}: a JSON object is needed, found {line.strip()[:40]}")
                records.append(_numbers(where, record))
    except (OSError, UnicodeDecodeError) as error:
        raise TrajectoryError(f"{path} cannot be read: {error}") from error
    return _from_records(str(path), records)


def read_parquet(path: Path, vector_names: Sequence[str] = ()) -> Trajectory:
    """Reads a Parquet file. Raises TrajectoryError.

    Args:
        path: the file.
        vector_names: names of the joints in a column that holds them all.
    """
    return from_columns(str(path), parquet_columns(path), vector_names)


def parquet_columns(path: Path) -> dict[str, list[Any]]:
    """Columns of a Parquet file. Raises TrajectoryError."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError(
            f"{path}: Parquet needs an extra: pip install 'joshua-mujoco-sim[parquet]'"
        ) from error
    try:
        columns: dict[str, list[Any]] = pyarrow.parquet.read_table(path).to_pydict()
    except (OSError, pyarrow.ArrowException) as error:
        raise TrajectoryError(f"{path} cannot be read as Parquet: {error}") from error
    return columns


def from_columns(source: str, columns: dict[str, list[Any]], vector_names: Sequence[str] = ()) -> Trajectory:
    """Makes a trajectory of columns, of which one holds times. Raises TrajectoryError."""
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
            names = tuple(vector_names)
        else:
            names = tuple(name for name in columns if name != time and name not in _OTHER_COLUMNS)
            position = np.array([columns[name] for name in names], dtype=np.float64).T
    except (ValueError, TypeError) as error:
        raise TrajectoryError(f"{source}: a value is no number: {error}") from error
    if position.ndim != 2 or not position.shape[1]:
        raise TrajectoryError(f"{source}: no column of joint positions beside {time}")
    if names and len(names) != position.shape[1]:
        raise TrajectoryError(
            f"{source}: {position.shape[1]} values in {vector}, and {len(names)} names ({', '.join(names)})"
        )
    return Trajectory(source, names, time_s - time_s[0] if len(time_s) else time_s, position)


def _numbers(where: str, record: dict[str, Any]) -> dict[str, Any]:
    converted: dict[str, Any] = {}
    for name, value in record.items():
        if name in _OTHER_COLUMNS:
            continue
        try:
            converted[name] = [float(item) for item in value] if isinstance(value, list) else float(value)
        except (TypeError, ValueError) as error:
            raise TrajectoryError(f"{where}: {name} is {value!r}, and a number is needed") from error
    return converted


def _from_records(source: str, records: list[dict[str, Any]]) -> Trajectory:
    if not records:
        raise TrajectoryError(f"{source} holds no sample: record something first")
    names = list(records[0])
    for number, record in enumerate(records, start=1):
        if list(record) != names:
            raise TrajectoryError(
                f"{source}: sample {number} has {', '.join(record)}, and the first has {', '.join(names)}"
            )
    return from_columns(source, {name: [record[name] for record in records] for name in names})
