"""The damage that others do to data sets, file by file and field by field."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from joshua_dataset import metadata
from lerobot_sets import (
    LENGTHS,
    TASKS,
    V21,
    V30,
    VICTIM,
    encode,
    episodes_path,
    lines,
    read_lines,
    rows_path,
    video_path,
    write_table,
)
from small_dataset import TOP

Damage = Callable[[Path, str], object]


def first_row(version: str) -> int:
    """The first row of the damaged episode in its table."""
    return sum(LENGTHS[:VICTIM]) if version == V30 else 0


def column(name: str, change: Callable[[Any, int], Any]) -> Damage:
    """Change a column; the change gets the values, and the first row of the damaged episode."""

    def damage(folder: Path, version: str) -> None:
        path = folder / rows_path(version)
        table = pq.read_table(path)
        values = change(np.array(table[name].to_pylist()), first_row(version))
        kind = table.schema.field(name)
        write_table(
            path, table.set_column(table.column_names.index(name), kind, pa.array(values.tolist(), kind.type))
        )

    return damage


def put(values: Any, where: Any, value: Any) -> Any:
    values[where] = value
    return values


def table(change: Callable[[pa.Table, int], pa.Table]) -> Damage:
    """Change the table of rows."""

    def damage(folder: Path, version: str) -> None:
        path = folder / rows_path(version)
        write_table(path, change(pq.read_table(path), first_row(version)))

    return damage


def without(found: pa.Table, first: int, end: int) -> pa.Table:
    return pa.concat_tables([found.slice(0, first), found.slice(end)])


def info(change: Callable[[dict[str, Any]], object]) -> Damage:
    def damage(folder: Path, version: str) -> None:
        value = json.loads((folder / metadata.INFO).read_text())
        change(value)
        (folder / metadata.INFO).write_text(json.dumps(value))

    return damage


def feature(key: str, **values: Any) -> Damage:
    return info(lambda value: value["features"][key].update(values))


def file(path: Callable[[str], str], change: Callable[[bytes], bytes | None]) -> Damage:
    """Change the bytes of a file, or remove it."""

    def damage(folder: Path, version: str) -> None:
        place = folder / path(version)
        content = change(place.read_bytes())
        if content is None:
            place.unlink()
        else:
            place.write_bytes(content)

    return damage


def tasks_path(version: str) -> str:
    return "meta/tasks.parquet" if version == V30 else "meta/tasks.jsonl"


def described_path(version: str) -> str:
    return episodes_path() if version == V30 else "meta/episodes.jsonl"


def statistics_path(version: str) -> str:
    return "meta/stats.json" if version == V30 else "meta/episodes_stats.jsonl"


def cut(share: float) -> Callable[[bytes], bytes]:
    return lambda content: content[: int(len(content) * share)]


def tasks(change: Callable[[list[tuple[int, str]]], list[tuple[int, str]]]) -> Damage:
    def damage(folder: Path, version: str) -> None:
        pairs = change(list(enumerate(TASKS)))
        if version == V21:
            lines(folder, "tasks", [{"task_index": index, "task": text} for index, text in pairs])
            return
        path = folder / metadata.TASKS
        schema = pq.read_schema(path)
        columns = [[index for index, _ in pairs], [text for _, text in pairs]]
        write_table(
            path,
            pa.table(dict(zip(schema.names, columns, strict=True))).replace_schema_metadata(schema.metadata),
        )

    return damage


def episodes(change: Callable[[list[dict[str, Any]]], object]) -> Damage:
    """Change the rows of the table of episodes in their list."""

    def damage(folder: Path, version: str) -> None:
        if version == V21:
            rows = read_lines(folder, "episodes")
            change(rows)
            lines(folder, "episodes", rows)
            return
        path = folder / episodes_path()
        found = pq.read_table(path)
        rows = found.to_pylist()
        change(rows)
        write_table(path, pa.Table.from_pylist(rows, schema=found.schema))

    return damage


def of_victim(**values: Any) -> Damage:
    return episodes(lambda rows: rows[VICTIM].update(values))


def statistics(change: Callable[[dict[str, Any]], object]) -> Damage:
    """Change the statistics, of the whole data set or of the damaged episode."""

    def damage(folder: Path, version: str) -> None:
        if version == V21:
            rows = read_lines(folder, "episodes_stats")
            change(rows[VICTIM]["stats"])
            lines(folder, "episodes_stats", rows)
            return
        value = json.loads((folder / metadata.STATS).read_text())
        change(value)
        (folder / metadata.STATS).write_text(json.dumps(value))

    return damage


def video(**options: Any) -> Damage:
    """Encode the video anew, with other options."""

    def damage(folder: Path, version: str) -> None:
        count = sum(LENGTHS) if version == V30 else LENGTHS[VICTIM]
        first = 0 if version == V30 else sum(LENGTHS[:VICTIM])
        fewer = options.get("fewer", 0)
        rest = {name: value for name, value in options.items() if name != "fewer"}
        encode(folder / video_path(version), count - fewer, first=first, **rest)

    return damage


NAN, INF = float("nan"), float("inf")
STATE = "observation.state"
ALL = slice(None)

#: Damage by name.
DAMAGES: dict[str, Damage] = {
    "rows torn": file(rows_path, cut(0.6)),
    "rows empty": file(rows_path, lambda content: b""),
    "rows missing": file(rows_path, lambda content: None),
    "rows lost at the end": table(lambda found, first: found.slice(0, len(found) - 2)),
    "rows lost in the middle": table(lambda found, first: without(found, first + 2, first + 3)),
    "rows lost at the begin": table(lambda found, first: without(found, first, first + 2)),
    "rows repeated": table(
        lambda found, first: pa.concat_tables([found.slice(0, first + 3), found.slice(first + 2)])
    ),
    "rows swapped": column("frame_index", lambda v, i: put(v, [i + 1, i + 2], v[[i + 2, i + 1]])),
    "rows exchanged": table(
        lambda found, first: found.take(
            [*range(first + 1), first + 2, first + 1, *range(first + 3, len(found))]
        )
    ),
    "episode_index wrong": column("episode_index", lambda v, i: put(v, slice(i + 1, i + 3), 3)),
    "episode_index shifted": column("episode_index", lambda v, i: v + 1),
    "frame_index shifted": column("frame_index", lambda v, i: v + 1),
    "frame_index gap": column("frame_index", lambda v, i: put(v, slice(i + 2, i + 4), v[i + 2 : i + 4] + 3)),
    "frame_index repeated": column("frame_index", lambda v, i: put(v, i + 2, v[i + 1])),
    "timestamp jump": column("timestamp", lambda v, i: put(v, slice(i, None), v[i:] + 0.25)),
    "timestamp scaled": column("timestamp", lambda v, i: v * 1.3),
    "timestamp not a number": column("timestamp", lambda v, i: put(v, i + 1, NAN)),
    "index gap": column("index", lambda v, i: put(v, slice(i + 1, None), v[i + 1 :] + 5)),
    "index repeated": column("index", lambda v, i: put(v, i + 1, v[i])),
    "index offset": column("index", lambda v, i: v + 3),
    "index reversed": column("index", lambda v, i: v[::-1].copy()),
    "task unknown": column("task_index", lambda v, i: put(v, i + 1, 9)),
    "task negative": column("task_index", lambda v, i: put(v, i + 1, -1)),
    "task of another episode": column("task_index", lambda v, i: put(v, slice(i, i + 5), 0)),
    "state not a number": column(STATE, lambda v, i: put(v, (i + 2, 1), NAN)),
    "action infinite": column("action", lambda v, i: put(v, (i + 3, 0), INF)),
    "state not a number at first": column(STATE, lambda v, i: put(v, (i, 0), NAN)),
    "state dropped": table(lambda found, first: found.drop_columns([STATE])),
    "index dropped": table(lambda found, first: found.drop_columns(["index"])),
    "timestamp dropped": table(lambda found, first: found.drop_columns(["timestamp"])),
    "index as text": table(
        lambda found, first: found.set_column(5, "index", pa.array([str(row) for row in range(len(found))]))
    ),
    "total_episodes": info(lambda value: value.update(total_episodes=3)),
    "total_episodes too many": info(lambda value: value.update(total_episodes=7)),
    "total_frames": info(lambda value: value.update(total_frames=99)),
    "total_tasks": info(lambda value: value.update(total_tasks=1)),
    "splits": info(lambda value: value.update(splits={"train": "0:9"})),
    "fps": info(lambda value: value.update(fps=25)),
    "fps zero": info(lambda value: value.update(fps=0)),
    "fps missing": info(lambda value: value.pop("fps")),
    "codebase_version": info(lambda value: value.update(codebase_version="v9.0")),
    "data_path": info(lambda value: value.update(data_path="rows/{episode_index}.parquet")),
    "video_path": info(lambda value: value.update(video_path="films/{video_key}.mp4")),
    "shape of a feature": feature("action", shape=[3]),
    "dtype of a feature": feature("action", dtype="float64"),
    "feature missing": info(lambda value: value["features"].pop("action")),
    "feature without a column": info(
        lambda value: value["features"].update(force=value["features"]["action"])
    ),
    "size of the pictures": feature(TOP, shape=[48, 64, 3]),
    "facts of the videos": info(
        lambda value: value["features"][TOP]["info"].update(
            {"video.fps": 3, "video.codec": "vp9", "video.is_depth_map": True, "has_audio": True}
        )
    ),
    "info torn": file(lambda version: "meta/info.json", cut(0.5)),
    "tasks missing": file(tasks_path, lambda content: None),
    "tasks torn": file(tasks_path, cut(0.5)),
    "tasks short": tasks(lambda pairs: pairs[:1]),
    "tasks swapped": tasks(lambda pairs: [(0, TASKS[1]), (1, TASKS[0])]),
    "tasks unordered": tasks(lambda pairs: pairs[::-1]),
    "tasks repeated": tasks(lambda pairs: [*pairs, (1, "again")]),
    "episodes torn": file(described_path, cut(0.5)),
    "episodes missing": file(described_path, lambda content: None),
    "episodes lost": episodes(lambda rows: rows.pop()),
    "episodes lost in the middle": episodes(lambda rows: rows.pop(VICTIM)),
    "episodes unordered": episodes(lambda rows: rows.reverse()),
    "episodes repeated": episodes(lambda rows: rows.append(rows[VICTIM])),
    "length too long": of_victim(length=9),
    "length too short": of_victim(length=2),
    "tasks of an episode": of_victim(tasks=["wave"]),
    "tasks of an episode unknown": of_victim(tasks=["dance"]),
    "statistics missing": file(statistics_path, lambda content: None),
    "statistics torn": file(statistics_path, cut(0.5)),
    "statistics wrong": statistics(lambda value: value["action"].update(max=[9.0, 9.0])),
    "statistics not a number": statistics(lambda value: value["action"].update(mean=[NAN, NAN])),
    "statistics of a feature missing": statistics(lambda value: value.pop("action")),
    "video torn": file(video_path, cut(0.6)),
    "video empty": file(video_path, lambda content: b""),
    "video missing": file(video_path, lambda content: None),
    "video at another rate": video(rate=11),
    "video short": video(fewer=3),
    "video of another size": video(side=48),
}

#: Damage that only the layout v3.0 can have.
OF_V30: dict[str, Damage] = {
    "dataset_from_index": of_victim(dataset_from_index=0),
    "dataset_to_index": of_victim(dataset_to_index=99),
    "file of the rows": of_victim(**{"data/file_index": 4}),
    "file of the video": of_victim(**{f"videos/{TOP}/file_index": 4}),
    "begin in the video": of_victim(**{f"videos/{TOP}/from_timestamp": 0.2}),
    "end in the video": of_victim(**{f"videos/{TOP}/to_timestamp": 99.0}),
    "statistics of an episode": of_victim(**{"stats/action/max": [9.0, 9.0]}),
}

CASES = [
    *((version, name) for version in (V30, V21) for name in DAMAGES),
    *((V30, name) for name in OF_V30),
]


def damage(folder: Path, version: str, name: str) -> None:
    """Damage a data set."""
    (DAMAGES | OF_V30)[name](folder, version)


def damaged(original: Path, folder: Path, version: str, name: str) -> Path:
    """Copy a data set, and damage the copy."""
    shutil.copytree(original, folder)
    damage(folder, version, name)
    return folder
