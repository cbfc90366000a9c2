"""The presets through the real program: all are valid, and those for mock hardware run."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from steady_machine import while_steady

JOSHUA = str(Path(sys.executable).parent / "joshua")


def joshua(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [JOSHUA, *words], cwd=cwd, capture_output=True, text=True, timeout=200, stdin=subprocess.DEVNULL
    )


def test_a_copy_of_a_preset_is_valid(tmp_path: Path):
    """Each of them is looked at in tests/presets, without a process."""
    joshua("new", "mine", "--from", "teleop_so_arm100", cwd=tmp_path)
    result = joshua("--config", "mine.pbtxt", "--validate-only", "--format", "json", cwd=tmp_path)
    assert result.returncode == 0, result.stdout
    assert {item["severity"] for item in json.loads(result.stdout)} <= {"note"}


@pytest.mark.timing
def test_the_mock_hardware_preset_passes_its_own_test(tmp_path: Path, joshua_domain_id: int):
    joshua("new", "mine", "--from", "test_mock_hardware", cwd=tmp_path)
    result = while_steady(
        lambda: joshua("--config", "mine.pbtxt", cwd=tmp_path), lambda done: done.returncode == 0
    )
    said = result.stdout + result.stderr
    assert result.returncode == 0, said
    for node in ("/mock_leader", "/mock_follower", "/mock_camera"):
        assert re.search(rf"^PASS +{node} ", said, re.MULTILINE)
    assert "FAIL" not in said


def test_random_actions_reach_the_mock_arm(tmp_path: Path, joshua_domain_id: int):
    joshua("new", "mine", "--from", "inference_random_noise", cwd=tmp_path)
    result = joshua("--config", "mine.pbtxt", "--duration", "3", cwd=tmp_path)
    said = result.stdout + result.stderr
    assert result.returncode == 0, said
    heard = re.search(r"^/mock_arm +in /ai/actions .* (\d+)$", said, re.MULTILINE)
    assert heard is not None, said
    assert int(heard[1]) > 0
