"""Check the table of tasks, which LeRobot reads by its rows: task i is that of row i."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from joshua_dataset.checks.contents import TASK_LINES, Contents, is_whole, shown
from joshua_dataset.checks.problem import Kind, Problem, repairing
from joshua_dataset.metadata import INFO, TASKS


def texts(contents: Contents) -> list[str]:
    """Return the texts of the tasks by their index, as far as the table has them."""
    if not contents.tasks:
        return []
    known = {index: text for index, text in contents.tasks if is_whole(index) and isinstance(text, str)}
    return [known[index] for index in range(len(known)) if index in known] if _is_gapless(known) else []


def _is_gapless(known: dict[Any, Any]) -> bool:
    return set(known) == set(range(len(known)))


def problems(contents: Contents) -> Iterator[Problem]:
    """Yield the problems of the table of tasks."""
    if contents.tasks is None:
        return
    name = contents.name(contents.folder / (TASKS if contents.is_v3 else TASK_LINES))
    remedy = repairing(contents.folder)
    odd = [index for index, _ in contents.tasks if not is_whole(index)]
    if odd:
        yield Problem(Kind.TASKS_TORN, f"{name} has the task_index {shown(odd[0])}", remedy=remedy)
        return
    unnamed = [index for index, text in contents.tasks if not isinstance(text, str)]
    if unnamed:
        yield Problem(Kind.TASKS_TORN, f"{name}: task {unnamed[0]} is no text", remedy=remedy)
    yield from _order(contents, name)
    total = contents.info.get("total_tasks")
    if is_whole(total) and total != len(contents.tasks):
        text = f"{INFO} counts {total} tasks, and {name} has {len(contents.tasks)}"
        yield Problem(Kind.INFO_TOTALS, text, remedy=remedy)
    elif total is not None and not is_whole(total):
        yield Problem(Kind.INFO_TOTALS, f"{INFO}: total_tasks is {shown(total)}", remedy=remedy)
    if contents.is_v3 and contents.format == "lerobot":
        yield from _pandas(contents, name)


def _order(contents: Contents, name: str) -> Iterator[Problem]:
    assert contents.tasks is not None
    remedy = repairing(contents.folder)
    indices = [index for index, _ in contents.tasks]
    for what, values in (("index", indices), ("text", [text for _, text in contents.tasks])):
        twice = [value for value, count in Counter(map(shown, values)).items() if count > 1]
        if twice:
            text = f"{name} has the {what} {twice[0]} twice"
            yield Problem(Kind.TASKS_REPEATED, text, remedy=remedy)
    if indices == list(range(len(indices))) or len(set(indices)) < len(indices):
        return
    row = next(row for row, index in enumerate(indices) if row != index)
    yield Problem(
        Kind.TASKS_UNORDERED,
        f"{name} has task {indices[row]} at row {row}, where LeRobot looks for task {row}",
        remedy=remedy,
    )


def _pandas(contents: Contents, name: str) -> Iterator[Problem]:
    """Yield a problem if the texts are not the index of the table, from which LeRobot takes them."""
    try:
        schema = pq.read_schema(contents.folder / TASKS)
    except (OSError, pa.ArrowException):
        return  # it was whole a moment ago: another process changes the data set
    described = (schema.metadata or {}).get(b"pandas", b"{}")
    try:
        index = json.loads(described).get("index_columns")
    except (ValueError, AttributeError):
        index = None
    column = next((column for column in schema.names if column != "task_index"), None)
    if index != [column]:
        yield Problem(
            Kind.TASKS_TORN,
            f"{name}: the texts are not the index of the table, where LeRobot looks for them",
            remedy=repairing(contents.folder),
        )
