"""What ``joshua new-plugin`` writes, installed by pip: its own tests, the checks and a run with it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram


def python(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *words]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=280, check=False, env={**os.environ, **environment}
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def test_new_plugins_are_installed_tested_checked_and_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    python("-m", "joshua", "new-plugin", "acme-hand")
    python("-m", "joshua", "new-plugin", "acme-sonar", "--kind", "sensor")
    folder, sensor, site = tmp_path / "acme-hand", tmp_path / "acme-sonar", tmp_path / "site"
    options = ("--quiet", "--disable-pip-version-check", "--no-index", "--no-deps", "--no-build-isolation")
    python("-m", "pip", "install", *options, "--target", str(site), str(folder), str(sensor))
    tests = (str(folder / "tests"), str(sensor / "tests"))
    python("-m", "pytest", "-q", "-p", "no:cacheprovider", *tests, PYTHONPATH=str(site))
    with reserved_domain() as domain_id:
        joshua = JoshuaProgram(tmp_path, domain_id, {"PYTHONPATH": str(site)})
        rows = {row["name"]: row for row in json.loads(joshua("plugins", "--check", "--json").stdout)}
        for name in ("acme-hand", "acme-sonar"):
            assert (rows[name]["status"], rows[name]["reasons"]) == ("ok", [])
        assert "Largest speed of a finger." in joshua("explain", "acme.HandConfig").stdout
        wrong = ("--set", "robot.actions[1].plugin_config.stroke_m=0.3")
        refused = joshua("--config", str(folder / "robot.pbtxt"), "--validate-only", *wrong)
        assert refused.returncode == 2
        assert "The fingers are too short to open that wide" in refused.stdout + refused.stderr
        wrong = ("--set", "robot.perceptions[0].plugin_config.max_m=0.01")
        refused = joshua("--config", str(sensor / "robot.pbtxt"), "--validate-only", *wrong)
        assert refused.returncode == 2
        assert "The largest distance is not above the smallest" in refused.stdout + refused.stderr
        for robot in (folder, sensor):
            ran = joshua("--config", str(robot / "robot.pbtxt"), "--set", "test.duration_s=1")
            assert ran.returncode == 0, ran.stdout + ran.stderr
            assert "test passed" in ran.stdout
        joshua.close()
