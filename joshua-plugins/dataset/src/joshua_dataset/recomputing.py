"""Recompute the statistics of a data set from its data, on all cores."""

from __future__ import annotations

from pathlib import Path

from joshua_jobs.executor import Executor
from joshua_jobs.processes import in_order

from joshua_dataset import statistics
from joshua_dataset.changes import changing
from joshua_dataset.metadata import STATS
from joshua_dataset.pictures import PICTURE_STRIDE
from joshua_dataset.reader import Dataset, Episode
from joshua_dataset.statistics import PictureStatistics, Statistics


def recompute(folder: Path, *, workers: Executor | int | None = None) -> dict[str, Statistics]:
    """Replace the statistics of a data set by those of its data; return them.

    Raises:
        EpisodeError, DatasetError: as ``delete``; the data set stays unchanged.
    """
    there = Dataset.read(folder).statistics()
    with changing(folder) as change:
        found = recomputed(folder, workers=workers)
        values = {key: statistics.as_json(value) for key, value in (there | found).items()}
        change.json(folder / STATS, values)
        change.commit()
    return found


def recomputed(folder: Path, *, workers: Executor | int | None = None) -> dict[str, Statistics]:
    """Recompute the statistics of a data set from its data. Raises DatasetError."""
    dataset = Dataset.read(folder)
    together: dict[str, Statistics] = {}
    items = ((folder, episode) for episode in dataset.episode_list())
    for found in in_order(_of_episode, items, workers):
        for key, part in found.items():
            together[key] = statistics.merged([together[key], part]) if key in together else part
    return together


def _of_episode(item: tuple[Path, Episode]) -> dict[str, Statistics]:
    folder, episode = item
    dataset = Dataset.read(folder)
    columns = dataset.columns(episode)
    found = {
        feature.key: statistics.of_rows(columns[feature.key].reshape(episode.length, -1))
        for feature in dataset.features.numbers
    }
    for feature in dataset.features.pictures:
        seen = PictureStatistics()
        for number, picture in enumerate(dataset.decoded(episode, feature.key)):
            if number % PICTURE_STRIDE == 0:
                seen.add(picture)
        found[feature.key] = seen.result()
    return found
