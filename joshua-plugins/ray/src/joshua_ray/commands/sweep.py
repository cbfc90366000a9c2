"""``joshua sweep``: train with many settings, stop the bad ones early, name the best."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua_jobs.choice import add_options, chosen, opened
from joshua_jobs.executor import JobError

if TYPE_CHECKING:
    from joshua_ray.outcomes import Outcome, Record, Sweep
    from joshua_ray.spaces import Space

SUMMARY = "train with many settings on this machine or a cluster, and find the best"

#: Blocks of trainers by method; each has output_folder and resume_run, and writes rows with steps.
BLOCKS = {"METHOD_RL": "ai.training.rl_config", "METHOD_IMITATION": "ai.training.imitation_config"}

#: Metric and mode by method.
METRICS = {"METHOD_RL": ("episode/return", "max"), "METHOD_IMITATION": ("loss/validation", "min")}

#: Beginnings of the names of figures by method: a run that has written one of each has written all.
COMPLETE = {"METHOD_RL": ("episode/", "train/"), "METHOD_IMITATION": ("loss/train", "loss/validation")}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua sweep``."""
    parser.add_argument("file", metavar="FILE", help="file of a training")
    parser.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="FIELD=RANGE",
        help="vary a field: uniform(LOW,HIGH), loguniform(LOW,HIGH), integer(LOW,HIGH), choice(A,B,…) or "
        "grid(A,B,…); or replace it: FIELD=VALUE",
    )
    parser.add_argument(
        "--trials",
        type=_positive,
        default=10,
        metavar="N",
        help="samples of the ranges (default 10); each point of a grid is sampled N times",
    )
    parser.add_argument(
        "--metric", default="", help="a figure of metrics.jsonl (default: the return, or the loss)"
    )
    parser.add_argument(
        "--mode",
        choices=("max", "min"),
        default="",
        help="whether more or less of it is better (default: less of a loss)",
    )
    parser.add_argument(
        "--grace",
        type=_positive,
        default=None,
        metavar="STEPS",
        help="no trial is stopped before (default: a ninth of total_timesteps)",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the samples (default 0)")
    parser.add_argument("--cores", type=float, default=1.0, help="that a trial reserves (default 1)")
    parser.add_argument("--workers", type=_positive, default=None, metavar="N", help="trials at once")
    parser.add_argument(
        "--output",
        type=Path,
        default=None,
        metavar="FOLDER",
        help="of the trials (default: sweeps/ and the time)",
    )
    add_options(parser)
    parser.epilog = (
        "Ray Tune runs the trials, and ASHA stops those that are worse than two thirds of the others. "
        "Without --ray it uses the cores of this machine."
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the sweep.

    Returns:
        0; 1 if all trials or the cluster failed, 2 for a wrong file or range, 130 if it was interrupted.
    """
    from joshua.tools import ExitCode

    from joshua_ray import spaces

    try:
        fixed, varied = spaces.read(arguments.overrides)
        sweep = _sweep(arguments, fixed, varied)
        if sweep is None:
            return ExitCode.INVALID
        with opened(chosen(arguments) or ("ray", "local"), arguments.workers) as cluster:
            tuning = _tuning()
            assert isinstance(cluster, tuning.Cluster)
            if sweep.cores > cluster.largest():
                raise JobError(
                    f"--cores {sweep.cores:g}: no node has more than {cluster.largest():g}. Lower it, or "
                    "start a node that has as many",
                    ExitCode.INVALID,
                )
            _make(Path(sweep.folder))
            sys.stdout.write(f"sweep in {sweep.folder}, on {cluster.cores():g} cores\n")
            sys.stdout.flush()
            record = tuning.run(sweep, varied, cluster, arguments.workers, _shown, _stopping)
    except JobError as error:
        sys.stderr.write(f"joshua sweep: {error}\n")
        return error.exit_code
    was_interrupted = record.interrupt() or len(record.outcomes) < sweep.trials * spaces.points(varied)
    _report(record, varied)  # which a full disk does not prevent
    try:
        record.write()
    except JobError as error:
        sys.stderr.write(f"joshua sweep: {error}\n")
        return error.exit_code
    if was_interrupted:
        sys.stderr.write("interrupted: the trials above keep their last checkpoints\n")
        return ExitCode.INTERRUPTED
    return ExitCode.OK if record.best() is not None else ExitCode.FAILED


def _tuning() -> Any:
    """Import Ray Tune. Raises JobError."""
    try:
        from joshua_ray import tuning
    except ImportError as error:
        raise JobError(
            f"joshua sweep requires Ray Tune, which is not complete ({error}): install joshua-ray[sweep] "
            "(from a clone: ./run --with 'ray[sweep]')",
            3,
        ) from error
    return tuning


def _make(folder: Path) -> None:
    """Create the folder of a sweep. Raises JobError."""
    try:
        if not folder.parent.exists():
            folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(0o700)
    except FileExistsError as error:
        raise JobError(f"{folder} exists already. Name another folder with --output", 2) from error
    except OSError as error:
        raise JobError(
            f"{folder} cannot be created: {error.strerror}. Name another folder with --output"
        ) from error


def _sweep(arguments: argparse.Namespace, fixed: list[str], varied: list[Space]) -> Sweep | None:
    """Check the file with every item and both ends of each range; None if the findings were shown."""
    from joshua.tools import plan, show_findings

    from joshua_ray.outcomes import Sweep

    first = {space.field: space.extremes[0] for space in varied}
    tried = [first, *(first | {space.field: value} for space in varied for value in space.extremes[1:])]
    plans: list[Sequence[Any]] = []
    for values in tried:
        overrides = [*fixed, *(f"{field}={value}" for field, value in values.items())]
        found = plan(arguments.file, overrides=overrides)
        if found.errors or found.plan is None:
            show_findings(found, "text")
            return None
        plans.append(found.plan.nodes)
    trainers = _trainers(plans[0])
    method = _method(trainers)
    if not method:
        raise JobError(
            f"{arguments.file} trains nothing whose settings could be compared. Choose a file with METHOD_RL "
            "or METHOD_IMITATION",
            2,
        )
    for nodes in plans:
        _refuse_unfit(arguments.file, nodes)
    settings = trainers[0].settings
    most = settings.get("total_timesteps") or settings.get("max_steps")
    if most is None and arguments.grace is None:
        raise JobError(
            "the number of steps of this training is not known before it starts. Add --grace STEPS, after "
            "which a trial can be stopped",
            2,
        )
    metric, mode = METRICS[method]
    folder = (
        arguments.output or Path("sweeps") / f"{Path(arguments.file).stem}-{time.strftime('%Y%m%d-%H%M%S')}"
    )
    grace = arguments.grace or max(1, int(most or 0) // 9)
    return Sweep(
        file=str(Path(arguments.file).absolute()),
        block=BLOCKS[method],
        fixed=tuple(fixed),
        folder=str(folder.absolute()),
        metric=arguments.metric or metric,
        mode=arguments.mode or (_usual_mode(arguments.metric) if arguments.metric else mode),
        grace=grace,
        total=int(most or 0),
        trials=arguments.trials,
        seed=arguments.seed,
        cores=arguments.cores,
        complete=COMPLETE[method],
    )


def _refuse_unfit(file: str, nodes: Sequence[Any]) -> None:
    """Refuse trials that would open devices, or wait for the cores that they reserve. Raises JobError."""
    devices = [node.name for node in nodes if node.kind in ("actuator", "sensor")]
    if devices:
        raise JobError(
            f"{file}: ai.training.environment is ENV_REAL: each trial would open the devices "
            f"{', '.join(devices)}, and whoever reaches a Ray cluster can run code in it. Add "
            "--set ai.training.environment=ENV_SIMULATION, and train on the robot with the best settings",
            2,
        )
    if any(node.settings.get("cluster") for node in _trainers(nodes)):
        raise JobError(
            f"{file}: ai.training.cluster: a trial would wait for workers on the cores that the trials "
            "reserve. Remove the block: the trials run on the cluster of --ray",
            2,
        )


def _trainers(nodes: Sequence[Any]) -> list[Any]:
    return [node for node in nodes if "output_folder" in node.settings]


def _usual_mode(metric: str) -> str:
    return "min" if "loss" in metric else "max"


def _method(trainers: list[Any]) -> str:
    if not trainers:
        return ""
    settings = trainers[0].settings
    if "total_timesteps" in settings:
        return "METHOD_RL"
    return "METHOD_IMITATION" if "num_epochs" in settings else ""


def _shown(outcome: Outcome) -> None:
    """Print that a trial begins, goes on elsewhere, or ended."""
    if outcome.state == "running":
        values = ", ".join(f"{field.rpartition('.')[2]} {_short(v)}" for field, v in outcome.fields.items())
        again = " again, because its worker was lost" if outcome.lost else ""
        sys.stdout.write(f"{outcome.trial}: begins{again}: {values}\n")
    else:
        value = "no result" if outcome.value is None else f"{outcome.value:.4g}"
        sys.stdout.write(f"{outcome.trial}: {outcome.state}, {value} after {outcome.steps} steps\n")
    sys.stdout.flush()


def _stopping() -> None:
    """Print that Ctrl-C arrived."""
    sys.stderr.write("stopping: the trials save their last checkpoints (Ctrl-C again ends the wait)\n")
    sys.stderr.flush()


def _report(record: Record, varied: list[Space]) -> None:
    """Print the trials from the best to the worst, and how to run the best."""
    from joshua.tools import Screen, columns

    from joshua_ray.spaces import as_text

    outcomes = record.ranked()
    names = [space.field.rpartition(".")[2] for space in varied]
    rows = [("TRIAL", *names, record.sweep.metric, "STEPS", "STATE")]
    for item in outcomes:
        cells = [_short(item.fields[space.field]) for space in varied]
        value = "-" if item.value is None else f"{item.value:.4g}"
        rows.append((item.trial, *cells, value, str(item.steps), item.state))
    layout = columns(rows, screen=Screen.of(sys.stdout), right=range(1, len(names) + 3), group=0, flexible=0)
    sys.stdout.writelines(f"{line}\n" for line in layout)
    lost = sum(item.lost for item in outcomes)
    if lost:
        sys.stderr.write(f"workers lost: {lost}; their trials were continued elsewhere\n")
    failed = [item for item in outcomes if item.state == "failed"]
    if failed:
        sys.stderr.write(f"{len(failed)} of {len(outcomes)} trials failed. The first, {failed[0].trial}:\n")
        sys.stderr.writelines(f"  {line}\n" for line in failed[0].error.strip().splitlines()[-13:])
    best = record.best()
    if best is not None:
        words = " ".join(f"--set '{field}={as_text(value)}'" for field, value in best.fields.items())
        sys.stdout.write(f"best: {best.run}\n  {words}\n")


def _short(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is less than 1")
    return number
