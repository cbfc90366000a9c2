"""Leave the damaged episodes of a data set out of what is made of it, in place of refusing all of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from joshua.features import EpisodeError
from joshua_jobs.executor import Executor

from joshua_dataset.checking import check
from joshua_dataset.checks.problem import Kind, Problem, spelled
from joshua_dataset.reader import Dataset

#: Damage that what is made of the episodes does not have: it counts anew, and computes statistics anew.
_MADE_ANEW = frozenset(
    {
        *(Kind.INFO_TOTALS, Kind.INFO_SPLITS, Kind.INDEX_GAP, Kind.INDEX_REPEATED, Kind.INDEX_OFFSET),
        *(Kind.STATISTICS_MISSING, Kind.STATISTICS_TORN, Kind.STATISTICS_NOT_FINITE),
        Kind.STATISTICS_CONTRADICT,
    }
)

#: Findings about what was recorded: the files are as they should be.
_OF_RECORDING = frozenset({Kind.NOT_FOLLOWED, Kind.UNFINISHED})


@dataclass(frozen=True)
class Chosen:
    """The episodes of a data set that are used.

    Attributes:
        episodes: their indices; left_out: what is wrong with each of the others that were asked for.
    """

    episodes: tuple[int, ...]
    left_out: dict[int, str]

    def lines(self, folder: Path) -> list[str]:
        """Return what is left out, a line for each episode."""
        return [f"left out: episode {number} of {folder}: {why}" for number, why in self.left_out.items()]


def whole_episodes(
    folder: Path, wanted: Iterable[int] | None = None, *, workers: Executor | int | None = None
) -> Chosen:
    """Find the episodes of a data set without damage; all their pictures are decoded.

    Args:
        wanted: the episodes that are asked for; None for all.
        workers: an executor, or processes.

    Raises:
        EpisodeError: something else is damaged than single episodes, or no episode is whole.
        DatasetError: the data set cannot be read.
    """
    asked = tuple(range(Dataset.read(folder).episodes)) if wanted is None else tuple(wanted)
    left_out: dict[int, str] = {}
    others: list[Problem] = []
    for problem in check(folder, workers=workers):
        if not problem.serious or problem.kind in _OF_RECORDING:
            continue
        for number in sorted(problem.concerned):
            left_out.setdefault(number, problem.text)
        if not problem.concerned and problem.kind not in _MADE_ANEW:
            others.append(problem)
    if others:
        raise EpisodeError(
            f"{folder} has damage that is not in single episodes, so none can be left out for it: "
            f"{others[0].sentence}. Run `joshua dataset repair {folder}`"
        )
    whole = tuple(number for number in asked if number not in left_out)
    if not whole:
        raise EpisodeError(
            f"{folder}: no episode is whole: {'; '.join(dict.fromkeys(left_out.values()))}. "
            f"Run `joshua dataset repair {folder}`"
        )
    return Chosen(whole, {number: left_out[number] for number in asked if number in left_out})


def advice(problems: Sequence[Problem], command: str) -> str:
    """Return which episodes can be left out, and the command that does; "" if that does not help.

    Args:
        problems: errors of a data set; command: that was refused, in words.
    """
    damaged = sorted({number for problem in problems for number in problem.concerned})
    if not damaged or any(not problem.concerned for problem in problems if problem.kind not in _MADE_ANEW):
        return ""
    label = "episode" if len(damaged) == 1 else "episodes"
    return f", or leave {label} {spelled(damaged)} out: run `{command} --skip-damaged`"
