"""Read the files under ``meta/`` of a data set, which is not trusted: sizes and depths are bounded."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from joshua.api.files import file_inside
from joshua.tools import parse_json

from joshua_dataset.decoding import DatasetError, unreadable
from joshua_dataset.lock import PRIVATE
from joshua_dataset.metadata import INFO, TASKS

#: Largest metadata file that is read, and largest line of one, bytes.
LARGEST_JSON, LARGEST_LINE = 256 << 20, 16 << 20


def read_info(folder: Path) -> dict[str, Any]:
    """Return the content of ``meta/info.json``. Raises DatasetError."""
    info = read_json(folder, INFO)
    if not isinstance(info, dict):
        raise DatasetError(f"{folder / INFO} is not a JSON object")
    return info


def read_tasks(folder: Path, version: str) -> list[tuple[Any, Any]]:
    """Return the indices and texts of the tasks as they stand in their table; none without a table.

    Raises:
        DatasetError: the table cannot be read. KeyError, TypeError, ValueError: it has no such columns.
    """
    if version == "v3.0":
        path = folder / TASKS
        try:
            file_inside(folder, path)
            columns = pq.read_table(path).to_pydict()
        except FileNotFoundError:
            return []
        except (OSError, pa.ArrowException) as error:
            raise unreadable(path, error) from error
        names: list[Any] = next((values for name, values in columns.items() if name != "task_index"), [])
        return list(zip(columns["task_index"], names, strict=True))
    rows = read_lines(folder, folder / "meta" / "tasks.jsonl", True)
    return [(row["task_index"], row["task"]) for row in rows]


def read_json(folder: Path, name: Path) -> Any:
    """Return the content of a JSON file of a data set. Raises DatasetError."""
    path = folder / name
    try:
        if file_inside(folder, path).stat().st_size > LARGEST_JSON:
            raise DatasetError(f"{path} is larger than {LARGEST_JSON >> 20} MB")
        return parse_json(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        if (folder / PRIVATE / "change").exists():
            raise DatasetError(
                f"{folder} has a change that was interrupted. "
                f"Run `joshua dataset repair {folder}` to complete it"
            ) from error
        raise DatasetError(f"{folder} is not a data set: it has no {path.relative_to(folder)}") from error
    except (OSError, ValueError) as error:
        raise unreadable(path, error) from error


def read_lines(folder: Path, path: Path, needed: bool) -> Iterator[dict[str, Any]]:
    """Yield the objects of a file of JSON lines. Raises DatasetError; for a missing file only if needed."""
    try:
        file_inside(folder, path)
        with path.open(encoding="utf-8") as file:
            for line in iter(lambda: file.readline(LARGEST_LINE), ""):
                if len(line) >= LARGEST_LINE:
                    raise DatasetError(f"{path} has a line above {LARGEST_LINE >> 20} MB")
                if line.strip():
                    yield dict(parse_json(line))
    except FileNotFoundError as error:
        if needed:
            raise DatasetError(f"{path} is missing") from error
    except (OSError, ValueError, TypeError) as error:
        raise unreadable(path, error) from error
