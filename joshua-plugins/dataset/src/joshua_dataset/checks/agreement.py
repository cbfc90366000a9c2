"""Check the rows against the tables of episodes and tasks, which say what LeRobot takes them for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from joshua_dataset.checks import tasks
from joshua_dataset.checks.contents import Contents, EpisodeRow, shown
from joshua_dataset.checks.episodes import number_of
from joshua_dataset.checks.problem import Kind, Problem, repairing
from joshua_dataset.checks.rows import Rows, Stretch
from joshua_dataset.metadata import INFO
from joshua_dataset.reader import DatasetError


def problems(contents: Contents, rows: Rows) -> Iterator[Problem]:
    """Yield where the rows contradict what is said of them."""
    if contents.has_messages:
        return
    yield from _order(contents, rows)
    by_episode, known = rows.by_episode(), tasks.texts(contents)
    places = list(_places(contents))
    yield from _template(contents, rows, [place for _, place in places])
    for row, place in places:
        stretches = by_episode.get(number_of(row), [])
        yield from _rows(contents, rows, row, place, stretches)
        if stretches:
            yield from _tasks(contents, row, stretches, known)
    described = {number_of(row) for row in contents.rows}
    if contents.has_all_rows:
        for index, stretches in by_episode.items():
            if index not in described:
                yield _uncounted(contents, index, stretches)
    for index, stretches in sorted(by_episode.items()):
        if not all(stretch.frames_are_right in (True, None) for stretch in stretches):
            text = "frame_index does not count from 0 without gaps"
            yield Problem(Kind.FRAME_INDEX, text, max(index, -1), remedy=repairing(contents.folder))
    yield from _totals(contents, rows)


def _order(contents: Contents, rows: Rows) -> Iterator[Problem]:
    """Yield one problem if the rows of the episodes do not follow each other."""
    breaks = [
        (one, two)
        for one, two in pairwise(rows.stretches)
        if two.episode < one.episode or (two.episode == one.episode and two.file != one.file)
    ]
    if not breaks:
        return
    one, two = breaks[0]
    more = f", and {len(breaks) - 1} more such places" if len(breaks) > 1 else ""
    text = (
        f"{contents.name(two.file)}: rows with episode_index {two.episode} follow rows with "
        f"episode_index {one.episode}{more}"
    )
    yield Problem(Kind.EPISODE_INDEX, text, remedy=repairing(contents.folder))


def _places(contents: Contents) -> Iterator[tuple[EpisodeRow, Path | None]]:
    """Yield each row of the tables of episodes with the file of its frames, None if it names none."""
    dataset = contents.dataset
    for row in contents.rows:
        place = None
        if dataset is not None:
            try:
                place = dataset.table_of(row.values)
            except DatasetError:
                place = None  # its columns or the template are named by their own checks
        yield row, place


def _template(contents: Contents, rows: Rows, places: Sequence[Path | None]) -> Iterator[Problem]:
    """Yield one problem if the template of ``info.json`` names no table, and there are some."""
    named = {place for place in places if place is not None}
    if rows.files and named and not any(place.exists() for place in named):
        text = f"{INFO}: data_path is {shown(contents.info.get('data_path'))}, which names no table of data"
        yield Problem(Kind.INFO_PATH, text, remedy=repairing(contents.folder))


def _rows(
    contents: Contents, rows: Rows, row: EpisodeRow, place: Path | None, stretches: Sequence[Stretch]
) -> Iterator[Problem]:
    """Yield where an episode contradicts its rows."""
    episode, remedy = number_of(row), repairing(contents.folder)
    files = list(dict.fromkeys(stretch.file for stretch in stretches))
    if not stretches:
        if place is not None and not place.exists():
            yield Problem(Kind.ROWS_MISSING, f"{contents.name(place)} is missing", episode, remedy=remedy)
        elif rows.are_all_read:
            text = f"no row has the episode_index {episode}"
            yield Problem(Kind.ROWS_MISSING, text, episode, remedy=remedy)
        return
    count, length = sum(stretch.count for stretch in stretches), row.values.get("length")
    if count != length:
        text = (
            f"{', '.join(file.name for file in files)} has {count} frames, and {shown(length)} are described"
        )
        yield Problem(Kind.EPISODE_LENGTH, text, episode, remedy=remedy)
    if place is not None and files != [place]:
        text = f"it is in {', '.join(map(contents.name, files))}, and {contents.name(place)} is described"
        yield Problem(Kind.EPISODE_FILE, text, episode, remedy=remedy)
    first, begin = stretches[0].first, row.values.get("dataset_from_index")
    if contents.is_v3 and first is not None and begin is not None and begin != first:
        text = f"dataset_from_index is {shown(begin)}, and its first row is row {first}"
        yield Problem(Kind.EPISODE_RANGE, text, episode, remedy=remedy)


def _tasks(
    contents: Contents, row: EpisodeRow, stretches: Sequence[Stretch], known: Sequence[str]
) -> Iterator[Problem]:
    """Yield where the tasks of the rows do not exist, or are not those of the episode."""
    if any(stretch.tasks is None for stretch in stretches) or not known:
        return
    used = frozenset().union(*(stretch.tasks or frozenset() for stretch in stretches))
    unknown = sorted(index for index in used if not 0 <= index < len(known))
    if unknown:
        text = f"rows have the task_index {unknown[0]}, and there are the tasks 0 to {len(known) - 1}"
        yield Problem(Kind.TASK_UNKNOWN, text, number_of(row), remedy=repairing(contents.folder))
        return
    told, found = row.values.get("tasks"), {known[index] for index in used}
    if isinstance(told, list) and told and all(isinstance(text, str) for text in told) and set(told) != found:
        text = f"its tasks are {shown(told)}, and those of its rows {shown(sorted(found))}"
        yield Problem(Kind.TASKS_CONTRADICT, text, number_of(row), remedy=repairing(contents.folder))


def _uncounted(contents: Contents, index: int, stretches: Sequence[Stretch]) -> Problem:
    count = sum(stretch.count for stretch in stretches)
    text = f"{contents.name(stretches[0].file)} has {count} rows of episode {index}, which is not described"
    return Problem(Kind.ROWS_UNCOUNTED, text, remedy=repairing(contents.folder))


def _totals(contents: Contents, rows: Rows) -> Iterator[Problem]:
    dataset = contents.dataset
    if dataset is None or not rows.are_all_read or rows.count == dataset.frames:
        return
    text = f"{INFO} counts {dataset.frames} frames, and the tables have {rows.count}"
    yield Problem(Kind.INFO_TOTALS, text, remedy=repairing(contents.folder))
