"""Mend a damaged data set: the result takes its place only when ``check`` finds no damage in it."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import av
import pyarrow as pa
from joshua.api.files import free_name, is_system_error
from joshua.features import EpisodeError, Feature
from joshua_jobs.executor import Executor

from joshua_dataset.changes import Change, aside_name
from joshua_dataset.checking import Looked, check
from joshua_dataset.checks.problem import Kind, Problem
from joshua_dataset.files import Files, aside_folder
from joshua_dataset.mending import evidence as gathering
from joshua_dataset.mending import footage
from joshua_dataset.mending.evidence import Evidence
from joshua_dataset.mending.footage import Video
from joshua_dataset.mending.planning import Plan, plan
from joshua_dataset.mending.rebuilding import Rebuilding
from joshua_dataset.output import counted
from joshua_dataset.pictures import ERRORS
from joshua_dataset.reader import Dataset, DatasetError
from joshua_dataset.transform import copied_messages

#: Findings about what was recorded, which no change of the files cures; and those that are no damage.
NOT_OF_FILES = frozenset({Kind.NOT_FOLLOWED, Kind.UNFINISHED})

#: Attempts, each without the episodes in which the one before has left damage.
_ATTEMPTS = 4

#: Findings that a message names.
_MOST_NAMED = 8


@dataclass
class Mended:
    """What became of a damaged data set.

    Attributes:
        episodes: how many are kept; frames: of them.
        cut: what ends an episode early, by the number that it had; aside: why an episode is not kept.
        notes: what else was changed.
        place: folder with the files that were replaced, in the data set.
        left: what ``check`` finds in the data set now, nothing of it serious damage; looked: at what.
    """

    episodes: int
    frames: int
    place: Path
    cut: dict[int, str] = field(default_factory=dict)
    aside: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    left: list[Problem] = field(default_factory=list)
    looked: Looked = field(default_factory=Looked)

    def lines(self) -> list[str]:
        """Return what was kept, cut and moved aside, a line each."""
        found = [f"kept: {self.episodes} episodes, {self.frames} frames"]
        found += [f"cut: episode {number}: {why}" for number, why in self.cut.items()]
        found += [f"moved aside: {name}: {why}" for name, why in self.aside.items()]
        found += [f"corrected: {note}" for note in self.notes]
        found.append(f"moved aside, nothing deleted: the files as they were are in {self.place}")
        return found


def damage_of(problems: Sequence[Problem]) -> list[Problem]:
    """Return the problems that are damage of files: those that are serious, and what a repair cures."""
    return [
        item
        for item in problems
        if item.kind not in NOT_OF_FILES and (item.serious or _is_cured(item.remedy))
    ]


def _is_cured(remedy: Sequence[str] | None) -> bool:
    """Return whether a repair does what a remedy does: it computes the statistics, too."""
    return remedy is not None and tuple(remedy[1:3]) in (("dataset", "repair"), ("dataset", "stats"))


def mend(folder: Path, task: str, files: Files, workers: Executor | int | None) -> Mended:
    """Mend a data set whose lock is held, and in which ``check`` found damage.

    Args:
        task: of the rows for which nothing says it, "" for none.

    Raises:
        EpisodeError: it cannot be mended; it stays as it is.
        OSError: the system refuses it; it stays as it is, or the change is completed later.
    """
    change = Change(folder, files)
    change.begin()
    try:
        return _Mending(folder, task, change, workers).run()
    except (pa.ArrowException, av.FFmpegError, DatasetError) as error:
        if is_system_error(error):
            raise OSError(getattr(error, "errno", 0), str(error), str(folder)) from error
        raise EpisodeError(f"{folder} cannot be mended: {error}. Nothing was changed") from error
    finally:
        change.discard()


class _Mending:
    """One attempt after the other to make a data set in which ``check`` finds no damage."""

    def __init__(self, folder: Path, task: str, change: Change, workers: Executor | int | None) -> None:
        self._folder, self._task, self._change, self._workers = folder, task, change, workers
        self._videos: dict[tuple[Path, int], Video] = {}
        self._refused: dict[int, str] = {}
        self._left: list[Problem] = []
        self._looked = Looked()

    def run(self) -> Mended:
        """Mend the data set. Raises as ``mend``."""
        messages = self._messages()
        if messages is not None:
            return self._commit(messages, {}, {}, [], set())
        evidence = gathering.read(self._folder)
        for _ in range(_ATTEMPTS):
            found = plan(evidence, self._mended, self._refused, self._task)
            self._require_something(found)
            rebuilding = Rebuilding(evidence, found, self._change.made, self._workers)
            rebuilding.write()
            left = self._check_made()
            if not left:
                notes = _notes(evidence, found)
                return self._commit(
                    Dataset.read(self._change.made), found.cut, found.aside, notes, rebuilding.unchanged
                )
            self._refuse(found, left)
            self._change.clear_made()
        raise self._hopeless([str(problem) for problem in left])

    def _messages(self) -> Dataset | None:
        """Mend a data set of ROS 2 messages: keep the episodes without damage; None for other data sets."""
        with contextlib.suppress(DatasetError):
            dataset = Dataset.read(self._folder)
            if dataset.format != "mcap":
                return None
            damage = damage_of(list(check(self._folder, workers=self._workers)))
            torn = {number for problem in damage for number in problem.concerned}
            kept = [episode.index for episode in dataset.episode_list() if episode.index not in torn]
            if not kept:
                raise self._hopeless([str(problem) for problem in damage])
            copied_messages(dataset, kept, self._change.made)
            left = self._check_made()
            if left:
                raise self._hopeless([str(problem) for problem in left])
            return Dataset.read(self._change.made)
        return None

    def _check_made(self) -> list[Problem]:
        """Return what is serious in the result; keep all that ``check`` finds in it."""
        self._looked = Looked()
        checked = check(self._change.made, workers=self._workers, looked=self._looked)
        self._left = [self._in_place(problem) for problem in checked]
        return [problem for problem in damage_of(self._left) if problem.serious]

    def _in_place(self, problem: Problem) -> Problem:
        """Return a problem of the result with the paths that it will have."""
        made, folder = str(self._change.made), str(self._folder)
        remedy = problem.remedy and tuple(word.replace(made, folder) for word in problem.remedy)
        return replace(problem, text=problem.text.replace(made, folder), remedy=remedy)

    def _mended(self, video: Video, camera: Feature, fps: int) -> Video:
        """Make a video whole and evenly timed, once. Raises OSError of the system."""
        known = self._videos.get((video.path, fps))
        if known is not None:
            return known
        made = video
        if video.whole and not video.is_as_described(fps):
            place = self._change.place / "videos"
            place.mkdir(exist_ok=True)
            target = place / f"{len(self._videos):06d}.mp4"
            made = self._copied(video, target, fps, camera)
        self._videos[video.path, fps] = made
        return made

    @staticmethod
    def _copied(video: Video, target: Path, fps: int, camera: Feature) -> Video:
        try:
            copied = footage.copy(video, target, video.whole, fps, camera.shape[0], camera.shape[1])
        except (*ERRORS, ValueError) as error:
            if is_system_error(error):
                raise
            return footage.without_pictures(video)
        if not copied.is_as_described(fps):
            return footage.without_pictures(video)
        return footage.mended(video, copied)

    def _require_something(self, found: Plan) -> None:
        if found.unknown:
            numbers = ", ".join(map(str, found.unknown))
            raise EpisodeError(
                f"{self._folder}: nothing says the task of episode {numbers}. Nothing was changed. "
                f'Run `joshua dataset repair {self._folder} --task "TEXT"` with what the robot does there'
            )
        if not found.parts:
            raise self._hopeless([f"{name}: {why}" for name, why in found.aside.items()])

    def _hopeless(self, reasons: Sequence[str]) -> EpisodeError:
        named = "; ".join(reason.rstrip(".") for reason in reasons[:_MOST_NAMED]) + (
            "; …" if len(reasons) > _MOST_NAMED else ""
        )
        return EpisodeError(
            f"{self._folder} cannot be mended without inventing something: {named or 'it has no row'}. "
            "Nothing was changed. Restore these files from a copy"
        )

    def _refuse(self, found: Plan, left: Sequence[Problem]) -> None:
        """Leave the episodes out in which damage is left. Raises EpisodeError if it is not in episodes."""
        damaged = {number: problem.text for problem in left for number in problem.concerned}
        if not damaged:
            raise self._hopeless([str(problem) for problem in left])
        for number, text in damaged.items():
            if number < len(found.parts):
                self._refused.setdefault(found.parts[number].run.number, text)

    def _commit(
        self,
        made: Dataset,
        cut: dict[int, str],
        aside: dict[str, str],
        notes: list[str],
        unchanged: set[str],
    ) -> Mended:
        """Let the result take the place of the data set, whose other files are moved aside."""
        place = free_name(aside_folder(self._folder), aside_name("repair"))
        self._change.retire_all(place, without=unchanged)
        self._change.put_made(without=unchanged)
        self._change.commit()
        return Mended(made.episodes, made.frames, place, cut, aside, notes, self._left, self._looked)


def _notes(evidence: Evidence, found: Plan) -> list[str]:
    """Return what was changed beside the episodes."""
    notes = []
    if evidence.info.get("fps") != found.fps:
        notes.append(f"fps is {found.fps} by the rows and the videos, and was {evidence.info.get('fps')}")
    for key, value in found.described.items():
        known = evidence.info["features"].get(key)
        if not isinstance(known, dict):
            notes.append(f"the feature {key} is described as its column is")
            continue
        notes += [
            f"the {name} of {key} is {value[name]}, and was {known.get(name)}"
            for name in ("dtype", "shape", "names")
            if name in value and known.get(name) != value[name]
        ]
    if evidence.tasks != dict(enumerate(found.texts)):
        notes.append(f"the table of tasks has {', '.join(map(repr, found.texts))}")
    videos = {clip.video.path for part in found.parts for clip in part.clips.values() if clip.video}
    copied = sum(not path.is_relative_to(evidence.folder / "videos") for path in videos)
    if copied:
        ends = "ends with its" if copied == 1 else "end with their"
        notes.append(
            f"{counted(copied, 'video')} now {ends} last whole picture; the rate is that of the rows"
        )
    notes.append("index, frame_index, timestamp, the table of episodes and the statistics, from the rows")
    return notes
