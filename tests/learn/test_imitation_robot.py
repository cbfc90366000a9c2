"""Imitation that evaluates its policy on an emulated robot between updates, where a person marks episodes."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from emulators_of_runs import bring_about
from eventually import eventually
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from judged_robot import begin, play, run_judged, write_judged
from tiny_recordings import write_recording
from watched import Watched

STORE = """data_store {
    format: FORMAT_HUGGINGFACE storage: STORAGE_LOCAL dataset_name: "demos" local_path: "recording"
  }"""
MODEL = "model_type: MODEL_PLUGIN plugin_config { [joshua/joshua.LeRobotPolicy] { units: UNIT_RADIANS } }"
TRAIN = """method: METHOD_IMITATION imitation_config {{
    dataset_name: "demos" num_epochs: 10 max_steps: 6 learning_rate: 0.001 batch_size: 4 chunk_size: 8
    hidden_size: 32 feedforward_size: 32 encoder_layers: 1 report_steps: 1 validation_steps: 4
    checkpoint_steps: 2 threads: 1 device: "cpu" validation_share: 0
    robot_evaluation_steps: 2 robot_episodes: 1 {more}
  }}"""


class Training:
    """Runs in a folder, one after the other, and the person in front of the robot.

    Attributes:
        joshua: the program, in the environment of the runs; run: the last one.
    """

    def __init__(self, folder: Path, domain: int, ends: ExitStack) -> None:
        self.folder, self._ends = folder, ends
        self.joshua = JoshuaProgram(folder, domain)
        self.run: Watched

    def start(self, more: str = "", *, width: int = 64, on: str = "--emulate") -> None:
        path = write_judged(
            self.folder / "train.pbtxt",
            model=MODEL,
            training=TRAIN.format(more=more),
            store=STORE,
            rate_hz=10,
            cameras=("top", "wrist"),
            size=(width, 48),
            fps=10,
        )
        self.run = self._ends.enter_context(run_judged(self.joshua, path, on))

    @property
    def said(self) -> str:
        return " ".join(self.run.text.split())

    def wait(self, text: str) -> None:
        def came() -> bool:
            assert text in self.said or self.run.process.poll() is None, f"{text}: {self.said}"
            return text in self.said

        eventually(came, text, timeout_s=300)

    def ended(self, *, failed: bool = False) -> str:
        """Waits for the end. A busy machine may have delayed the emulated arm into a fault, which is said."""
        code, _ = self.run.end(300)
        assert code == failed or "/arm: fault: " in self.said, self.said
        assert "Traceback" not in self.said
        return self.said

    def folders(self) -> list[Path]:
        return sorted((self.folder / "runs").glob("act-*"))


def rows(run: Path) -> dict[int, dict[str, Any]]:
    found: dict[int, dict[str, Any]] = {}
    for line in (run / "metrics.jsonl").read_text().splitlines():
        row = json.loads(line)
        found.setdefault(row["steps"], {}).update(row)
    return found


@pytest.fixture
def training(tmp_path: Path) -> Iterator[Training]:
    tmp_path.chmod(0o700)
    write_recording(tmp_path / "recording")
    with reserved_domain() as domain, ExitStack() as ends:
        yield Training(tmp_path, domain, ends)


def test_learning_pauses_for_episodes_that_a_person_marks(training: Training) -> None:
    training.start()
    training.wait("update 2: learning pauses")
    play(training.joshua, "success", chunks=1)
    training.wait("update 4: learning pauses")
    refused = training.joshua("episode", "success")  # a mark without an episode changes nothing
    assert refused.returncode == 0
    begin(training.joshua, chunks=1)
    training.run.process.send_signal(signal.SIGINT)  # in an episode
    training.ended()
    (folder,) = training.folders()
    assert rows(folder)[2]["robot/success_rate"] == 1.0
    assert "robot/success_rate" not in rows(folder)[4]
    assert sorted(path.name for path in (folder / "checkpoints").iterdir())[-1] == "step_000000000004"
    training.start(f'robot_wait_s: 2 resume_run: "{folder}"')
    training.wait("update 4: learning pauses")
    said = training.ended()
    assert "update 4 has no evaluation on the robot: nobody began episode 1 within 2 s" in said
    assert "the next evaluation is after update 6" in said
    assert "update 6 has no evaluation on the robot" in said
    assert "Evaluate the last checkpoint with METHOD_EVAL" in said
    assert "6 updates learned" in said
    assert rows(folder)[2]["robot/inference_latency"] > 0


def test_rounds_of_any_robot_change_nothing_that_is_learned(training: Training) -> None:
    """Neither a simulated robot, nor an emulated one whose run is killed in an episode."""
    training.start("robot_wait_s: 1", on="--sim")
    training.ended()
    training.start()
    training.wait("update 2: learning pauses")
    begin(training.joshua, chunks=1)
    training.run.process.kill()
    training.run.end()
    whole, broken = training.folders()
    training.start(f'robot_wait_s: 1 resume_run: "{broken}"')
    assert "continuing after 2 updates" in training.ended()
    curves = [
        {steps: row["loss/train"] for steps, row in rows(run).items() if "loss/train" in row}
        for run in (whole, broken)
    ]
    assert curves[0] == curves[1]
    assert list(curves[0]) == [1, 2, 3, 4, 5, 6]
    last = [max((run / "checkpoints").iterdir()) for run in (whole, broken)]
    for name in ("pretrained_model/model.safetensors", "training.safetensors", "state.json"):
        assert (last[0] / name).read_bytes() == (last[1] / name).read_bytes(), name


def test_learning_goes_on_without_an_arm_that_is_disconnected_in_an_episode(training: Training) -> None:
    training.start("robot_wait_s: 30")
    training.wait("update 2: learning pauses")
    begin(training.joshua, chunks=1)
    bring_about(training.run.text, "arm", "unplug")
    training.wait(
        "update 2 has no evaluation on the robot: nobody marked episode 1 within 30 s; /arm is in the"
    )
    training.wait("update 4: learning pauses")
    bring_about(training.run.text, "arm", "replug")
    eventually(lambda: training.joshua("resume", "arm").returncode == 0, "the arm is resumed")
    play(training.joshua, "success", chunks=1)
    training.wait("update 4: 1 of 1 episodes succeeded")
    training.run.process.send_signal(signal.SIGINT)
    training.ended()
    (folder,) = training.folders()
    assert rows(folder)[4]["robot/success_rate"] == 1.0
    assert "robot/success_rate" not in rows(folder)[2]


def test_a_robot_that_cannot_run_the_policy_ends_the_training_before_it_learns(training: Training) -> None:
    training.start(width=96)
    said = training.ended(failed=True)
    assert "the robot of this file cannot run the policy" in said
    assert "96x48" in said or "48 x 96" in said or "observation.images.top" in said
