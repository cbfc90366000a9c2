"""The preset, as a user runs it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from joshua.testing.domain import reserved_domain

PRESET = Path(__file__).resolve().parents[3] / "configs" / "training_eval.pbtxt"


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    with reserved_domain() as domain:
        return subprocess.run(
            [sys.executable, "-m", "joshua", "--config", str(PRESET), *words],
            env={
                **os.environ,
                "ROS_DOMAIN_ID": str(domain),
                "XDG_RUNTIME_DIR": str(folder),
                "XDG_STATE_HOME": str(folder / "state"),
            },
            capture_output=True,
            text=True,
            timeout=200,
            check=False,
        )


def test_the_preset_ends_with_a_report(tmp_path: Path, random_policy: Path) -> None:
    tmp_path.chmod(0o700)
    block = "ai.training.eval_config"
    done = run(
        tmp_path,
        *("--set", f'{block}.model_checkpoint="{random_policy}"', "--set", f"{block}.num_episodes=2"),
        *("--set", f'{block}.output_folder="{tmp_path / "runs"}"', "--set", f"{block}.videos=0"),
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (report,) = (tmp_path / "runs").glob("eval-SoArm100Reach-v0-*/report.html")
    assert f"2 episodes: success 0.00, {report}" in done.stdout
    assert "Traceback" not in done.stderr
    log = (report.parent / "run.log").read_text()
    assert f" INFO this evaluation is in {report.parent}\n" in log
    assert f" INFO 2 episodes: success 0.00, {report}\n" in log
