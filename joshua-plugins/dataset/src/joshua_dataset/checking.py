"""Find what makes a data set unfit for training or replay, in its files, rows, statistics and pictures.

A part that cannot be read hides nothing of the others. What was not looked at is not judged, see ``Looked``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from joshua.features import EpisodeError
from joshua_jobs.executor import Executor
from joshua_jobs.processes import in_order

from joshua_dataset import changes, open_episode
from joshua_dataset.checks import agreement, contents, episodes, info, rows, tasks, times
from joshua_dataset.checks import videos as headers
from joshua_dataset.checks.contents import Contents
from joshua_dataset.checks.data_statistics import Together
from joshua_dataset.checks.hopeless import is_hopeless
from joshua_dataset.checks.one_episode import Found, Job, check_episode
from joshua_dataset.checks.problem import Kind, Problem, computing, repairing
from joshua_dataset.checks.rows import Rows
from joshua_dataset.checks.videos import VideoFile, Videos
from joshua_dataset.output import counted
from joshua_dataset.reader import Episode

#: Beginnings of the kinds whose repair changes no row.
_NOT_OF_ROWS = ("info-", "tasks-", "unfinished")


@dataclass
class Looked:
    """What a check has looked at.

    Attributes:
        episodes: whose values were read; rows: of all tables that could be read.
        videos: whose headers were read; pictures: that were decoded.
    """

    episodes: int = 0
    rows: int = 0
    videos: int = 0
    pictures: int = 0

    def __str__(self) -> str:
        seen = [counted(self.episodes, "episode"), counted(self.rows, "row")]
        if self.videos:
            seen.append(f"the headers of {counted(self.videos, 'video')}")
        pictures = counted(self.pictures, "picture") if self.pictures else "no pictures"
        return f"{', '.join(seen)} and {pictures} were read"


def check(
    folder: Path,
    *,
    pictures: bool = True,
    videos: bool = True,
    workers: Executor | int | None = None,
    looked: Looked | None = None,
) -> Iterator[Problem]:
    """Find the problems of a data set.

    Args:
        folder: of the data set; pictures: decode them, too, and compare the times of all pictures.
        videos: read their headers; without, nothing of the videos is judged.
        workers: an executor, or processes; None for one per core.
        looked: filled in with what was looked at, complete after the last problem.

    Raises:
        DatasetError: the folder is not a data set, or a change of it was interrupted.
    """
    looked = looked if looked is not None else Looked()
    there = contents.read(folder)
    of_rows = rows.read(there)
    of_videos = headers.read(there) if videos else Videos()
    recorded_hz = times.rate_hz(there, of_rows, of_videos)
    looked.rows, looked.videos = of_rows.count, sum(file.is_open for file in of_videos.files)
    has_remedy = not is_hopeless(there, of_rows, of_videos)

    def told(problem: Problem) -> Problem:
        is_curable = has_remedy or problem.kind is Kind.UNFINISHED
        return problem if is_curable else replace(problem, remedy=None)

    is_sound = True
    for problem in _of_files(there, of_rows, of_videos, recorded_hz):
        # statistics of rows that a repair changes would have to be computed again
        is_sound = is_sound and not (problem.serious and _is_of_rows(problem.kind))
        yield told(problem)
    if pictures and videos:
        files = [(folder, file, recorded_hz) for file in _to_demux(of_videos, recorded_hz)]
        for found in in_order(headers.moments, files, workers):
            yield from map(told, found)
    together = Together(there)
    remedy = computing(folder) if is_sound else repairing(folder)
    jobs = _jobs(there, of_rows, of_videos, recorded_hz, remedy, pictures=pictures and videos)
    for done in in_order(check_episode, jobs, workers):
        yield from map(told, done.problems)
        _look(looked, done)
        together.add(done)
    of_all = together.problems(remedy, are_all_read=of_rows.are_all_read and there.has_all_rows)
    yield from map(told, of_all)


def _is_of_rows(kind: Kind) -> bool:
    """Return whether the repair of a problem changes rows, or how they are read."""
    return kind is Kind.INFO_FEATURE or not kind.value.startswith(_NOT_OF_ROWS)


def _of_files(there: Contents, of_rows: Rows, of_videos: Videos, recorded_hz: float) -> Iterator[Problem]:
    """Yield the problems of the files, and of what they say of each other."""
    yield from _unfinished(there.folder)
    yield from there.problems
    yield from info.problems(there)
    yield from tasks.problems(there)
    yield from episodes.problems(there)
    yield from of_rows.problems
    yield from agreement.problems(there, of_rows)
    yield from of_videos.problems
    yield from headers.problems(there, of_videos, recorded_hz)
    yield from times.problems(there, of_rows, of_videos)


def _unfinished(folder: Path) -> Iterator[Problem]:
    if changes.is_interrupted(folder):
        yield Problem(Kind.UNFINISHED, "a change was interrupted", remedy=repairing(folder))
    try:
        if open_episode.read_journal(folder) is not None:
            text = "an episode is unfinished, or is being recorded"
            yield Problem(Kind.UNFINISHED, text, serious=False, remedy=repairing(folder))
    except (EpisodeError, OSError) as error:
        yield Problem(Kind.UNREADABLE, str(error))


def _to_demux(of_videos: Videos, recorded_hz: float) -> Iterator[VideoFile]:
    """Yield the videos whose pictures are at the rate of the rows, as far as their headers tell."""
    for file in of_videos.files:
        if file.is_open and recorded_hz and not times.is_off(file, recorded_hz):
            yield file


def _jobs(
    there: Contents,
    of_rows: Rows,
    of_videos: Videos,
    recorded_hz: float,
    remedy: tuple[str, ...],
    *,
    pictures: bool,
) -> Iterator[Job]:
    """Yield the episodes that are described, then those of which there are only rows."""
    if there.dataset is None:
        return
    dataset = replace(there.dataset, fps=max(1, round(recorded_hz)))
    unusable = {file.path for file in of_videos.files if not file.is_open}
    unusable |= {file.path for file in of_videos.missing}
    stretches = of_rows.by_episode()
    described = set()
    for episode in there.episodes():
        described.add(episode.index)
        if there.has_messages:
            yield Job(dataset, episode, False, remedy, pictures)
        elif episode.index in stretches:
            shown = {key: where for key, where in episode.pictures.items() if where.path not in unusable}
            table = stretches[episode.index][0].file
            whole = replace(episode, table=table, pictures=shown)
            yield Job(dataset, whole, there.version != "v2.0", remedy, pictures)
    for index, parts in stretches.items():
        if index not in described:
            length = sum(part.count for part in parts)
            yield Job(dataset, Episode(index, length, (), parts[0].file), False, remedy, pictures)


def _look(looked: Looked, done: Found) -> None:
    looked.episodes += 1
    looked.pictures += done.pictures
