"""Time to load, check and render configurations, in one warm process and from a cold one.

The specification's complete example has no findings; `many_errors_newcomer` has one of each common kind;
the large file has 1,000 nodes. The raw column is `google.protobuf.text_format.Parse`, which neither keeps
positions nor goes on after the first error.
Run: python tests/benchmarks/check_config.py
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from google.protobuf import text_format
from joshua.config import check, load
from joshua.config.checks.paths import check_paths
from joshua.config.diagnostics import render_text
from joshua.modes import check_mode
from joshua.schema import config_pb2 as pb

CONFIG = Path(__file__).parents[1] / "core" / "config"
ROUNDS = 30
NODE = """  actions {
    node { node_name: "arm_%(n)d" node_id: %(n)d
      publishers { data_type: JOINT_STATE topic_name: "/arm_%(n)d/state" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/arm_%(m)d/state" } }
    action_type: ACTION_SINGLE
    mock_motor_config { num_motors: 6 position_max: 4095 }
  }
"""


def main() -> None:
    """Prints a table of times."""
    with tempfile.TemporaryDirectory() as folder:
        large = Path(folder) / "large.pbtxt"
        nodes = "".join(NODE % {"n": number, "m": (number + 1) % 1000} for number in range(1000))
        large.write_text(f"general {{ mode: MODE_TEST }}\nrobot {{\n{nodes}}}\n", encoding="utf-8")
        files = [
            (CONFIG / "good" / "specification_example.pbtxt", ROUNDS),
            (CONFIG / "bad" / "many_errors_newcomer.pbtxt", ROUNDS),
            (large, 3),
        ]
        columns = ("lines", "findings", "load ms", "check ms", "render ms", "raw ms")
        print(f"{'file':28}" + "".join(f"{name:>10}" for name in columns))
        for path, rounds in files:
            measure(path, rounds)
    print(f"cold process, specification_example, load and check: {cold_ms():.0f} ms")


def measure(path: Path, rounds: int) -> None:
    """Measures one file in this process."""
    loaded = load(str(path))
    found = [*loaded.diagnostics, *check(loaded), *check_mode(loaded), *check_paths(loaded, launch=False)]
    times = [
        median_ms(lambda: load(str(path)), rounds),
        median_ms(lambda: (check(loaded), check_mode(loaded), check_paths(loaded, launch=False)), rounds),
        median_ms(lambda: render_text(found, loaded.sources), rounds),
    ]
    text = path.read_text(encoding="utf-8")
    try:
        times.append(median_ms(lambda: text_format.Parse(text, pb.Config()), rounds))
    except text_format.ParseError:
        times.append(float("nan"))
    counts = f"{text.count(chr(10)):10}{len(found):10}"
    print(f"{path.stem:28}{counts}" + "".join(f"{value:10.2f}" for value in times))


def median_ms(run: Callable[[], object], rounds: int) -> float:
    """Median wall time of a call, in ms."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return statistics.median(times) * 1000


def cold_ms() -> float:
    """Median wall time of a fresh interpreter that loads and checks the example, in ms."""
    program = (
        "import sys; from joshua.config import check, load; from joshua.modes import check_mode; "
        "loaded = load(sys.argv[1]); check(loaded); check_mode(loaded)"
    )
    path = str(CONFIG / "good" / "specification_example.pbtxt")
    # Without cached bytecode the time would be that of the compiler.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command = [sys.executable, "-c", program, path]
    subprocess.run(command, check=True, env=environment)
    return median_ms(lambda: subprocess.run(command, check=True, env=environment), 10)


if __name__ == "__main__":
    main()
