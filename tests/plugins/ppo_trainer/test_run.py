"""A run that cannot learn says why, without a traceback."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from joshua.testing.domain import reserved_domain
from joshua.tools import plan

PRESET = Path(__file__).resolve().parents[3] / "configs" / "training_rl_ppo.pbtxt"


def test_a_trainer_that_fails_ends_the_run() -> None:
    """Started again, it would begin another run from scratch, again and again on a full disk."""
    result = plan(PRESET)
    assert result.plan is not None
    assert [node.restart for node in result.plan.nodes] == ["stop-run"]


def test_without_pytorch_a_run_names_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "torch.py").write_text("raise ModuleNotFoundError('No module named torch', name='torch')\n")
    (tmp_path / "tensorboard.py").write_text("")
    output = f'ai.training.rl_config.output_folder="{tmp_path / "runs"}"'
    with reserved_domain() as domain:
        ended = subprocess.run(
            [sys.executable, "-m", "joshua.cli.main", "--config", str(PRESET), "--set", output],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain), "PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
            timeout=200,
        )
    assert ended.returncode == 3
    assert (
        "training requires torch, which is not installed: install joshua-ppo-trainer[learn]" in ended.stderr
    )
    assert "Traceback" not in ended.stderr
    assert not (tmp_path / "runs").exists()
