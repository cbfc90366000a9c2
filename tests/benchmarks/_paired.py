"""Runs benchmarks alternately in this checkout and in another one, and prints their figures side by side.

Each checkout runs its own scripts on its own interpreter, once a round, and the one that begins changes with
every round, so that a machine whose load drifts disturbs both alike. The figures are medians of all rounds.
Run: python tests/benchmarks/_paired.py FOLDER [--rounds N] [NAME …]; FOLDER holds a checkout with a .venv.
`nox -s bench -- --against REV` makes such a folder first.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROUNDS = 10
TIMEOUT_S = 600.0
CARRIERS = "joshua-zenoh,joshua-dds"

Figures = dict[str, float]


def start_and_stop_figures(text: str) -> Figures:
    """Figures of start_and_stop.py, in seconds."""
    return {
        f"{name} [s]": float(value) for name, value in re.findall(r"^(\S.*?) +median ([\d.]+) s", text, re.M)
    }


def transport_figures(text: str) -> Figures:
    """Figures of the transport benchmarks: latencies in µs, shares of a core in percent."""
    figures: Figures = {}
    for outcome in json.loads(text.splitlines()[-1]):
        for key, name in (("p50_us", "p50 [µs]"), ("p99_us", "p99 [µs]"), ("lost", "lost")):
            figures[f"{outcome['carrier']} {name}"] = float(outcome[key])
        figures[f"{outcome['carrier']} both sides [%]"] = (
            outcome["sender_percent"] + outcome["receiver_percent"]
        )
    return figures


def check_config_figures(text: str) -> Figures:
    """Figures of check_config.py, in ms."""
    figures: Figures = {}
    for row in re.findall(r"^(\w+) +\d+ +\d+ +([\d.]+) +([\d.]+) +([\d.]+) +\S+$", text, re.M):
        for name, value in zip(("load", "check", "render"), row[1:], strict=True):
            figures[f"{row[0]} {name} [ms]"] = float(value)
    for value in re.findall(r"cold process.*: (\d+) ms", text):
        figures["cold process, load and check [ms]"] = float(value)
    return figures


def wall_time(text: str) -> Figures:
    """The wall time alone counts."""
    return {}


#: For each name: the command less the interpreter, and what reads the figures from its output.
BENCHMARKS: dict[str, tuple[list[str], Callable[[str], Figures]]] = {
    "start_and_stop": (["tests/benchmarks/start_and_stop.py", "1"], start_and_stop_figures),
    "transport_joint_state": (
        ["tests/benchmarks/transport_joint_state.py", "--rounds", "1", "--carriers", CARRIERS],
        transport_figures,
    ),
    "transport_image": (
        ["tests/benchmarks/transport_image.py", "--rounds", "1", "--carriers", CARRIERS],
        transport_figures,
    ),
    "check_config": (["tests/benchmarks/check_config.py"], check_config_figures),
    "validate_only": (
        ["-m", "joshua.cli.main", "--config", "configs/test_mock_hardware.pbtxt", "--validate-only"],
        wall_time,
    ),
    "help": (["-m", "joshua.cli.main", "--help"], wall_time),
}


def main(arguments: list[str] | None = None) -> None:
    """Runs the benchmarks and prints a table for each."""
    parser = argparse.ArgumentParser(description="Benchmarks of two checkouts, side by side.")
    parser.add_argument("other", type=Path, help="another checkout, with its environment in .venv")
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"one of {', '.join(BENCHMARKS)}; all by default"
    )
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    options = parser.parse_intermixed_args(arguments)
    if unknown := [name for name in options.names if name not in BENCHMARKS]:
        parser.error(f"{', '.join(unknown)} cannot be paired; choose from {', '.join(BENCHMARKS)}")
    interpreter = options.other.resolve() / ".venv/bin/python"
    if not interpreter.is_file():
        parser.error(f"{interpreter} does not exist: install the other checkout into a .venv of its own")
    sides = ((ROOT, Path(sys.executable)), (options.other.resolve(), interpreter))
    for name in options.names or BENCHMARKS:
        print_table(name, *compare(name, sides, options.rounds))


def compare(
    name: str, sides: tuple[tuple[Path, Path], tuple[Path, Path]], rounds: int
) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
    """Runs one benchmark in both checkouts, turn and turn about; values by figure, for each side."""
    values: tuple[dict[str, list[float]], dict[str, list[float]]] = ({}, {})
    for side in (0, 1):
        run(name, *sides[side])  # bytecode and file caches are warm before the figures begin
    for number in range(rounds):
        for side in (0, 1) if number % 2 == 0 else (1, 0):
            for figure, value in run(name, *sides[side]).items():
                values[side].setdefault(figure, []).append(value)
    return values


def run(name: str, checkout: Path, interpreter: Path) -> Figures:
    """Runs one benchmark once in one checkout."""
    command, figures = BENCHMARKS[name]
    # Without cached bytecode the time would be that of the compiler; a path would mix the checkouts.
    left_out = ("PYTHONDONTWRITEBYTECODE", "PYTHONPATH", "VIRTUAL_ENV")
    environment = {key: value for key, value in os.environ.items() if key not in left_out}
    with tempfile.TemporaryDirectory() as folder:
        environment |= {"XDG_RUNTIME_DIR": folder, "XDG_STATE_HOME": folder}
        began_s = time.perf_counter()
        done = subprocess.run(
            [interpreter, *command],
            cwd=checkout,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
        )
        wall_s = time.perf_counter() - began_s
    if done.returncode != 0:
        raise SystemExit(f"{name} failed in {checkout}:\n{done.stdout}{done.stderr}")
    return figures(done.stdout) or {"wall time [ms]": 1000 * wall_s}


def print_table(name: str, here: dict[str, list[float]], there: dict[str, list[float]]) -> None:
    """Prints medians and their ratio, and last the ratio of the least values, which disturbances spare."""
    rounds = max(map(len, here.values()), default=0)
    print(f"\n{name}, medians of {rounds} rounds; load average {os.getloadavg()[0]:.1f}")
    print(f"{'figure':44} {'here':>10} {'other':>10} {'ratio':>7} {'least':>7}")
    for figure in [*here, *(figure for figure in there if figure not in here)]:
        pair = [side.get(figure, [float("nan")]) for side in (here, there)]
        medians = [statistics.median(values) for values in pair]
        print(
            f"{figure:44} {medians[0]:10.3f} {medians[1]:10.3f} "
            f"{ratio(*medians):>7} {ratio(min(pair[0]), min(pair[1])):>7}",
            flush=True,
        )


def ratio(here: float, there: float) -> str:
    """How many times the other's figure; empty where the other one is nothing."""
    return f"{here / there:.2f}" if there else ""


if __name__ == "__main__":
    main()
