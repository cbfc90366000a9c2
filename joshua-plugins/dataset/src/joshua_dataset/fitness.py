"""Refuse to use a data set in which a check finds errors, before anything is made of it.

Tables, statistics and the headers of videos are checked; no picture is decoded.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Collection
from pathlib import Path

from joshua.features import EpisodeError
from joshua_jobs.executor import Executor

from joshua_dataset.checking import check
from joshua_dataset.checks.problem import Kind, Problem

#: Problems of what was recorded, which the user may want as it is: they forbid no use.
_OF_RECORDING = (Kind.NOT_FOLLOWED, Kind.STAMPS)

#: Problems that are named in a refusal; `joshua dataset check` names all.
_NAMED = 3


class UnfitError(EpisodeError):
    """A data set has errors that forbid its use.

    Attributes:
        problems: the errors.
    """

    def __init__(self, text: str, problems: tuple[Problem, ...]) -> None:
        super().__init__(text)
        self.problems = problems


def require_fit(
    folder: Path,
    use: str,
    *,
    left_out: Collection[int] = (),
    videos: bool = True,
    workers: Executor | int | None = 1,
) -> list[Problem]:
    """Refuse a data set in which a check finds errors; return the warnings.

    Args:
        folder: of the data set; use: what is refused, such as ``converted``.
        left_out: episodes that are not used, whose problems do not matter.
        videos: read the headers of the videos, too; not where they are elsewhere.
        workers: an executor, or processes.

    Raises:
        UnfitError: it has errors; the message names the first ones, and the remedy.
        DatasetError: the folder is not a data set.
    """
    skipped = frozenset(left_out)
    errors: list[Problem] = []
    warnings: list[Problem] = []
    for problem in check(folder, pictures=False, videos=videos, workers=workers):
        if problem.concerned and problem.concerned <= skipped:
            continue
        is_error = problem.serious and problem.kind not in _OF_RECORDING
        (errors if is_error else warnings).append(problem)
    if errors:
        raise UnfitError(_refusal(folder, use, errors), tuple(errors))
    return warnings


def _refusal(folder: Path, use: str, errors: list[Problem]) -> str:
    named = "; ".join(problem.sentence for problem in errors[:_NAMED])
    more = f"; and {len(errors) - _NAMED} more errors" if len(errors) > _NAMED else ""
    remedies = Counter(problem.remedy for problem in errors if problem.remedy is not None)
    words = remedies.most_common(1)[0][0] if remedies else ("joshua", "dataset", "check", str(folder))
    return f"{folder} cannot be {use}: {named}{more}. Run `{shlex.join(words)}`"
