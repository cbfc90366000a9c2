"""A run without JAX."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from joshua.testing.domain import reserved_domain

PRESET = Path(__file__).resolve().parents[3] / "configs" / "training_rl_mjx.pbtxt"


def test_without_jax_a_run_names_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "jax.py").write_text("raise ModuleNotFoundError('No module named jax', name='jax')\n")
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
    assert "training requires jax, which is not installed: install joshua-mjx-trainer[learn]" in ended.stderr
    assert "Traceback" not in ended.stderr
    assert not (tmp_path / "runs").exists()
