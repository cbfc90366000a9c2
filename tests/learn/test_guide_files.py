"""The files of the guide «teach the arm»: one trains, one judges what it trained, one runs it."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from joshua.features import FeatureSet
from joshua.plan import ServiceFacts
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
from joshua_dataset.metadata import ACQUISITION
from joshua_dataset.reader import Dataset
from programs import Program, program
from tiny_recordings import write_recording

ROOT = Path(__file__).parents[2]
TRAIN = "ai.training.imitation_config"


@pytest.fixture
def joshua(tmp_path: Path) -> Iterator[Program]:
    with program(tmp_path) as made:
        yield made


def recorded() -> FeatureSet:
    """What the guide's recorder records."""
    plan = examine(Request(str(ROOT / "configs/data_store_demonstrations.pbtxt"))).plan
    assert plan is not None
    (store,) = (node for node in plan.nodes if node.name == "data_store")
    assert isinstance(store.facts, ServiceFacts)
    return FeatureSet(store.facts.features)


def test_the_files_of_the_guide_train_judge_and_run(joshua: Program, tmp_path: Path) -> None:
    """As the guide says, but with two updates of a small network, one episode and three seconds."""
    for name in ("train", "judge", "run"):
        shutil.copy(ROOT / f"docs/examples/cube_{name}.pbtxt", tmp_path)
    folder = tmp_path / "datasets/so_arm100_demos"
    write_recording(folder, lengths=(30, 26), cameras=("work", "wrist"), width=96, height=48, fps=25)
    features = Dataset.read(folder).features.values()
    assert not recorded().differences(FeatureSet(each for each in features if each.key != ACQUISITION))

    small = {"max_steps": 2, "batch_size": 4, "hidden_size": 32, "feedforward_size": 32, "encoder_layers": 1}
    joshua.run("cube_train", **{f"{TRAIN}.{name}": value for name, value in small.items()})
    (run,) = tmp_path.glob("runs/act-*")
    (policy,) = run.glob("checkpoints/*/pretrained_model")
    assert (policy / "model.safetensors").is_file()

    chosen: dict[str, str | int] = {"model_checkpoint": f'"{run.relative_to(tmp_path)}"', "num_episodes": 1}
    joshua.run("cube_judge", **{f"ai.training.eval_config.{name}": value for name, value in chosen.items()})
    (report,) = tmp_path.glob("runs/eval-*/report.html")
    assert "<video" in report.read_text(encoding="utf-8")

    weights = {"ai.models[0].pretrained_model_name_or_path": f'"{policy.relative_to(tmp_path)}"'}
    said = joshua.run("cube_run", "--duration", "3", **weights)
    commands = re.search(r"^/arm +in /ai/actions .* (\d+)$", said, re.MULTILINE)
    assert commands is not None, said
    assert int(commands[1]) > 0
