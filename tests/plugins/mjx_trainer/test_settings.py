"""What a validation says of a training on MuJoCo XLA, and a run without JAX; nothing heavy is imported."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
from joshua.testing.domain import reserved_domain

PRESET = Path(__file__).resolve().parents[3] / "configs" / "training_rl_mjx.pbtxt"


def errors(folder: Path, change: tuple[str, str]):
    text = PRESET.read_text()
    assert change[0] in text
    (folder / "train.pbtxt").write_text(text.replace(*change))
    return examine(Request(str(folder / "train.pbtxt"), purpose=Purpose.VALIDATE)).errors


def test_the_preset_is_valid_without_anything_heavy() -> None:
    code = f"""
import sys
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
assert not examine(Request({str(PRESET)!r}, purpose=Purpose.VALIDATE)).errors
print(sorted({{"jax", "torch", "gymnasium", "mujoco", "numpy", "safetensors"}} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("change", "field", "message", "remedy"),
    [
        (
            ('algorithm: "PPO"', 'algorithm: "SAC"'),
            "algorithm",
            "BACKEND_MJX trains by PPO only.",
            'Write algorithm: "PPO", or simulator_backend: BACKEND_MUJOCO.',
        ),
        (
            ("gamma: 0.97", "gamma: 0.97 physics_threads: 2"),
            "physics_threads",
            "physics_threads has no effect with BACKEND_MJX, because JAX distributes the physics itself.",
            "Remove it.",
        ),
        (
            ("num_envs: 2048", "num_envs: 4"),
            "batch_size",
            "A batch of 1024 samples is larger than what 4 environments collect in 32 steps, 128.",
            "Make it smaller, or raise num_envs or n_steps.",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) and value.isidentifier() else "",
)
def test_what_has_no_effect_is_refused(
    tmp_path: Path, change: tuple[str, str], field: str, message: str, remedy: str
) -> None:
    (error,) = errors(tmp_path, change)
    assert error.field_path == f"ai.training.rl_config.{field}"
    assert (error.message, error.remedy) == (message, remedy)


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
