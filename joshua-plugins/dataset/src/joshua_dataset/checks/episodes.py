"""Check the tables of episodes by themselves: LeRobot takes row i for episode i."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import pyarrow as pa
from joshua.api.files import UnsafePathError

from joshua_dataset.checks import tasks
from joshua_dataset.checks.contents import EPISODES, Contents, EpisodeRow, is_whole, shown
from joshua_dataset.checks.problem import Kind, Problem, repairing
from joshua_dataset.metadata import INFO
from joshua_dataset.reader import DatasetError

#: Columns of whole numbers that LeRobot reads, in the layout v3.0.
_WHOLE = (
    *("episode_index", "length", "data/chunk_index", "data/file_index"),
    *("dataset_from_index", "dataset_to_index"),
)

#: Columns that LeRobot reads to append an episode.
_PLACE = ("meta/episodes/chunk_index", "meta/episodes/file_index")


def problems(contents: Contents) -> Iterator[Problem]:
    """Yield the problems of the tables of episodes."""
    yield from _columns(contents)
    videos, known = video_columns(contents), tasks.texts(contents)
    for row in contents.rows:
        yield from _values(contents, row)
        yield from _times(contents, row, videos)
        yield from _tasks(contents, row, known)
        yield from _place(contents, row)
    yield from _paths(contents)
    yield from _order(contents)
    yield from _ranges(contents)
    yield from _totals(contents)


def video_columns(contents: Contents) -> dict[str, tuple[str, ...]]:
    """Return the names of the columns of each video, by the key of its feature."""
    if contents.dataset is None or not contents.is_v3 or contents.has_messages:
        return {}
    names = ("chunk_index", "file_index", "from_timestamp", "to_timestamp")
    return {
        feature.key: tuple(f"videos/{feature.key}/{name}" for name in names)
        for feature in contents.dataset.features.pictures
        if contents.dataset.pictures != "table" and _is_stored_apart(contents, feature.key)
    }


def _is_stored_apart(contents: Contents, key: str) -> bool:
    return "joshua" in contents.info or contents.features[key].get("dtype") == "video"


def _columns(contents: Contents) -> Iterator[Problem]:
    """Yield problems of columns as a whole: those that are missing, or are of another type."""
    needed: dict[str, str] = dict.fromkeys(_WHOLE, "whole numbers")
    needed["tasks"] = "lists of texts"
    for chunk, file, begin, end in video_columns(contents).values():
        needed |= {chunk: "whole numbers", file: "whole numbers", begin: "seconds", end: "seconds"}
    if contents.format == "lerobot":
        needed |= dict.fromkeys(_PLACE, "whole numbers")
    first = next(iter(contents.columns.values()), None)
    for path, schema in contents.columns.items():
        name = contents.name(path)
        for column, wanted in needed.items():
            if column not in schema.names:
                text, serious = f"{name} lacks the column {column}", column not in _PLACE
                yield Problem(Kind.EPISODES_COLUMN, text, serious=serious, remedy=repairing(contents.folder))
            elif not _is_of(schema.field(column).type, wanted):
                kind = schema.field(column).type
                text = f"{name}: the column {column} contains {kind}; it must contain {wanted}"
                yield Problem(Kind.EPISODES_COLUMN, text, remedy=repairing(contents.folder))
        if first is not None and set(schema.names) != set(first.names):
            other = sorted(set(schema.names) ^ set(first.names))[0]
            text = f"{name} and the first table of episodes do not both have the column {shown(other)}"
            yield Problem(Kind.EPISODES_COLUMN, text, remedy=repairing(contents.folder))


def _is_of(kind: pa.DataType, wanted: str) -> bool:
    if wanted == "whole numbers":
        return bool(pa.types.is_integer(kind))
    if wanted == "seconds":
        return bool(pa.types.is_floating(kind))
    is_list = pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)
    if not is_list:
        return False
    inner = kind.value_type
    is_text = pa.types.is_string(inner) or pa.types.is_large_string(inner)
    return bool(is_text or pa.types.is_null(inner))


def _values(contents: Contents, row: EpisodeRow) -> Iterator[Problem]:
    """Yield problems of the values of one row."""
    values, remedy = row.values, repairing(contents.folder)
    where = f"{contents.name(row.file)}, row {row.number}"
    names = _WHOLE if contents.is_v3 else ("episode_index", "length")
    for name in names:
        if name in values and not is_whole(values[name]):
            text = f"{where}: {name} is {shown(values[name])}; it must be a whole number"
            yield Problem(Kind.EPISODES_COLUMN, text, remedy=remedy)
        elif name not in values and not contents.is_v3:
            yield Problem(Kind.EPISODES_COLUMN, f"{where} lacks {name}", remedy=remedy)
    episode = number_of(row)
    if values.get("length") == 0 and not isinstance(values["length"], bool):
        yield Problem(Kind.EPISODE_LENGTH, "its length is 0", episode, remedy=remedy)
    for name in (name for name in values if name.startswith("counts/")):
        if values[name] is not None and not is_whole(values[name]):
            text = f"{shown(name)} is {shown(values[name])}; it must be a whole number"
            yield Problem(Kind.EPISODES_COLUMN, text, episode, serious=False, remedy=None)


def _times(contents: Contents, row: EpisodeRow, videos: Mapping[str, tuple[str, ...]]) -> Iterator[Problem]:
    """Yield problems of the values that say where the pictures of an episode are."""
    values, episode, remedy = row.values, number_of(row), repairing(contents.folder)
    for chunk, file, begin, end in videos.values():
        for name in (chunk, file):
            if name in values and not is_whole(values[name]):
                text = f"{name} is {shown(values[name])}; it must be a whole number"
                yield Problem(Kind.EPISODE_VIDEO, text, episode, remedy=remedy)
        for name in (begin, end):
            if name in values and not _is_time(values[name]):
                text = f"{name} is {shown(values[name])}; it must be a time of 0 s or more"
                yield Problem(Kind.EPISODE_VIDEO, text, episode, remedy=remedy)


def number_of(row: EpisodeRow) -> int:
    """Return the index of the episode of a row; -1 if it has none."""
    index = row.values.get("episode_index")
    return index if isinstance(index, int) and is_whole(index) else -1


def _is_time(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and math.isfinite(value) and value >= 0


def _tasks(contents: Contents, row: EpisodeRow, known: Sequence[str]) -> Iterator[Problem]:
    named, episode, remedy = row.values.get("tasks"), number_of(row), repairing(contents.folder)
    if not isinstance(named, list) or not all(isinstance(text, str) for text in named):
        if "tasks" in row.values or not contents.is_v3:
            text = f"its tasks are {shown(named)}; they must be a list of texts"
            yield Problem(Kind.EPISODES_COLUMN, text, episode, remedy=remedy)
        return
    if not named and not contents.has_messages:
        yield Problem(Kind.TASKS_CONTRADICT, "it has no task", episode, remedy=remedy)
    for text in named:
        if known and text not in known:
            said = f"its task {shown(text)} is not in the table of tasks"
            yield Problem(Kind.TASK_UNKNOWN, said, episode, remedy=remedy)


def _place(contents: Contents, row: EpisodeRow) -> Iterator[Problem]:
    """Yield a problem if a row does not name the file that it is in, which LeRobot appends to."""
    if any(name not in row.values for name in _PLACE):
        return
    told = tuple(row.values[name] for name in _PLACE)
    if not all(map(is_whole, told)):
        text = f"{' and '.join(_PLACE)} are {shown(told[0])} and {shown(told[1])}"
    elif row.file != contents.folder / EPISODES / f"chunk-{told[0]:03d}" / f"file-{told[1]:03d}.parquet":
        text = f"{' and '.join(_PLACE)} are {told[0]} and {told[1]}, but it is in {contents.name(row.file)}"
    else:
        return
    yield Problem(Kind.EPISODE_FILE, text, number_of(row), serious=False, remedy=repairing(contents.folder))


def _paths(contents: Contents) -> Iterator[Problem]:
    """Yield where the paths of an episode lead out of the data set, or cannot be made."""
    dataset, said = contents.dataset, set()
    for row in contents.rows if dataset is not None else ():
        try:
            assert dataset is not None
            dataset.episode_of({"tasks": [], "stats": {}, **row.values})
        except DatasetError as error:
            cause = error.__cause__ or error
            is_elsewhere = isinstance(cause, UnsafePathError)
            text = str(cause) if is_elsewhere else f"its row cannot be used: {type(cause).__name__}: {cause}"
            if text not in said:  # a template leads there for every episode
                kind = Kind.ELSEWHERE if is_elsewhere else Kind.EPISODES_COLUMN
                remedy = None if is_elsewhere else repairing(contents.folder)
                yield Problem(kind, text, number_of(row), remedy=remedy)
            said.add(text)


def _order(contents: Contents) -> Iterator[Problem]:
    indices = [row.values.get("episode_index") for row in contents.rows]
    whole = [index for index in indices if is_whole(index)]
    if not contents.has_all_rows or len(whole) < len(indices) or indices == list(range(len(indices))):
        return
    row = next(row for row, index in enumerate(indices) if row != index)
    twice = len(set(indices)) < len(indices)
    text = (
        f"the row {row} of the table of episodes describes episode {indices[row]}"
        f"{', which is described twice' if twice and indices.count(indices[row]) > 1 else ''}; "
        f"LeRobot takes it for episode {row}"
    )
    yield Problem(Kind.EPISODES_UNORDERED, text, remedy=repairing(contents.folder))


def _ranges(contents: Contents) -> Iterator[Problem]:
    """Yield problems of the ranges of rows, which follow each other without gaps from 0 on."""
    expected: int | None = 0
    for row in contents.rows:
        values = [row.values.get(name) for name in ("dataset_from_index", "dataset_to_index", "length")]
        if not all(map(is_whole, values)):
            expected = None
            continue
        begin, end, length = (int(value) for value in values if value is not None)
        text = ""
        if end - begin != length:
            text = f"dataset_from_index {begin} and dataset_to_index {end} contradict the length {length}"
        elif expected is not None and begin != expected:
            text = f"dataset_from_index is {begin}, and the episodes before it have {expected} rows"
        if text:
            yield Problem(Kind.EPISODE_RANGE, text, number_of(row), remedy=repairing(contents.folder))
        expected = end


def _totals(contents: Contents) -> Iterator[Problem]:
    """Yield problems of the totals; they are not judged by tables that are torn."""
    dataset = contents.dataset
    if dataset is None or not contents.has_all_rows:
        return
    remedy, count = repairing(contents.folder), len(contents.rows)
    if count != dataset.episodes:
        table = EPISODES if contents.is_v3 else "meta/episodes.jsonl"
        text = f"{INFO} counts {dataset.episodes} episodes, and {table} has {count}"
        yield Problem(Kind.EPISODES_LOST, text, remedy=remedy)
    lengths = [row.values.get("length") for row in contents.rows]
    if all(map(is_whole, lengths)):
        frames = sum(length for length in lengths if length is not None)
        if frames != dataset.frames:
            text = f"{INFO} counts {dataset.frames} frames, and the episodes have {frames}"
            yield Problem(Kind.INFO_TOTALS, text, remedy=remedy)
