"""Write the data set that is made of what is whole of a damaged one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from joshua.api.files import safe_name
from joshua_jobs.executor import Executor

from joshua_dataset import metadata, recomputing, statistics
from joshua_dataset.files import linked
from joshua_dataset.mending import description, footage
from joshua_dataset.mending.evidence import Evidence
from joshua_dataset.mending.footage import Video
from joshua_dataset.mending.planning import Part, Plan
from joshua_dataset.metadata import EPISODES_STATS, INDEX_COLUMNS, INFO, STATS, TASKS
from joshua_dataset.output import write_json, write_lines, write_table
from joshua_dataset.reader import Dataset

#: Difference between a timestamp and ``frame_index / fps`` that rounding explains, s.
_ROUNDING_S = 1e-4


class Rebuilding:
    """Writes a data set.

    Args:
        evidence: what is there of the damaged one; plan: what is kept of it; target: folder of the new one.
        workers: an executor, or processes; None for one per core.

    Attributes:
        unchanged: files of the new data set that are those of the damaged one, under the same names.
    """

    def __init__(self, evidence: Evidence, plan: Plan, target: Path, workers: Executor | int | None) -> None:
        self._evidence, self._plan, self._target, self._workers = evidence, plan, target, workers
        self._size = description.chunk_size(evidence)
        self.unchanged: set[str] = set()

    def write(self) -> None:
        """Write everything.

        Raises:
            OSError, pyarrow.ArrowException: writing fails. DatasetError: the result cannot be read.
        """
        rows = [self._described(number, part) for number, part in enumerate(self._plan.parts)]
        self._write_tables(rows)
        for feature in self._plan.features.pictures:
            if feature.key in self._plan.parts[0].clips:
                self._write_pictures(feature.key, rows)
        self._write_info()
        self._write_tasks()
        self._write_episodes(rows, {})
        parts = dict(recomputing.by_episode(Dataset.read(self._target), self._workers))
        self._write_episodes(rows, parts)
        together = recomputing.together_of(list(parts.values()))
        if self._evidence.version != "v2.1" or (self._evidence.folder / STATS).exists():
            values = {key: statistics.as_json(value) for key, value in together.items()}
            write_json(self._new(STATS), values)

    def _described(self, number: int, part: Part) -> dict[str, Any]:
        """Return the row of an episode in the table of episodes, without its files and statistics."""
        kept = {name: value for name, value in part.described.items() if not name.startswith("stats/")}
        texts = list(dict.fromkeys(self._plan.texts[index] for index in part.tasks))
        return kept | {"episode_index": number, "tasks": texts, "length": part.length}

    def _place(self, number: int) -> dict[str, int]:
        return {"chunk_index": number // self._size, "file_index": number % self._size}

    def _new(self, name: str | Path) -> Path:
        path = self._target / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def _take(self, source: Path, name: str) -> None:
        """Take a file of the damaged data set over as it is."""
        linked(source, self._new(name))
        if source == self._evidence.folder / name:
            self.unchanged.add(name)

    def _write_tables(self, rows: list[dict[str, Any]]) -> None:
        groups: list[list[int]] = []
        for number, part in enumerate(self._plan.parts):
            before = self._plan.parts[number - 1] if number else None
            if before is not None and before.run.rows is part.run.rows:
                groups[-1].append(number)
            else:
                groups.append([number])
        first = 0
        for number, group in enumerate(groups):
            path = self._table_path(number)
            parts = [self._plan.parts[episode] for episode in group]
            tables = []
            for episode, part in zip(group, parts, strict=True):
                tables.append(self._counted(part, episode, first))
                rows[episode] |= {
                    "data/chunk_index": self._place(number)["chunk_index"],
                    "data/file_index": self._place(number)["file_index"],
                    "dataset_from_index": first,
                    "dataset_to_index": first + part.length,
                }
                first += part.length
            source = parts[0].run.rows
            made = pa.concat_tables(tables)
            if made.equals(source.table, check_metadata=True) and self._evidence.suffix == ".parquet":
                self._take(source.path, path)
            else:
                write_table(self._new(path), made)

    def _table_path(self, number: int) -> str:
        if self._evidence.is_v3:
            return metadata.DATA_PATH.format(**self._place(number)) + self._evidence.suffix
        chunk = number // self._size
        return f"data/chunk-{chunk:03d}/episode_{number:06d}.parquet"

    def _counted(self, part: Part, number: int, first: int) -> pa.Table:
        """Return the rows of an episode, with the columns that count as they must be."""
        table = part.run.rows.table.slice(part.run.first, part.length)
        frames = np.arange(part.length)
        counted = {
            "timestamp": frames / self._plan.fps,
            "frame_index": frames,
            "episode_index": np.full(part.length, number),
            "index": first + frames,
            "task_index": part.tasks,
        }
        for name, values in counted.items():
            kind = pa.from_numpy_dtype(INDEX_COLUMNS[name])
            there = table.schema.field(name).type if name in table.column_names else None
            known = part.run.rows.index.get(name)
            is_text = self._evidence.suffix != ".parquet"
            if known is not None and (there == kind or is_text):
                own = known[part.run.first : part.run.first + part.length]
                near = _ROUNDING_S if name == "timestamp" else 0
                if np.allclose(own, values, rtol=0, atol=near):
                    continue
            column = pa.array(np.asarray(values, INDEX_COLUMNS[name]))
            if there is None:
                table = table.append_column(name, column)
                continue
            table = table.set_column(table.column_names.index(name), name, column)
        if table.schema.metadata is not None and self._has_other_types(table):
            table = table.replace_schema_metadata(None)
        return table

    def _has_other_types(self, table: pa.Table) -> bool:
        """Return whether what the table says of its columns may not be right any more."""
        schema = self._plan.schema
        assert schema is not None, "a table was chosen"
        described = self._evidence.info["features"]
        is_described = all(
            described.get(key, {}).get("dtype") == value.get("dtype")
            and described.get(key, {}).get("shape") == value.get("shape")
            for key, value in self._plan.described.items()
        )
        return not is_described or table.schema.names != schema.names

    def _write_pictures(self, key: str, rows: list[dict[str, Any]]) -> None:
        """Take over the pictures of a camera: all files that are kept, counted anew."""
        name = safe_name(key, "the feature")
        made: dict[Path, int] = {}
        for number, part in enumerate(self._plan.parts):
            clip = part.clips[key]
            if clip.folder is not None:
                self._take_folder(clip.folder, part.length, name, number)
                rows[number] |= self._video_columns(key, number, 0, part.length)
                continue
            assert clip.video is not None, "a clip is a video or a folder"
            at = made.setdefault(clip.video.path, len(made) if self._evidence.is_v3 else number)
            if self._evidence.is_v3:
                rows[number] |= self._video_columns(key, at, clip.first, part.length)
            path = self._video_path(name, at)
            if not (self._target / path).exists():
                self._take_video(clip.video, key, path)

    def _take_video(self, video: Video, key: str, path: str) -> None:
        """Take a video over, up to the last picture that an episode uses."""
        clips = [(part.clips[key], part.length) for part in self._plan.parts]
        end = max(clip.first + length for clip, length in clips if clip.video == video)
        if end < video.whole:
            height, width, _ = self._plan.features[key].shape
            copied = footage.copy(video, self._new(path), end, self._plan.fps, height, width)
            if copied.whole == end:
                return
            self._new(path).unlink()  # its last pictures depend on later ones
        self._take(video.path, path)

    def _video_path(self, name: str, number: int) -> str:
        if self._evidence.is_v3:
            return metadata.VIDEO_PATH.format(video_key=name, **self._place(number))
        return f"videos/chunk-{number // self._size:03d}/{name}/episode_{number:06d}.mp4"

    def _video_columns(self, key: str, file: int, first: int, length: int) -> dict[str, Any]:
        return {
            f"videos/{key}/chunk_index": self._place(file)["chunk_index"],
            f"videos/{key}/file_index": self._place(file)["file_index"],
            f"videos/{key}/from_timestamp": first / self._plan.fps,
            f"videos/{key}/to_timestamp": (first + length) / self._plan.fps,
        }

    def _take_folder(self, source: Path, length: int, name: str, number: int) -> None:
        target = metadata.PICTURES_PATH.format(video_key=name, **self._place(number))
        there = sorted(source.iterdir())
        for path in there[:length]:
            linked(path, self._new(f"{target}/{path.name}"))
        if length == len(there) and source == self._evidence.folder / target:
            self.unchanged.add(target)

    def _write_info(self) -> None:
        plan = self._plan
        videos: dict[str, Sequence[Video]] = {}
        for camera in description.cameras(plan.features, plan.described):
            clips = [part.clips[camera.key].video for part in plan.parts]
            videos[camera.key] = [video for video in clips if video is not None]
        info = description.info_of(
            self._evidence,
            plan.described,
            plan.fps,
            lengths=[part.length for part in plan.parts],
            tasks=len(plan.texts),
            videos=videos,
        )
        write_json(self._new(INFO), info)
        schema = self._evidence.folder / "schema.json"
        if schema.is_file():
            self._take(schema, schema.name)

    def _write_tasks(self) -> None:
        if self._evidence.is_v3:
            write_table(self._new(TASKS), metadata.tasks_table(self._plan.texts))
            return
        lines = [{"task_index": index, "task": text} for index, text in enumerate(self._plan.texts)]
        write_lines(self._new("meta/tasks.jsonl"), lines)

    def _write_episodes(self, rows: Sequence[dict[str, Any]], parts: Mapping[int, Mapping[str, Any]]) -> None:
        if not self._evidence.is_v3:
            write_lines(self._new("meta/episodes.jsonl"), rows)
            if parts and self._evidence.version == "v2.1":
                write_lines(self._new(EPISODES_STATS), recomputing.as_lines(parts))
            return
        names = dict.fromkeys(name for row in rows for name in row)
        here = {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        whole = [{name: row.get(name) for name in names} | here for row in rows]
        table = recomputing.with_statistics(pa.Table.from_pylist(whole), parts)
        write_table(self._new(metadata.EPISODES_PATH.format(chunk_index=0, file_index=0)), table)
