"""The benchmarks are run by hand; this shows that each one still starts."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = [path for path in sorted((ROOT / "tests/benchmarks").glob("*.py")) if path.name[0] != "_"]

# as "python SCRIPT" does it, up to the line that measures
LOAD = "import os, runpy, sys; sys.path[0] = os.path.dirname(sys.argv[1]); runpy.run_path(sys.argv[1])"


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_benchmark_finds_what_it_imports(script: Path, tmp_path: Path):
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, "-c", LOAD, str(script)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_two_checkouts_are_compared_by_the_figures_that_their_scripts_print():
    paired = runpy.run_path(str(ROOT / "tests/benchmarks/_paired.py"))
    times = "start to all ready               median 0.512 s  least 0.500 s  most 0.600 s\n"
    assert paired["start_and_stop_figures"](times) == {"start to all ready [s]": 0.512}
    table = "example                      120         0      1.16      1.00      0.00      0.50\n"
    assert paired["check_config_figures"](table + "cold process, example, load and check: 380 ms\n") == {
        "example load [ms]": 1.16,
        "example check [ms]": 1.0,
        "example render [ms]": 0.0,
        "cold process, load and check [ms]": 380.0,
    }
    shares = '"sender_percent": 1, "receiver_percent": 2'
    outcome = '[{"carrier": "x", "p50_us": 90, "p99_us": 150, "lost": 0, ' + shares + "}]"
    figures = paired["transport_figures"]("table\n" + outcome)
    assert figures == {"x p50 [µs]": 90, "x p99 [µs]": 150, "x lost": 0, "x both sides [%]": 3}
    assert (paired["ratio"](3.0, 2.0), paired["ratio"](3.0, 0.0)) == ("1.50", "")
