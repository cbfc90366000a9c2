"""Damage of a data set that the recorder wrote, and where its files are meanwhile."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from lerobot_sets import encode
from small_dataset import TOP


def damage(folder: Path) -> None:
    """Put a value that is no number into an episode, time the video of another one anew, drop statistics."""
    path = folder / "data/chunk-000/file-001.parquet"
    table = pq.read_table(path)
    kind = table.schema.field("action").type
    values = pa.FixedSizeListArray.from_arrays(
        pa.array([0.5, 0.0, float("nan"), 0.0], pa.float32()), type=kind
    )
    pq.write_table(
        table.set_column(table.column_names.index("action"), table.schema.field("action"), values), path
    )
    video = folder / f"videos/{TOP}/chunk-000/file-000.mp4"
    encode(video, 3, rate=11)
    (folder / "meta/stats.json").unlink()


def digests(folder: Path) -> dict[str, str]:
    """Digests of the files of a data set, wherever in its folder they are."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file() and path.suffix in (".parquet", ".mp4")
    }
