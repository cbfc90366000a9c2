"""Check names and types of the columns of tables of frames, which LeRobot casts to those described."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
from joshua.features import Feature

from joshua_dataset.checks.contents import Contents, shown
from joshua_dataset.checks.problem import Kind, Problem, converting, repairing
from joshua_dataset.metadata import INDEX_COLUMNS, is_list


def problems_of_schema(contents: Contents, path: Path, schema: pa.Schema) -> Iterator[Problem]:
    """Yield the problems of the columns of features in a Parquet table."""
    dataset = contents.dataset
    if dataset is None or path.suffix != ".parquet":
        return
    name, remedy = contents.name(path), repairing(contents.folder)
    dtypes = {key: described.get("dtype") for key, described in contents.features.items()}
    stored = [
        key
        for key in (*dataset.features, *INDEX_COLUMNS)
        if key in dtypes and dtypes[key] not in ("video", "image")
    ]
    in_tables = [key for key in dataset.features if dtypes[key] == "image"]
    if dataset.pictures == "table" or "joshua" not in contents.info:
        stored += in_tables
    for key in stored:
        if key not in schema.names:
            yield Problem(Kind.ROWS_COLUMN, f"{name} lacks the column {key}", remedy=remedy)
    for column in schema.names:
        is_known = column in dtypes and dtypes[column] != "video"
        if contents.format == "lerobot" and not is_known:
            text = f"{name} has the column {shown(column)}, which info.json does not describe: LeRobot fails"
            yield Problem(Kind.ROWS_COLUMN, text, remedy=remedy)
    for feature in dataset.features.numbers:
        if feature.key in schema.names:
            yield from _type(contents, name, feature, schema.field(feature.key).type)


def _type(contents: Contents, name: str, feature: Feature, kind: pa.DataType) -> Iterator[Problem]:
    """Yield a problem if a column has another type than its feature."""
    if len(feature.shape) > 1:
        return  # its lists are nested; the values are checked
    if is_list(kind) and feature.shape == (1,) and contents.format == "lerobot":
        yield Problem(
            Kind.LISTS_OF_ONE,
            "features of one number are stored as lists of length 1, which LeRobot does not load",
            serious=False,
            remedy=converting(contents.folder),
        )
    elif is_list(kind) != (feature.shape != (1,)) and not (is_list(kind) and feature.shape == (1,)):
        text = f"{name}: {feature.key} contains {kind}, and the shape {list(feature.shape)} is described"
        yield Problem(Kind.ROWS_COLUMN, text, remedy=repairing(contents.folder))
        return
    inner = kind.value_type if is_list(kind) else kind
    expected = pa.from_numpy_dtype(np.dtype(feature.dtype))
    if inner == expected:
        return
    is_near = _family(inner) == _family(expected) != ""
    text = f"{name}: {feature.key} contains {inner}, and {feature.dtype} is described"
    yield Problem(Kind.ROWS_COLUMN, text, serious=not is_near, remedy=repairing(contents.folder))


def _family(kind: pa.DataType) -> str:
    families = {
        "floating": pa.types.is_floating,
        "signed": pa.types.is_signed_integer,
        "unsigned": pa.types.is_unsigned_integer,
    }
    return next((name for name, matches in families.items() if matches(kind)), "")


def index_columns(
    contents: Contents, path: Path, table: pa.Table, wanted: Sequence[str]
) -> tuple[Mapping[str, npt.NDArray[Any]], list[Problem]]:
    """Return the index columns of a table that are usable, and the problems of the others."""
    name, remedy = contents.name(path), repairing(contents.folder)
    found: dict[str, npt.NDArray[Any]] = {}
    problems = []
    for column in wanted:
        text = _fault(table, column, is_text=path.suffix != ".parquet")
        if text:
            problems.append(Problem(Kind.ROWS_COLUMN, f"{name} {text}", remedy=remedy))
        else:
            found[column] = table.column(column).to_numpy()
    return found, problems


def _fault(table: pa.Table, column: str, *, is_text: bool) -> str:
    """Return why an index column is not usable; "" if it is.

    Args:
        is_text: the table is one of text, in which times can look like whole numbers.
    """
    if column not in table.column_names:
        return f"lacks the column {column}"
    if table.column_names.count(column) > 1:
        return f"has the column {column} twice"
    values = table.column(column)
    if INDEX_COLUMNS[column].startswith("float"):
        matches = pa.types.is_floating(values.type) or (is_text and pa.types.is_integer(values.type))
    else:
        matches = pa.types.is_integer(values.type)
    if not matches:
        return f"has {values.type} in the column {column}; it must contain {INDEX_COLUMNS[column]}"
    if values.null_count:
        return f"lacks {values.null_count} values of the column {column}"
    if pa.types.is_floating(values.type) and not np.isfinite(values.to_numpy()).all():
        return f"has values that are not finite in the column {column}"
    return ""
