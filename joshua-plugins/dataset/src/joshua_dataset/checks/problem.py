"""Problems of data sets: what kind each is, where it is, and the command that cures it."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path


class Kind(str, Enum):
    """What is wrong, by a name that does not change.

    «Contradicts» means: another field, file or statistic of the data set says something else.
    """

    UNFINISHED = "unfinished"
    """A change or an episode was interrupted."""
    POINTER = "pointer"
    """A Git LFS pointer stands in the place of a file."""
    ELSEWHERE = "elsewhere"
    """A path leads out of the data set."""
    UNREADABLE = "unreadable"
    """The system does not let a file be read, which is no damage of the file."""

    INFO_TORN = "info-torn"
    """``meta/info.json`` cannot be read."""
    INFO_VERSION = "info-version"
    """The layout's version is unknown, or the files have another layout."""
    INFO_FIELD = "info-field"
    """A field of ``meta/info.json`` is missing, or has a wrong type or range."""
    INFO_FPS = "info-fps"
    """``fps`` contradicts the timestamps and the videos."""
    INFO_TOTALS = "info-totals"
    """A total contradicts what is there."""
    INFO_SPLITS = "info-splits"
    """A split names episodes that do not exist, or leaves some out."""
    INFO_PATH = "info-path"
    """A path template names no file of the data set."""
    INFO_FEATURE = "info-feature"
    """The dtype, shape or names of a feature contradict each other, or are unusable."""
    INFO_VIDEO = "info-video"
    """What is said of a video contradicts the feature or the file."""

    TASKS_MISSING = "tasks-missing"
    """There is no table of tasks."""
    TASKS_TORN = "tasks-torn"
    """The table of tasks cannot be read, or lacks a column."""
    TASKS_UNORDERED = "tasks-unordered"
    """Task i is not at row i, where LeRobot looks for it."""
    TASKS_REPEATED = "tasks-repeated"
    """A task or its index occurs twice."""
    TASK_UNKNOWN = "task-unknown"
    """A row or an episode names a task that does not exist."""
    TASKS_CONTRADICT = "tasks-contradict"
    """The tasks of an episode are others than those of its rows."""

    EPISODES_MISSING = "episodes-missing"
    """There is no table of episodes."""
    EPISODES_TORN = "episodes-torn"
    """A table of episodes cannot be read."""
    EPISODES_COLUMN = "episodes-column"
    """A column of the episodes is missing, or has values that are missing or of a wrong type."""
    EPISODES_LOST = "episodes-lost"
    """Episodes are not described."""
    EPISODES_UNORDERED = "episodes-unordered"
    """Episode i is not at row i, where LeRobot looks for it."""
    EPISODE_LENGTH = "episode-length"
    """The length of an episode contradicts its rows."""
    EPISODE_RANGE = "episode-range"
    """``dataset_from_index`` or ``dataset_to_index`` contradicts the rows."""
    EPISODE_FILE = "episode-file"
    """A chunk or file index names a file that does not contain the episode."""
    EPISODE_VIDEO = "episode-video"
    """The times of an episode in its video contradict its length, or each other."""

    ROWS_MISSING = "rows-missing"
    """A table of rows is missing."""
    ROWS_TORN = "rows-torn"
    """A table of rows cannot be read."""
    ROWS_COLUMN = "rows-column"
    """A column of the rows is missing, not described, or has values of another type or shape."""
    ROWS_UNCOUNTED = "rows-uncounted"
    """Rows belong to no episode."""
    ROWS_NOT_FINITE = "rows-not-finite"
    """A value is missing, infinite or not a number."""
    EPISODE_INDEX = "episode-index"
    """The rows of the episodes do not follow each other."""
    FRAME_INDEX = "frame-index"
    """``frame_index`` does not count from 0 in an episode."""
    INDEX_GAP = "index-gap"
    """``index`` leaves numbers out: LeRobot then returns another frame's action."""
    INDEX_REPEATED = "index-repeated"
    """``index`` repeats numbers, or goes back."""
    INDEX_OFFSET = "index-offset"
    """``index`` does not begin at 0."""
    TIMESTAMP = "timestamp"
    """``timestamp`` is not ``frame_index`` / ``fps``."""
    STAMPS = "stamps"
    """The acquisition stamps do not increase."""

    VIDEO_MISSING = "video-missing"
    """A video is missing."""
    VIDEO_TORN = "video-torn"
    """A video cannot be opened or decoded."""
    VIDEO_SHORT = "video-short"
    """A video has fewer pictures than its episodes."""
    VIDEO_LONG = "video-long"
    """A video has more pictures than its episodes."""
    VIDEO_RATE = "video-rate"
    """A video has another rate than ``fps``, or its pictures are at other times than the rows."""
    VIDEO_SIZE = "video-size"
    """The pictures of a video have another size than is described."""
    VIDEO_CODEC = "video-codec"
    """A video has another codec than is described."""
    PICTURES_MISSING = "pictures-missing"
    """Picture files, or pictures in a table, are missing."""
    PICTURES_TORN = "pictures-torn"
    """A picture cannot be decoded, or has another size than is described."""

    STATISTICS_MISSING = "statistics-missing"
    """There is no ``meta/stats.json``, or it lacks a feature or a figure."""
    STATISTICS_TORN = "statistics-torn"
    """The statistics cannot be read, or have another shape than their feature."""
    STATISTICS_NOT_FINITE = "statistics-not-finite"
    """A statistic is infinite or not a number."""
    STATISTICS_CONTRADICT = "statistics-contradict"
    """The statistics of the data set contradict its rows or pictures, or each other."""
    EPISODE_STATISTICS = "episode-statistics"
    """The statistics of an episode are missing, or contradict its rows or each other."""

    MESSAGES_MISSING = "messages-missing"
    """The file of an episode's messages, or a topic in it, is missing."""
    MESSAGES_TORN = "messages-torn"
    """Messages cannot be read, or fewer are whole than are described."""

    RECORDING_GAP = "recording-gap"
    """Nothing was recorded for a while."""
    FROZEN = "frozen"
    """A camera delivers the same picture for a while."""
    REPEATED = "repeated"
    """Many pictures repeat the previous one: the camera is slower than the frame rate."""
    JUMP = "jump"
    """A joint moves farther between two frames than it can."""
    OUT_OF_RANGE = "out-of-range"
    """A joint is outside its calibrated range."""
    NOT_FOLLOWED = "not-followed"
    """The action moves, and the state does not."""
    LISTS_OF_ONE = "lists-of-one"
    """Features of one number are stored as lists, which LeRobot does not load."""

    def __str__(self) -> str:
        return self.value


#: Stands for a folder that the user chooses, in the words of a command.
TARGET = "TARGET"


@dataclass(frozen=True)
class Problem:
    """One problem of a data set.

    Attributes:
        kind: of the problem; text: what was found, where, and what is right, without a remedy.
        episode: its index, -1 for several of them or the data set as a whole.
        episodes: those of a file that holds several; empty otherwise.
        serious: training or replaying would fail or learn something wrong.
        remedy: words of the command that cures it, with ``TARGET`` in the place of a new folder; None if
            no command does.
    """

    kind: Kind
    text: str
    episode: int = -1
    serious: bool = True
    remedy: tuple[str, ...] | None = None
    episodes: tuple[int, ...] = ()

    @property
    def concerned(self) -> frozenset[int]:
        """Episodes without which the problem would be gone; empty if it is one of the whole data set."""
        return frozenset(self.episodes) | ({self.episode} if self.episode >= 0 else set())

    @property
    def sentence(self) -> str:
        """Where it is, and what was found, without the remedy."""
        if self.episodes:
            return f"episodes {spelled(self.episodes)}: {self.text}"
        return f"episode {self.episode}: {self.text}" if self.episode >= 0 else self.text

    def __str__(self) -> str:
        then = f". Run `{shlex.join(self.remedy)}`" if self.remedy else ""
        return f"{'error' if self.serious else 'warning'}: {self.sentence}{then}"


def of_episodes(problem: Problem, indices: Iterable[int]) -> Problem:
    """Return a problem of a file with the episodes that the file holds."""
    known = tuple(sorted(set(indices)))
    if len(known) == 1:
        return replace(problem, episode=known[0], episodes=())
    return replace(problem, episode=-1, episodes=known)


def spelled(indices: Sequence[int]) -> str:
    """Return numbers in rising order as ranges, such as ``0-3,7``, which ``--episodes`` takes."""
    ranges: list[list[int]] = []
    for index in indices:
        if ranges and index == ranges[-1][1] + 1:
            ranges[-1][1] = index
        else:
            ranges.append([index, index])
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in ranges)


def repairing(folder: Path) -> tuple[str, ...]:
    """Return the command that mends a data set."""
    return ("joshua", "dataset", "repair", str(folder))


def computing(folder: Path) -> tuple[str, ...]:
    """Return the command that replaces the statistics of a data set by those of its data."""
    return ("joshua", "dataset", "stats", "--write", str(folder))


def converting(folder: Path) -> tuple[str, ...]:
    """Return the command that writes a data set anew."""
    return ("joshua", "dataset", "convert", str(folder), TARGET)
