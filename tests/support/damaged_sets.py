"""Small data sets in LeRobot's layouts v3.0 and v2.1, and the damage that others do to them.

Four episodes at 10 Hz with two joints and one camera. In the layout v3.0 they share one table and one video,
in v2.1 each has its own.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from joshua_dataset import metadata
from joshua_dataset.recomputing import recompute
from small_dataset import TOP, layout

FPS = 10
LENGTHS = (6, 5, 7, 4)
TASKS = ("wave", "point")

V30, V21 = "v3.0", "v2.1"

#: The episode that is damaged where a damage is in one episode.
VICTIM = 1

Damage = Callable[[Path, str], object]


def make(folder: Path, version: str) -> None:
    """Write a data set without damage."""
    tables = [rows_of(number) for number in range(len(LENGTHS))]
    info = metadata.info(layout(folder), "lerobot", episodes=4, frames=sum(LENGTHS), tasks=2)
    del info["joshua"], info["features"]["stamp_ns"]
    (folder / "meta").mkdir(parents=True)
    if version == V30:
        _put(folder / rows_path(V30), pa.concat_tables(tables))
        encode(folder / video_path(V30), sum(LENGTHS))
        _put(folder / episodes_path(), pa.Table.from_pylist([described(number) for number in range(4)]))
        _put(folder / metadata.TASKS, metadata.tasks_table(TASKS))
    else:
        info |= {
            "codebase_version": V21,
            "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
            "video_path": "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
            "total_videos": 4,
            "total_chunks": 1,
        }
        for number, table in enumerate(tables):
            _put(folder / rows_path(V21, number), table)
            encode(folder / video_path(V21, number), LENGTHS[number], first=sum(LENGTHS[:number]))
        rows = [
            {"episode_index": number, "tasks": [TASKS[number % 2]], "length": length}
            for number, length in enumerate(LENGTHS)
        ]
        lines(folder, "episodes", rows)
        lines(folder, "tasks", [{"task_index": index, "task": text} for index, text in enumerate(TASKS)])
    (folder / metadata.INFO).write_text(json.dumps(info))
    recompute(folder, workers=1)


def rows_of(number: int) -> pa.Table:
    length, first = LENGTHS[number], sum(LENGTHS[:number])
    frames = np.arange(length)
    values = np.stack([np.sin((first + frames) / 3), np.cos((first + frames) / 3)], axis=1).astype(np.float32)
    kind = pa.list_(pa.float32(), 2)
    return pa.table(
        {
            "observation.state": pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), type=kind),
            "action": pa.FixedSizeListArray.from_arrays(pa.array((values + 0.05).ravel()), type=kind),
            "timestamp": pa.array((frames / FPS).astype(np.float32)),
            "frame_index": pa.array(frames),
            "episode_index": pa.array(np.full(length, number)),
            "index": pa.array(first + frames),
            "task_index": pa.array(np.full(length, number % 2)),
        }
    )


def described(number: int) -> dict[str, Any]:
    first, length = sum(LENGTHS[:number]), LENGTHS[number]
    return {
        "episode_index": number,
        "tasks": [TASKS[number % 2]],
        "length": length,
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": first,
        "dataset_to_index": first + length,
        f"videos/{TOP}/chunk_index": 0,
        f"videos/{TOP}/file_index": 0,
        f"videos/{TOP}/from_timestamp": first / FPS,
        f"videos/{TOP}/to_timestamp": (first + length) / FPS,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }


def encode(path: Path, count: int, *, first: int = 0, rate: int = FPS, side: int = 0) -> None:
    """Write a video, all pictures of which can be told apart."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as target:
        stream: Any = target.add_stream("libx264", rate=rate, options={"g": "2", "bf": "0"})
        stream.height, stream.width, stream.pix_fmt = side or 24, side or 32, "yuv420p"
        for number in range(first, first + count):
            picture = np.random.default_rng(number).integers(
                0, 256, (stream.height, stream.width, 3), np.uint8
            )
            for packet in stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")):
                target.mux(packet)
        for packet in stream.encode():
            target.mux(packet)


def rows_path(version: str, number: int = VICTIM) -> str:
    if version == V30:
        return "data/chunk-000/file-000.parquet"
    return f"data/chunk-000/episode_{number:06d}.parquet"


def video_path(version: str, number: int = VICTIM) -> str:
    if version == V30:
        return f"videos/{TOP}/chunk-000/file-000.mp4"
    return f"videos/chunk-000/{TOP}/episode_{number:06d}.mp4"


def episodes_path() -> str:
    return "meta/episodes/chunk-000/file-000.parquet"


def lines(folder: Path, name: str, rows: list[dict[str, Any]]) -> None:
    text = "".join(json.dumps(row) + "\n" for row in rows)
    (folder / f"meta/{name}.jsonl").write_text(text)


def read_lines(folder: Path, name: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / f"meta/{name}.jsonl").read_text().splitlines()]


def _put(path: Path, table: pa.Table) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path)


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
        _put(
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
        _put(path, change(pq.read_table(path), first_row(version)))

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
        _put(
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
        _put(path, pa.Table.from_pylist(rows, schema=found.schema))

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
