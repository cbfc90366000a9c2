"""The configuration in the folder of a run: one file that starts the same run again."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from joshua.plan import NodeSpec
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
from joshua.testing.recording_context import RecordingContext
from joshua_training.settings import SAVE_S
from joshua_training.tracking import CLOSE_S
from joshua_training.trainer import RunNode

PRESETS = Path(__file__).parents[3] / "configs"
PRESET = PRESETS / "training_rl_ppo.pbtxt"
MORE = "ai { training { rl_config { gae_lambda: 0.5 } } }\n"


class Work(RunNode):
    """Begins a run."""

    def configure(self) -> None:
        """Begin a run."""
        self.begin("runs", "run", {})

    def work(self) -> None:
        """Do nothing."""


def trainer_of(path: Path, *overrides: str) -> NodeSpec:
    found = examine(Request(str(path), overrides=overrides))
    assert found.plan is not None, found.diagnostics
    (spec,) = (node for node in found.plan.nodes if node.name == "training")
    return spec


def test_the_configuration_of_a_run_starts_the_same_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "more.pbtxt").write_text(MORE)
    path = tmp_path / "train.pbtxt"
    path.write_text('include: "more.pbtxt"\n' + PRESET.read_text())
    spec = trainer_of(path, "ai.training.rl_config.num_envs=32")
    assert (spec.settings["num_envs"], spec.settings["gae_lambda"]) == (32, 0.5)
    node = Work(RecordingContext(spec))
    node.configure()
    written = node.folder.path / "config.pbtxt"
    node.cleanup()
    head = written.read_text().splitlines()[:2]
    assert head == [
        "# The configuration of this run, with the content of included files and the options of --set.",
        f"# To run it again, copy it to the folder of its paths, {tmp_path}.",
    ]
    again = trainer_of(Path(shutil.copy(written, tmp_path / "again.pbtxt")))
    assert again.settings == spec.settings
    assert again.facts.environment == spec.facts.environment
    assert again.facts.configuration == spec.facts.configuration


@pytest.mark.parametrize("name", ["eval", "imitation", "rl_isaac", "rl_mjx", "rl_ppo"])
def test_a_stop_waits_for_the_last_files_and_for_the_services(name: str) -> None:
    spec = trainer_of(PRESETS / f"training_{name}.pbtxt")
    assert spec.facts.stop_timeout_s > SAVE_S + CLOSE_S
