"""Huge and deeply nested files: time and memory stay bounded through loading, checking and rendering."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory limits of a process are Linux's")

MEMORY_BYTES = 1 << 30
LONGEST_S = 100

CHILD = """
import resource, sys

resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[2]), int(sys.argv[2])))
from joshua.config import check, load
from joshua.config.checks.paths import check_paths
from joshua.config.diagnostics import render_json, render_text
from joshua.modes import check_mode

loaded = load(sys.argv[1])
found = [*loaded.diagnostics, *check(loaded), *check_mode(loaded), *check_paths(loaded, launch=True)]
text = render_text(found, loaded.sources)
render_json(found, loaded.sources)
sys.stdout.write(f"{len(found)} findings\\n" + text[:20_000])
"""

GENERAL = 'general { mode: MODE_TELEOPERATE id: "big" }\n'


NODE = """actions {
  node {
    node_name: "n%(number)d"
    node_id: %(number)d
    publishers { data_type: JOINT_STATE topic_name: "/n%(number)d/state" publish_rate_hz: 50 }
    subscriptions { data_type: JOINT_STATE topic_name: "/n%(number)d/stat" }
  }
  action_type: ACTION_SINGLE
  mock_motor_config { num_motors: 6 position_max: 4095 }
}
"""


def many_nodes() -> str:
    return GENERAL + "robot {\n" + "".join(NODE % {"number": number} for number in range(4_000)) + "}\n"


def many_numbers() -> str:
    ids = ", ".join(["7"] * 120_000)
    return GENERAL + f"robot {{ actions {{ sts3215_config {{ motor_ids: [{ids}] }} }} }}\n"


FILES = {
    "nested_blocks": lambda: "robot { actions { node { " * 300_000,
    "nested_lists": lambda: "general { id: " + "[" * 2_000_000,
    "many_nodes": many_nodes,
    "many_numbers": many_numbers,
    "many_unknown_fields": lambda: GENERAL + "".join(f"field_{number}: 1\n" for number in range(150_000)),
    "one_long_string": lambda: 'general { mode: MODE_TEST id: "' + "x" * 8_000_000 + '" }',
    "one_long_word": lambda: "general { mode: " + "M" * 8_000_000 + " }",
    "many_lines": lambda: "\n" * 4_000_000 + "general",
    "comments": lambda: "# nothing\n" * 800_000,
}


def examine(path: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(path), str(MEMORY_BYTES)],
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    assert "Traceback" not in done.stderr
    return done.stdout


@pytest.mark.parametrize("name", FILES)
def test_a_huge_file_ends_in_findings(name: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(FILES[name](), encoding="utf-8")
    output = examine(path)
    assert int(output.split()[0]) >= 1


@pytest.mark.parametrize("size", [100 * 1024 * 1024, 5 * 1024**3])
def test_a_file_beyond_the_limit_is_refused_without_reading_it(size: int, tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    with path.open("wb") as file:
        file.truncate(size)  # a hole: takes no space
    output = examine(path)
    assert output.startswith("1 findings")
    assert "[file-too-large]" in output


def test_a_folder_and_a_missing_file_are_one_finding_each(tmp_path: Path) -> None:
    assert "[not-a-file]" in examine(tmp_path)
    assert "[file-missing]" in examine(tmp_path / "none.pbtxt")


def test_an_endless_file_is_refused() -> None:
    assert "[not-a-file]" in examine(Path("/dev/zero"))
