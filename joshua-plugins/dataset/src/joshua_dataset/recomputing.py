"""Recompute the statistics of a data set from its data, on all cores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq
from joshua.api.files import file_inside, inside
from joshua_jobs.executor import Executor
from joshua_jobs.processes import in_order

from joshua_dataset import statistics
from joshua_dataset.changes import Change, changing
from joshua_dataset.decoding import unreadable
from joshua_dataset.metadata import EPISODES_STATS, INDEX_COLUMNS, STATS
from joshua_dataset.pictures import PICTURE_STRIDE
from joshua_dataset.reader import Dataset, DatasetError, Episode
from joshua_dataset.statistics import PictureStatistics, Statistics

#: Frames that a message names.
_MOST_NAMED = 5


def recompute(folder: Path, *, workers: Executor | int | None = None) -> dict[str, Statistics]:
    """Replace the statistics of a data set and of its episodes by those of its data; return the former.

    Raises:
        EpisodeError, DatasetError: as ``delete``, or a value is not finite; the data set stays unchanged.
    """
    Dataset.read(folder)
    with changing(folder) as change:
        dataset = Dataset.read(folder)
        parts = dict(by_episode(dataset, workers))
        together = together_of(list(parts.values()))
        write(dataset, change, parts, together)
        change.commit()
    return {key: values for key, values in together.items() if key in dataset.features}


def recomputed(folder: Path, *, workers: Executor | int | None = None) -> dict[str, Statistics]:
    """Recompute the statistics of a data set from its data. Raises DatasetError."""
    dataset = Dataset.read(folder)
    together = together_of([part for _, part in by_episode(dataset, workers)])
    return {key: values for key, values in together.items() if key in dataset.features}


def by_episode(
    dataset: Dataset, workers: Executor | int | None
) -> Iterator[tuple[int, dict[str, Statistics]]]:
    """Yield the statistics of each episode, with its index. Raises DatasetError."""
    items = ((dataset.folder, episode) for episode in dataset.episode_list(with_statistics=False))
    yield from in_order(_of_episode, items, workers)


def together_of(parts: Sequence[Mapping[str, Statistics]]) -> dict[str, Statistics]:
    """Merge the statistics of episodes."""
    together: dict[str, Statistics] = {}
    for found in parts:
        for key, part in found.items():
            together[key] = statistics.merged([together[key], part]) if key in together else part
    return together


def write(
    dataset: Dataset,
    change: Change,
    parts: Mapping[int, Mapping[str, Statistics]],
    together: Mapping[str, Statistics],
) -> None:
    """Add all statistics of a data set to a change of it, wherever its layout keeps them.

    Args:
        parts: by episode; together: of the whole data set.

    Raises:
        OSError, pyarrow.ArrowException: writing fails. DatasetError: the table of episodes cannot be read.
    """
    if dataset.version == "v3.0":
        for path, table in _episode_tables(dataset.folder):
            change.table(path, with_statistics(table, parts))
    elif dataset.version == "v2.1":
        change.lines(dataset.folder / EPISODES_STATS, as_lines(parts))
    if dataset.version != "v2.1" or (dataset.folder / STATS).exists():
        values = {key: statistics.as_json(value) for key, value in together.items()}
        change.json(dataset.folder / STATS, values)


def _episode_tables(folder: Path) -> Iterator[tuple[Path, pa.Table]]:
    for path in sorted(inside(folder, "meta/episodes").glob("chunk-*/file-*.parquet")):
        try:
            table = pq.read_table(file_inside(folder, path))
        except (OSError, pa.ArrowException) as error:
            raise unreadable(path, error) from error
        yield path, table


def as_lines(parts: Mapping[int, Mapping[str, Statistics]]) -> Iterator[dict[str, Any]]:
    """Yield the statistics of episodes as LeRobot's layout v2.1 keeps them."""
    for number, part in parts.items():
        values = {key: statistics.as_json(value) for key, value in part.items()}
        yield {"episode_index": number, "stats": values}


def with_statistics(table: pa.Table, parts: Mapping[int, Mapping[str, Statistics]]) -> pa.Table:
    """Return a table of episodes with these statistics in place of its own."""
    kept = [name for name in table.column_names if not name.startswith("stats/")]
    numbers = table.column("episode_index").to_pylist()
    columns = {name: table.column(name) for name in kept}
    found = [
        {key: statistics.as_json(value) for key, value in parts.get(number, {}).items()} for number in numbers
    ]
    names = dict.fromkeys((key, name) for part in found for key, values in part.items() for name in values)
    for key, name in names:
        columns[f"stats/{key}/{name}"] = pa.array([part.get(key, {}).get(name) for part in found])
    return pa.table(columns)


def _of_episode(item: tuple[Path, Episode]) -> tuple[int, dict[str, Statistics]]:
    folder, episode = item
    dataset = Dataset.read(folder)
    columns = dataset.columns(episode)
    found: dict[str, Statistics] = {}
    for key in (*(feature.key for feature in dataset.features.numbers), *INDEX_COLUMNS):
        if key not in columns or (key in INDEX_COLUMNS and key not in dataset.info["features"]):
            continue
        rows = columns[key].reshape(len(columns[key]), -1)
        _require_finite(dataset, episode, key, rows)
        found[key] = statistics.of_rows(rows)
    for feature in dataset.features.pictures:
        seen = PictureStatistics()
        for number, picture in enumerate(dataset.decoded(episode, feature.key)):
            if number % PICTURE_STRIDE == 0:
                seen.add(picture)
        if not seen.pictures:
            raise DatasetError(f"episode {episode.index} of {folder} has no picture of {feature.key}")
        found[feature.key] = seen.result()
    return episode.index, found


def _require_finite(dataset: Dataset, episode: Episode, key: str, rows: npt.NDArray[Any]) -> None:
    if not len(rows):
        raise DatasetError(f"episode {episode.index} of {dataset.folder} has no row in {episode.table}")
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if not len(bad):
        return
    named = ", ".join(map(str, bad[:_MOST_NAMED])) + (", …" if len(bad) > _MOST_NAMED else "")
    raise DatasetError(
        f"{key} has values that are not finite numbers in episode {episode.index} of {dataset.folder}, "
        f"frame {named}, so there are no statistics of it. Run `joshua dataset repair {dataset.folder}` to "
        "cut the episode before them"
    )
