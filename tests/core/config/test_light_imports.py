"""Checking a file imports nothing heavy: validation starts in a cold process."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

PROGRAM = """
import json, sys
from joshua.config import check, load
from joshua.config.checks.paths import check_paths
from joshua.config.diagnostics import render_text
from joshua.modes import check_mode

loaded = load(sys.argv[1])
found = [*loaded.diagnostics, *check(loaded), *check_mode(loaded), *check_paths(loaded, launch=True)]
render_text(found, loaded.sources)
print(json.dumps(sorted(sys.modules)))
"""
CORRECT = """
import sys
from joshua.cli.parser import parse
from joshua.config import check, load
from joshua.modes import check_mode

loaded = load(sys.argv[1])
found = [*loaded.diagnostics, *check(loaded), *check_mode(loaded)]
parse(["--config", sys.argv[1], "--validate-only"])
print(found, *sorted({"difflib", "pathlib", "shutil"} & set(sys.modules)))
"""
HEAVY = {
    "numpy",
    "rich",
    "rosbags",
    "zenoh",
    "cyclonedds",
    "pydantic",
    "pluggy",
    "asyncio",
    "multiprocessing",
}


def test_no_heavy_module_is_imported() -> None:
    file = Path(__file__).parent / "bad" / "many_errors_newcomer.pbtxt"
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(file)], capture_output=True, text=True, check=True, timeout=60
    )
    modules = {name.partition(".")[0] for name in json.loads(done.stdout)}
    assert modules & HEAVY == set()


def test_a_correct_file_spares_what_only_problems_need() -> None:
    file = Path(__file__).parent / "good" / "specification_example.pbtxt"
    done = subprocess.run(
        [sys.executable, "-c", CORRECT, str(file)], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout == "[]\n"
