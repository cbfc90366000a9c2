"""Find out whether anything is left that a repair could make a data set of."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import av
import pyarrow as pa
import pyarrow.parquet as pq
from joshua.api.files import file_inside

from joshua_dataset.checks.contents import Contents
from joshua_dataset.checks.rows import Rows
from joshua_dataset.checks.videos import Videos
from joshua_dataset.pictures import ERRORS


def is_hopeless(there: Contents, of_rows: Rows, of_videos: Videos) -> bool:
    """Return whether no episode can be kept, so that a repair is no remedy.

    Without its description, without a table of rows, without a column in all tables, or without a readable
    video of a camera, no episode is whole.
    """
    if there.has_messages or there.is_empty:
        return False
    if not there.info or not of_rows.files:
        return True
    return _lacks_column(there, of_rows.files) or _lacks_camera(there, of_videos)


def _lacks_column(there: Contents, paths: Iterable[Path]) -> bool:
    """Return whether all tables lack a feature."""
    if there.dataset is None or there.suffix != ".parquet":
        return False
    names: set[str] = set()
    for path in paths:
        try:
            names |= set(pq.read_schema(path).names)
        except (OSError, pa.ArrowException):
            return False  # it could be read before
    return any(feature.key not in names for feature in there.dataset.features.numbers)


def _lacks_camera(there: Contents, of_videos: Videos) -> bool:
    """Return whether a camera has no video with a picture, under any name of the layout."""
    unusable = [file for file in of_videos.files if not file.is_open] + of_videos.missing
    usable = {file.key for file in of_videos.files if file.is_open}
    for key in {file.key for file in unusable} - usable:
        paths = [path for path in (there.folder / "videos").rglob("*.mp4") if key in path.parts]
        if not any(_has_picture(there, path) for path in paths):
            return True
    return False


def _has_picture(there: Contents, path: Path) -> bool:
    try:
        file_inside(there.folder, path)
        with av.open(str(path)) as source:
            return next(source.decode(video=0), None) is not None
    except (*ERRORS, IndexError, ValueError):
        return False
