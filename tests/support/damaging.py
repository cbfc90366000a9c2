"""Damages of a data set, one for each way in which each column, field and file of it can be wrong.

They come from what is there, not from what a check knows: a column or field that is added is damaged, too.
"""

from __future__ import annotations

import contextlib
import copy
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq
from joshua.features import DatasetLayout, Feature, FeatureSet, Frame
from joshua_dataset.metadata import INDEX_COLUMNS
from joshua_dataset.writer import LeRobotWriter

#: Files that nobody reads.
UNREAD = ("schema.json", "README.md")

#: Ways in which each of the many columns and figures of statistics is damaged.
OF_STATISTICS = ("dropped", "null", "one off", "NaN")
OF_FIGURES = ("dropped", "null", "text", "short", "one more", "NaN")

#: A Git LFS pointer, as a clone without its large files has it.
POINTER = f"version https://git-lfs.github.com/spec/v1\noid sha256:{'0' * 64}\nsize 12345\n"


#: What no check can see, because nothing else in the data set says the same. The guide lists these classes.
UNSEEN = (
    # what only the person who recorded knows
    *("*: robot_type: [!ln]*", "*: robot_type: null"),
    *(f"*: features.*.names: {way}" for way in ("null", "list", "dropped", "turned round", "other")),
    *(f"*: features.*.unit: {way}" for way in ("null", "list", "dropped", "text", "empty", "other")),
    # what is allowed to be absent
    *(f"*: features.*.info: {way}" for way in ("null", "list", "dropped")),
    *(f"*: features.*.info.*: {way}" for way in ("null", "empty", "dropped")),
    *("*: joshua*: dropped", "*: total_videos: dropped", "*: total_chunks: dropped"),
    # sizes of files that are written in future
    *("*: data_files_size_in_mb: *", "*: video_files_size_in_mb: *", "*: chunks_size: *"),
    # a value that is changed by less than a statistic shows, or exchanged with that of another frame
    *("data/*: observation.state: swapped", "data/*: action: swapped"),
    *("data/*: stamp_ns: shifted", "data/*: stamp_ns: one off", "*: stats/stamp_ns/*: one off"),
    "meta/stats.json: stamp_ns.*: one more",
    *("*: stats/*index/q?0: one off", "*: stats.*index.q?0: one more"),
    # statistics of columns that nothing normalises
    *(
        f"meta/stats.json: {name}{way}"
        for name in INDEX_COLUMNS
        for way in (": dropped", ".*: dropped", ".*: null", ".q?0: one more")
    ),
    # columns that nothing reads
    "meta/tasks.parquet: columns: one more",
)


def is_unseen(name: str) -> bool:
    """Return whether a damage is of a class that no check can see."""
    return any(fnmatchcase(name, pattern) for pattern in UNSEEN)


@dataclass(frozen=True)
class Damage:
    """One damage.

    Attributes:
        name: ``FILE: PLACE: WAY``, the file by its path in the data set.
        apply: does it to a copy of the data set.
    """

    name: str
    apply: Callable[[Path], None]


def damages(folder: Path) -> Iterator[Damage]:
    """Yield every damage of a sound data set; of files that are alike, only one is damaged."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and ".joshua" not in path.parts)
    by_place = {(path.parent, path.suffix): path for path in files if path.name not in UNREAD}
    names = ("info.json", "stats.json")
    for path in dict.fromkeys([*by_place.values(), *(path for path in files if path.name in names)]):
        name = path.relative_to(folder).as_posix()
        yield from _of_file(path, name)
        if path.suffix == ".parquet":
            yield from _of_table(path, name)
        elif path.suffix == ".json":
            yield from _of_json(path, name)
        elif path.suffix == ".jsonl":
            yield from _of_lines(path, name)


def _of_file(path: Path, name: str) -> Iterator[Damage]:
    data = path.read_bytes()
    ways = {
        "removed": None,
        "emptied": b"",
        "cut": data[: len(data) * 6 // 10],
        "pointer": POINTER.encode(),
        "noise": bytes((byte * 7 + 3) % 256 for byte in data[:4000]),
    }
    for way, content in ways.items():
        yield Damage(f"{name}: file: {way}", _writing(name, content))


def _writing(name: str, content: bytes | None) -> Callable[[Path], None]:
    def apply(folder: Path) -> None:
        if content is None:
            (folder / name).unlink()
        else:
            (folder / name).write_bytes(content)

    return apply


def _of_table(path: Path, name: str) -> Iterator[Damage]:
    table = pq.read_table(path)
    for column in table.column_names:
        for way, values in _columns(table, column):
            if column.startswith("stats/") and way not in OF_STATISTICS:
                continue
            yield Damage(f"{name}: {column}: {way}", _replacing(name, column, values))
    if len(table) > 1:
        turned = table.take(list(range(len(table) - 1, -1, -1)))
        for way, changed in {
            "last lost": table.slice(0, len(table) - 1),
            "first lost": table.slice(1),
            "last twice": pa.concat_tables([table, table.slice(len(table) - 1)]),
            "turned round": turned,
        }.items():
            yield Damage(f"{name}: rows: {way}", _storing(name, changed))
    extra = table.append_column("extra", pa.array([0.0] * len(table)))
    yield Damage(f"{name}: columns: one more", _storing(name, extra))


def _columns(table: pa.Table, column: str) -> Iterator[tuple[str, pa.Array | None]]:
    """Yield a column in each way in which it can be wrong; None for no column."""
    kind, values = table.schema.field(column).type, table.column(column).to_pylist()
    middle = len(values) // 2
    yield "dropped", None
    texts = [str(value) for value in values]
    if texts != values:
        yield "text", pa.array(texts)
    lists = {
        "null": _put(values, middle, None),
        "shifted": [_map(value, lambda number: number + 1) for value in values],
        "one off": _put(values, middle, _map(values[middle], lambda number: number + 1)),
        "negative": _put(values, middle, _map(values[middle], lambda number: -1 - number)),
        "huge": _put(values, middle, _map(values[middle], lambda number: 1_000_000)),
        "repeated": _put(values, middle, values[middle - 1]),
        "swapped": _put(_put(values, 0, values[-1]), len(values) - 1, values[0]),
        "NaN": _put(values, middle, _map(values[middle], lambda number: math.nan)),
        "infinite": _put(values, middle, _map(values[middle], lambda number: math.inf)),
        "other text": [_map_text(value) for value in values],
    }
    for way, changed in lists.items():
        if changed == values:
            continue
        try:
            yield way, pa.array(changed, kind)
        except (pa.ArrowException, OverflowError, TypeError, ValueError):
            continue  # the type of the column holds no such value


def _put(values: Sequence[Any], place: int, value: Any) -> list[Any]:
    changed = list(values)
    changed[place] = value
    return changed


def _map(value: Any, change: Callable[[Any], Any]) -> Any:
    """Change the first number in a value."""
    if isinstance(value, list) and value:
        return [_map(value[0], change), *value[1:]]
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return change(value) if is_number else value


def _map_text(value: Any) -> Any:
    if isinstance(value, list):
        return [_map_text(part) for part in value]
    return f"not {value}" if isinstance(value, str) else value


def _replacing(name: str, column: str, values: pa.Array | None) -> Callable[[Path], None]:
    def apply(folder: Path) -> None:
        table = pq.read_table(folder / name)
        place = table.column_names.index(column)
        changed = table.drop_columns([column]) if values is None else table.set_column(place, column, values)
        pq.write_table(changed, folder / name)

    return apply


def _storing(name: str, table: pa.Table) -> Callable[[Path], None]:
    return lambda folder: pq.write_table(table, folder / name)


def _of_json(path: Path, name: str) -> Iterator[Damage]:
    record = json.loads(path.read_text())
    for place in _places(record):
        is_figure = path.name == "stats.json" and len(place) > 1
        for way, changed in _values(record, place):
            if is_figure and way not in OF_FIGURES:
                continue
            label = ".".join(map(str, place))
            yield Damage(f"{name}: {label}: {way}", _writing(name, json.dumps(changed).encode()))


def _of_lines(path: Path, name: str) -> Iterator[Damage]:
    lines = [json.loads(line) for line in path.read_text().splitlines()]

    def written(changed: list[Any]) -> Callable[[Path], None]:
        return _writing(name, "".join(json.dumps(line) + "\n" for line in changed).encode())

    for way, changed in {
        "last lost": lines[:-1],
        "first lost": lines[1:],
        "last twice": [*lines, lines[-1]],
        "turned round": lines[::-1],
    }.items():
        yield Damage(f"{name}: rows: {way}", written(changed))
    for place in _places(lines[-1]):
        for way, changed_line in _values(lines[-1], place):
            label = ".".join(map(str, place))
            yield Damage(f"{name}: {label}: {way}", written([*lines[:-1], changed_line]))


def _places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield each object, each list and each value of a JSON value; of lists of numbers only the list."""
    if path:
        yield path
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _places(inner, (*path, key))


def _values(record: Any, place: tuple[Any, ...]) -> Iterator[tuple[str, Any]]:
    """Yield a JSON value with one place in each way in which it can be wrong."""
    value = record
    for step in place:
        value = value[step]
    changes: dict[str, Any] = {"null": None, "text": "text", "list": [], "number": 7}
    if isinstance(value, bool):
        changes["other"] = not value
    elif isinstance(value, int | float):
        changes |= {"one more": value + 1, "negative": -1, "zero": 0, "half": value + 0.5, "NaN": math.nan}
    elif isinstance(value, str):
        changes |= {"other": f"x{value}", "empty": ""}
    elif isinstance(value, list) and value:
        changes |= {
            "short": value[:-1],
            "long": [*value, value[-1]],
            "one more": _map(value, lambda number: number + 1),
            "NaN": _map(value, lambda number: math.nan),
            "turned round": value[::-1],
            "other": _map_text(value),
        }
    for way, changed in changes.items():
        if changed != value:
            yield way, _with(record, place, changed)
    yield "dropped", _without(record, place)


def _with(record: Any, place: tuple[Any, ...], value: Any) -> Any:
    changed = copy.deepcopy(record)
    inner = changed
    for step in place[:-1]:
        inner = inner[step]
    inner[place[-1]] = value
    return changed


def _without(record: Any, place: tuple[Any, ...]) -> Any:
    changed = copy.deepcopy(record)
    inner = changed
    for step in place[:-1]:
        inner = inner[step]
    del inner[place[-1]]
    return changed


#: Episodes of ``write_sound``: their frames, and their tasks.
LENGTHS = (6, 4, 5)
TASKS = ("wave", "point", "wave")

FPS = 10
JOINTS = ("pan", "lift")
TOP = "observation.images.top"


def value_of(episode: int, number: int) -> list[float]:
    """Joint positions of a frame, rad; no two frames have the same."""
    return [0.1 * number + 0.01 * episode, 0.05 * number - 0.02 * episode]


def picture_of(episode: int, number: int) -> npt.NDArray[np.uint8]:
    """Picture of a frame, (48, 64, 3) RGB, which no other frame has."""
    ramp = np.linspace(20, 200, 64, dtype=np.uint8)
    rolled = np.roll(ramp, 5 * number + 17 * episode)
    return np.stack([np.tile(rolled, (48, 1))] * 3, axis=2)


def write_sound(folder: Path) -> None:
    """Write a data set in which a check finds nothing."""
    features = FeatureSet(
        [
            Feature.joints("observation.state", JOINTS),
            Feature.joints("action", JOINTS),
            Feature.picture(TOP, 48, 64),
        ]
    )
    with contextlib.closing(LeRobotWriter(DatasetLayout(folder, "arm", FPS, features))) as writer:
        writer.open()
        for episode, (length, task) in enumerate(zip(LENGTHS, TASKS, strict=True)):
            for number in range(length):
                values: dict[str, Any] = {
                    "observation.state": value_of(episode, number),
                    "action": value_of(episode, number + 1),
                    TOP: picture_of(episode, number),
                }
                writer.add_frame(Frame(1_000_000_000 * (episode + 1) + number * 100_000_000, values))
            writer.end_episode(task)
