"""Write tables, lines and values in the formats of a data set, and numbers in sentences."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq


def write_table(path: Path, table: pa.Table) -> None:
    """Write a table in the format that the suffix names: ``.parquet``, ``.csv`` or ``.jsonl``.

    Raises:
        OSError, pyarrow.ArrowException: writing fails.
    """
    if path.suffix == ".csv":
        pa_csv.write_csv(table, path)
    elif path.suffix == ".jsonl":
        with path.open("w", encoding="utf-8") as file:
            for batch in table.to_batches(max_chunksize=1000):
                file.writelines(json.dumps(row) + "\n" for row in batch.to_pylist())
    else:
        pq.write_table(table, path, compression="snappy")


def write_lines(path: Path, records: Iterable[Mapping[str, Any]]) -> None:
    """Write a line of JSON for each record. Raises OSError; ValueError for a number that JSON has not."""
    with path.open("w", encoding="utf-8") as file:
        file.writelines(json.dumps(record, allow_nan=False) + "\n" for record in records)


def write_json(path: Path, value: Any) -> None:
    """Write a value as JSON. Raises OSError; ValueError for a number that JSON has not."""
    path.write_text(json.dumps(value, indent=4, allow_nan=False) + "\n", encoding="utf-8")


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: "1 error", "2 errors"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
