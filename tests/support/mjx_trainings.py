"""Trainings of the preset on MuJoCo XLA, as small as a processor can train them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

PRESET = Path(__file__).resolve().parents[2] / "configs" / "training_rl_mjx.pbtxt"


def start(folder: Path, domain: int, *more: str, platform: str = "cpu") -> subprocess.Popen[str]:
    """The preset, as small as a processor can train it; what is compiled is kept beside the runs."""
    small = {"num_envs": 8, "total_timesteps": 640, "n_steps": 4, "batch_size": 16, "checkpoint_steps": 32}
    fields = [f"{name}={value}" for name, value in small.items()] + [f'output_folder="{folder}"', *more]
    changes = [word for field in fields for word in ("--set", f"ai.training.rl_config.{field}")]
    jax_settings = {
        "JAX_PLATFORMS": platform,
        "JAX_COMPILATION_CACHE_DIR": str(folder.parent / "compiled"),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    }
    return subprocess.Popen(
        [sys.executable, "-m", "joshua.cli.main", "--config", str(PRESET), *changes],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env=os.environ | {"ROS_DOMAIN_ID": str(domain)} | jax_settings,
    )
