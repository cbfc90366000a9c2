"""``joshua runs``: list, show, compare and prune the folders of trainings and evaluations."""

from __future__ import annotations

import argparse
import json
import sys
import textwrap
from pathlib import Path
from typing import Any

SUMMARY = "list, show, compare and prune runs of trainings and evaluations"

_WIDTH = 80
_NARROWEST_NAME = 20

#: Short names of the kinds in a list, where width is scarce.
_KINDS = {"training": "train", "evaluation": "eval"}
_DAY_S = 86_400.0

#: Most settings and figures that a comparison shows if many differ.
_MOST_ROWS = 40


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the actions of ``joshua runs``."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listed = actions.add_parser("list", help="list the runs in a folder, the newest last")
    _parent(listed)
    show = actions.add_parser("show", help="show settings, versions, figures and checkpoints of a run")
    show.add_argument("name", metavar="RUN", help="folder of a run, or its name below runs/")
    compare = actions.add_parser(
        "compare", help="show the differences between runs, and their figures side by side"
    )
    compare.add_argument("names", nargs="+", metavar="RUN", help="as for show")
    compare.epilog = (
        "Two evaluations from the same seeds are compared episode by episode: McNemar's exact test for "
        "rates, a bootstrap of the differences for means."
    )
    for reading in (listed, show, compare):
        reading.add_argument(
            "--format", choices=("text", "json"), default=argparse.SUPPRESS, help="output format"
        )
    prune = actions.add_parser("prune", help="remove old runs and checkpoints")
    _parent(prune)
    prune.add_argument(
        "--keep-checkpoints", type=_count, metavar="N", help="remove all but the newest N of each run"
    )
    prune.add_argument(
        "--older-than", type=_days, metavar="DAYS", help="remove runs that have not changed for this time"
    )
    prune.add_argument("--empty", action="store_true", help="remove runs without a checkpoint and results")
    prune.add_argument("--yes", action="store_true", help="remove them (default: only list them)")
    prune.epilog = "A run that a process uses, or that changed in the last ten minutes, is left alone."


def run(arguments: argparse.Namespace) -> int:
    """Run the action. Exit code 0; 1 for a run that cannot be read, 2 for a wrong argument."""
    from joshua.tools import ExitCode

    from joshua_training.run_folder import RunError

    try:
        return int(globals()[f"_{arguments.action}"](arguments))
    except _WrongArgument as error:
        sys.stderr.write(f"joshua runs {arguments.action}: {error}\n")
        return ExitCode.INVALID
    except RunError as error:
        sys.stderr.write(f"joshua runs {arguments.action}: {error}\n")
        return ExitCode.FAILED


class _WrongArgument(Exception):
    """The command line names something that does not exist."""


def _list(arguments: argparse.Namespace) -> int:
    from joshua.tools import columns

    from joshua_training.summaries import find_runs, summarise

    parent = _existing(arguments.folder)
    summaries = [summarise(found) for found in find_runs(parent)]
    if _as_json(arguments):
        _write(json.dumps([summary.as_json() for summary in summaries], indent=2))
        return 0
    if not summaries:
        _write(f"{parent} contains no run. A run is a folder with run.json, which a training creates")
        return 0
    rows = [["RUN", "KIND", "STEPS", "RESULT"]]
    for summary in summaries:
        result = "cannot be read" if summary.problem else summary.result
        rows.append([summary.name, _KINDS.get(summary.kind, summary.kind), _number(summary.steps), result])
    others = sum(2 + max(len(row[index]) for row in rows) for index in (1, 2, 3))
    for row in rows:
        row[0] = _shortened(row[0], max(_NARROWEST_NAME, _WIDTH - others))
    _write("\n".join(line[:_WIDTH] for line in columns(rows, right=(2,))))
    return 0


def _show(arguments: argparse.Namespace) -> int:
    from joshua_training.run_folder import RunError
    from joshua_training.summaries import summarise

    folder = _opened(arguments.name)
    summary = summarise(folder)
    if summary.problem:
        raise RunError(summary.problem)
    if _as_json(arguments):
        _write(json.dumps(summary.as_json(), indent=2))
        return 0
    unit = "episodes" if summary.kind == "evaluation" else "steps"
    lines = [summary.path, f"  {summary.kind} of {summary.task or 'unknown task'}, started {summary.started}"]
    lines.append(f"  {_number(summary.steps)} {unit}: {summary.result or 'no figures yet'}")
    lines.append(f"  checkpoints: {summary.checkpoints}, {_size(summary.bytes)} in all")
    if summary.git:
        changed = ", with changes" if summary.git.get("changed") else ""
        lines.append(f"  git: {summary.git.get('commit', '')}{changed}")
    lines += _paragraph("settings", summary.settings)
    lines += _paragraph("figures", {name: _figure(value) for name, value in summary.figures.items()})
    lines += _paragraph("versions", summary.versions)
    _write("\n".join(lines))
    return 0


def _compare(arguments: argparse.Namespace) -> int:
    from joshua.tools import columns

    from joshua_training.run_folder import RunError
    from joshua_training.summaries import EVALUATION, compared_episodes, differing_settings, summarise

    if len(arguments.names) < 2:
        raise _WrongArgument("one run cannot be compared: name two or more")
    folders = [_opened(name) for name in arguments.names]
    summaries = [summarise(folder) for folder in folders]
    for summary in summaries:
        if summary.problem:
            raise RunError(summary.problem)
    different = differing_settings(summaries)
    names = [
        name
        for name in dict.fromkeys(name for summary in summaries for name in summary.figures)
        if all(name in summary.figures for summary in summaries)
    ]
    are_paired = len(folders) == 2 and all(summary.kind == EVALUATION for summary in summaries)
    differences, reason = {}, ""
    if are_paired:
        try:
            differences = compared_episodes(*folders)
        except RunError as error:
            reason = str(error)
    if _as_json(arguments):
        content = {
            "runs": [summary.as_json() for summary in summaries],
            "settings": different,
            "paired": {name: vars(found) for name, found in differences.items()},
            "not_paired": reason,
        }
        _write(json.dumps(content, indent=2))
        return 0
    lines = [f"{_letter(index)}  {summary.path}" for index, summary in enumerate(summaries)]
    head = ("", *(_letter(index) for index in range(len(summaries))))
    width = max(6, (_WIDTH - 26) // len(summaries) - 2)
    for title, rows in (
        ("SETTING", [(name, *map(_text, values)) for name, values in different.items()]),
        ("FIGURE", [(name, *(_figure(summary.figures[name]) for summary in summaries)) for name in names]),
    ):
        if rows:
            cells = [[_shortened(row[0], 26), *(_shortened(cell, width) for cell in row[1:])] for row in rows]
            lines += ["", *columns([(title, *head[1:]), *cells[:_MOST_ROWS]])]
    if not different:
        lines += ["", "The settings are the same."]
    if differences:
        rows = [("B - A", "DIFFERENCE", "INTERVAL", "BETTER", "WORSE", "P")]
        rows += [
            (
                name,
                _known(found.value, "+.4g"),
                "none" if found.low is None else f"{found.low:+.3g} to {found.high:+.3g}",
                str(found.better),
                str(found.worse),
                _known(found.p_value, ".3g"),
            )
            for name, found in differences.items()
        ]
        lines += ["", *columns(rows, right=(1, 3, 4, 5))]
    lines += [f"\nNot compared episode by episode: {reason}"] if reason else []
    _write("\n".join(lines))
    return 0


def _prune(arguments: argparse.Namespace) -> int:
    from joshua.tools import ExitCode

    from joshua_training.run_folder import RunError, RunFolder
    from joshua_training.summaries import find_runs, removals, removals_left, remove

    parent = _existing(arguments.folder)
    if arguments.keep_checkpoints is None and arguments.older_than is None and not arguments.empty:
        raise _WrongArgument("no criterion was given: add --keep-checkpoints N, --older-than DAYS or --empty")

    def left_alone(run: RunFolder, why: str) -> None:
        sys.stderr.write(f"joshua runs prune: {run.path} is left alone, because {why}\n")

    listed = removals(
        find_runs(parent),
        keep_checkpoints=arguments.keep_checkpoints,
        older_than_s=None if arguments.older_than is None else arguments.older_than * _DAY_S,
        empty=arguments.empty,
        left_alone=left_alone,
    )
    found = [*removals_left(parent), *listed]
    freed = failures = 0
    for removal in found:
        try:
            if arguments.yes:
                remove(removal)
        except RunError as error:  # the others can be removed all the same
            sys.stderr.write(f"joshua runs prune: {error}\n")
            failures += 1
            continue
        freed += removal.bytes
        _write(f"{removal.path}: {removal.reason}, {_size(removal.bytes)}")
    if not found:
        _write("Nothing to remove")
    elif arguments.yes:
        _write(f"Removed: {_size(freed)}")
    else:
        _write(f"Nothing was removed. Add --yes to free {_size(freed)}")
    return ExitCode.FAILED if failures else ExitCode.OK


def _parent(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "folder",
        nargs="?",
        type=Path,
        default=Path("runs"),
        metavar="FOLDER",
        help="folder of runs (default runs)",
    )


def _existing(folder: Path) -> Path:
    if not folder.is_dir():
        raise _WrongArgument(
            f"there is no folder {folder}: name the output_folder of the training (default: runs beside its "
            "file)"
        )
    return folder


def _opened(name: str) -> Any:
    from joshua.tools import nearest_first

    from joshua_training.run_folder import RunFolder
    from joshua_training.summaries import find_runs

    for path in (Path(name), Path("runs") / name):
        if (path / "run.json").is_file():
            return RunFolder.open(path)
    known = nearest_first(name, [found.path.name for found in find_runs(Path("runs"))])[:3]
    near = f"; in runs/ there are {', '.join(known)}" if known else ""
    raise _WrongArgument(f"{name} is not a run, because it has no run.json{near}")


def _as_json(arguments: argparse.Namespace) -> bool:
    return getattr(arguments, "format", "text") == "json"


def _paragraph(title: str, values: Any) -> list[str]:
    if not values:
        return []
    text = ", ".join(f"{name} {_text(value)}" for name, value in values.items())
    return textwrap.wrap(
        f"  {title}: {text}", _WIDTH, subsequent_indent="    ", break_on_hyphens=False, break_long_words=False
    )


def _text(value: Any) -> str:
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "none"}[value]
    if isinstance(value, float):
        return f"{value:g}"
    return json.dumps(value) if isinstance(value, (list, dict)) else str(value)


def _figure(value: float) -> str:
    return f"{value:.5g}"


def _known(value: float | None, form: str) -> str:
    return "none" if value is None else format(value, form)


def _letter(index: int) -> str:
    return chr(ord("A") + index) if index < 26 else str(index + 1)


def _number(value: int) -> str:
    return f"{value:,}" if value else "0"


def _size(count: int) -> str:
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count = count / 1000  # type: ignore[assignment]
    return f"{count:.3g} GB"


def _shortened(text: str, width: int) -> str:
    """Shorten a text in the middle, because the ends distinguish names."""
    if len(text) <= width:
        return text
    half = (width - 1) // 2
    return f"{text[: width - 1 - half]}…{text[len(text) - half :]}"


def _write(text: str) -> None:
    sys.stdout.write(text + "\n")


def _count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number of at least 0")
    return int(text)


def _days(text: str) -> float:
    try:
        days = float(text)
    except ValueError:
        days = -1.0
    if not 0 < days < 1e6:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number of days above 0")
    return days
