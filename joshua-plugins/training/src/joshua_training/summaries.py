"""Summaries of runs and their results, from their files alone."""

from __future__ import annotations

import os
import stat
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from joshua.tools import parse_json

from joshua_training.run_folder import RunError, RunFolder, discard, leftovers
from joshua_training.statistics import Difference, paired

#: Result file of an evaluation beside ``run.json``, and its kind there.
RESULTS, EVALUATION = "results.json", "evaluation"

#: Figures that show the quality of a training, the most important first, with their format.
_FIGURES = (
    ("episode/success_rate", "success {:.2f}"),
    ("episode/return", "return {:.4g}"),
    ("loss/validation", "validation loss {:.4g}"),
    ("loss/train", "loss {:.4g}"),
    ("train/loss", "loss {:.4g}"),
)

#: A run whose files changed within this time may still be written to, on another machine for example.
QUIET_S = 600.0

_HIDDEN_SETTINGS = ("output_folder", "resume_run")


@dataclass(frozen=True)
class Summary:
    """One run.

    Attributes:
        kind: ``training`` or ``evaluation``; task: environment or data set; result: in a few words.
        steps: of a training, or episodes of an evaluation; checkpoints: complete ones.
        started: from ``run.json``; changed_s: newest change, since the epoch; bytes: of all.
        figures: the last row of metrics, or the value of each metric of an evaluation.
        problem: why its files cannot be read; "" if they can.
    """

    path: str
    name: str
    kind: str
    task: str
    steps: int
    result: str
    started: str
    changed_s: float
    checkpoints: int
    bytes: int
    figures: Mapping[str, float]
    settings: Mapping[str, Any]
    versions: Mapping[str, str]
    git: Mapping[str, Any] | None
    seed: int | None
    problem: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return the summary for ``--format json``."""
        return asdict(self)


def find_runs(parent: Path) -> list[RunFolder]:
    """Return the runs directly below a folder, or the folder itself if it is one; the newest last."""
    if (parent / "run.json").is_file():
        return [RunFolder(parent)]
    found = [RunFolder(path.parent) for path in parent.glob("*/run.json") if path.is_file()]
    return sorted(found, key=lambda run: ((run.path / "run.json").stat().st_mtime, run.path.name))


def summarise(run: RunFolder) -> Summary:
    """Summarise a run; damaged files give a summary with a problem."""
    try:
        about = run.facts()
        return _summary(run, about, read_rows(run), _results(run))
    except RunError as error:
        problem = str(error)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        problem = f"the files of {run.path} are damaged ({type(error).__name__}: {error}): choose another run"
    return replace(_summary(run, {}, [], {}), problem=problem)


def _summary(
    run: RunFolder, about: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], results: Mapping[str, Any]
) -> Summary:
    last = rows[-1] if rows else {}
    figures = {name: value for name, value in last.items() if _is_number(value)}
    if results:
        figures = {name: entry["value"] for name, entry in _metrics(results).items()}
    files = list(_stats(run.path))
    git = about.get("git")
    return Summary(
        path=str(run.path),
        name=run.path.name,
        kind=str(about.get("kind", "training")),
        task=_task(about),
        steps=int(results["episodes"] if "episodes" in results else last.get("steps", 0)),
        result=_result(results, last),
        started=str(about.get("started", "")),
        changed_s=max((found.st_mtime for found in files), default=0.0),
        checkpoints=len(run.checkpoints()),
        bytes=sum(found.st_size for found in files),
        figures=figures,
        settings=dict(about.get("settings", {})),
        versions=dict(about.get("versions", {})),
        git=git if isinstance(git, Mapping) else None,
        seed=about.get("seed"),
    )


def _stats(folder: Path) -> Iterator[os.stat_result]:
    """Yield the facts of all files, without those that a training removes meanwhile."""
    for path in folder.rglob("*"):
        try:
            found = path.stat()
        except OSError:
            continue
        if stat.S_ISREG(found.st_mode):
            yield found


def read_rows(run: RunFolder) -> list[dict[str, Any]]:
    """Return the metrics of a run without truncated lines. Raises RunError."""
    path = run.path / "metrics.jsonl"
    if not path.is_file():
        return []
    rows = []
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise RunError(f"{path} cannot be read: {error.strerror}") from error
    for line in lines:
        try:
            row = parse_json(line)
        except ValueError:
            continue
        if isinstance(row, dict):
            rows.append(row)
    return rows


def differing_settings(summaries: Sequence[Summary]) -> dict[str, list[Any]]:
    """Return the settings in which runs differ, seed and task first: one value for each run."""
    known: dict[str, list[Any]] = {
        "task": [summary.task for summary in summaries],
        "seed": [summary.seed for summary in summaries],
    }
    names = dict.fromkeys(name for summary in summaries for name in summary.settings)
    for name in names:
        if name not in _HIDDEN_SETTINGS:
            known[name] = [summary.settings.get(name) for summary in summaries]
    return {name: values for name, values in known.items() if any(value != values[0] for value in values)}


def compared_episodes(first: RunFolder, second: RunFolder) -> dict[str, Difference]:
    """Compare two evaluations from the same starts by episode, for each metric that both measured.

    Raises:
        RunError: one of them has no results, or their starts differ.
    """
    ours, theirs = _results(first), _results(second)
    for run, results in ((first, ours), (second, theirs)):
        if not results:
            raise RunError(
                f"{run.path} has no usable {RESULTS}: wait until its evaluation ends, or evaluate again"
            )
    for name in ("environment", "randomise"):
        if ours.get(name) != theirs.get(name):
            raise RunError(
                f"{first.path} and {second.path} are not paired: {name} is {ours.get(name)} and "
                f"{theirs.get(name)}"
            )
    if ours["seeds"] != theirs["seeds"]:
        raise RunError(
            f"{first.path} and {second.path} are not paired, because their episodes began from different "
            "seeds: evaluate both with the same seed and num_episodes"
        )
    own, other = _metrics(ours), _metrics(theirs)
    return {
        name: paired(
            entry["episodes"],
            other[name]["episodes"],
            rate=entry["method"] == "wilson",
            confidence=ours.get("confidence", 0.95),
            seed=ours["seeds"][0] if ours["seeds"] else 0,
        )
        for name, entry in own.items()
        if name in other
    }


#: Reason of a removal that an earlier one began.
_LEFT = "left by an interrupted removal"


@dataclass(frozen=True)
class Removal:
    """Something that pruning removes: a whole run or one checkpoint of it."""

    run: RunFolder
    path: Path
    reason: str
    bytes: int


def removals(
    runs: Iterable[RunFolder],
    *,
    keep_checkpoints: int | None = None,
    older_than_s: float | None = None,
    empty: bool = False,
    now_s: float | None = None,
    left_alone: Callable[[RunFolder, str], None] = lambda run, why: None,
) -> Iterator[Removal]:
    """Yield what pruning would remove. Runs that are in use, or changed within ``QUIET_S``, are left alone.

    So are runs of which anything cannot be read: their age and their content are unknown.

    Args:
        keep_checkpoints: number of newest ones to keep in each run; older_than_s: remove runs unchanged for
            longer; empty: remove runs with neither a checkpoint nor results.
        left_alone: called with a run that cannot be read, and why.
    """
    now_s = time.time() if now_s is None else now_s
    for run in runs:
        if problem := _unreadable(run.path):
            left_alone(run, problem)
            continue
        summary = summarise(run)
        age_s = now_s - summary.changed_s
        if age_s < QUIET_S or _is_used(run):
            continue
        if older_than_s is not None and age_s > older_than_s:
            yield Removal(run, run.path, f"unchanged for {age_s / 86400:.0f} days", summary.bytes)
            continue
        if empty and not summary.checkpoints and not (run.path / RESULTS).is_file():
            yield Removal(run, run.path, "no checkpoint and no results", summary.bytes)
            continue
        for path in leftovers(run.path / "checkpoints"):
            yield Removal(run, path, _LEFT, _size(path))
        if keep_checkpoints is not None:
            whole = run.checkpoints()
            for path in whole[: max(0, len(whole) - keep_checkpoints)]:
                yield Removal(run, path, "older checkpoint", _size(path))


def removals_left(parent: Path) -> Iterator[Removal]:
    """Yield what removals of runs that were killed have left in a folder of runs."""
    for path in leftovers(parent):
        yield Removal(RunFolder(path), path, _LEFT, _size(path))


def remove(removal: Removal) -> None:
    """Remove a run or a checkpoint, see ``discard``.

    Raises:
        RunError: it cannot be removed, or another process uses the run.
    """
    try:
        removal.run.lock(0.0)
        discard(removal.path)
    except OSError as error:
        raise RunError(f"{removal.path} cannot be removed: {error.strerror}") from error
    finally:
        removal.run.unlock()


def _unreadable(folder: Path) -> str:
    """Return why a folder cannot be read as a whole; "" if it can."""

    def refuse(error: OSError) -> None:
        if not isinstance(error, FileNotFoundError):  # a training removes files meanwhile
            raise error

    try:
        for place, _, names in os.walk(folder, onerror=refuse):
            for name in names:
                try:
                    os.lstat(os.path.join(place, name))  # noqa: PTH118
                except FileNotFoundError:
                    continue
            for name in (RESULTS, "run.json"):
                if name in names and Path(place) == folder:
                    Path(place, name).read_bytes()
    except OSError as error:
        return f"{error.filename or folder} cannot be read: {error.strerror}"
    return ""


def _is_used(run: RunFolder) -> bool:
    """Whether a process works in a run, which may write nothing for long."""
    try:
        run.lock(0.0)
    except RunError:
        return True
    except OSError:  # removing it says why
        return False
    run.unlock()
    return False


def _size(folder: Path) -> int:
    return sum(found.st_size for found in _stats(folder))


def _results(run: RunFolder) -> dict[str, Any]:
    try:
        content = parse_json((run.path / RESULTS).read_text(encoding="utf-8"))
        return content if isinstance(content["metrics"], dict) and isinstance(content["seeds"], list) else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def _metrics(results: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return each metric of the first checkpoint of an evaluation."""
    return dict(results["metrics"])


def _task(about: Mapping[str, Any]) -> str:
    return next((str(about[key]) for key in ("environment", "dataset", "task") if about.get(key)), "")


def _result(results: Mapping[str, Any], last: Mapping[str, Any]) -> str:
    if results:
        metrics = _metrics(results)
        success = metrics.get("success_rate")
        if success is not None:
            return f"success {success['value']:.2f} ({success['low']:.2f}-{success['high']:.2f})"
        return ", ".join(f"{name} {entry['value']:.4g}" for name, entry in list(metrics.items())[:1])
    for name, form in _FIGURES:
        if _is_number(last.get(name)):
            return form.format(last[name])
    losses = [name for name in last if "loss" in name and _is_number(last[name])]
    return f"{losses[0]} {last[losses[0]]:.4g}" if losses else ""


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
