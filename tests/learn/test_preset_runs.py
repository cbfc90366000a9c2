"""The presets that train, and that run what was trained: each leaves a picture behind."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import av
import pytest
from programs import Program, program
from tiny_recordings import write_recording

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.fixture
def joshua(tmp_path: Path) -> Iterator[Program]:
    with program(tmp_path) as made:
        yield made


def curves(folder: Path) -> str:
    """The picture of a run's metrics."""
    text = (folder / "curves.svg").read_text(encoding="utf-8")
    assert text.startswith("<svg")
    return text


def test_ppo_learns_and_what_it_learned_moves_the_arm(joshua: Program, tmp_path: Path) -> None:
    for name in ("training_rl_ppo", "inference_ppo_policy"):
        shutil.copy(CONFIGS / f"{name}.pbtxt", tmp_path)
    joshua.run("training_rl_ppo", **{"ai.training.rl_config.total_timesteps": 6144})
    (run,) = tmp_path.glob("runs/SoArm100Reach-v0-*")
    assert "success_rate" in curves(run)

    weights = {"ai.models[0].pretrained_model_name_or_path": f'"{run}"'}
    said = joshua.run("inference_ppo_policy", "--duration", "3", **weights)
    commands = re.search(r"^/arm +in /ai/actions .* (\d+)$", said, re.MULTILINE)
    assert commands is not None, said
    assert int(commands[1]) > 0
    with av.open(str(tmp_path / "reach.mp4")) as film:
        pictures = [picture.to_ndarray(format="rgb24") for picture in film.decode(video=0)]
    assert len(pictures) > 2
    assert pictures[0].std() > 10


def test_imitation_draws_its_curves(joshua: Program, tmp_path: Path) -> None:
    shutil.copy(CONFIGS / "training_imitation.pbtxt", tmp_path)
    write_recording(tmp_path / "datasets/so_arm100_demos")
    small = {"max_steps": 2, "hidden_size": 32, "feedforward_size": 32, "encoder_layers": 1, "chunk_size": 8}
    joshua.run(
        "training_imitation",
        **{f"ai.training.imitation_config.{name}": value for name, value in small.items()},
    )
    (run,) = tmp_path.glob("runs/act-*")
    assert "validation" in curves(run)
