"""Imitation that evaluates its policy on an emulated robot between updates, where a person marks episodes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from joshua.testing.domain import reserved_domain
from tiny_recordings import write_recording

STARTUP = Path(__file__).parent / "startup"

CAMERA = """
  perceptions {{
    node {{
      node_name: "camera_{name}" node_id: {number}
      publishers {{ data_type: IMAGE topic_name: "/camera/{name}/image_raw" publish_rate_hz: 10 }}
    }}
    perception_type: PERCEPTION_CAMERA mock_camera_config {{ width: {width} height: 48 fps: 10 }}
  }}
"""
TRAIN = """
general {{ mode: MODE_TRAINING robot_type: "SO-ARM100" name: "train" id: "train-robot" }}
robot {{
  actions {{
    node {{
      node_name: "arm" node_id: 1
      publishers {{ data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 }}
      subscriptions {{ data_type: JOINT_STATE topic_name: "/ai/actions" }}
    }}
    action_type: ACTION_SINGLE
    sts3215_config {{
      comm {{ serial {{ port: "/dev/ttyACM0" baudrate: 1000000 }} }}
      motor_ids: [1, 2, 3, 4, 5, 6] position_max: 4095 velocity: 1000 acceleration: 200
    }}
  }}
  {cameras}
}}
ai {{
  data_store {{
    format: FORMAT_HUGGINGFACE storage: STORAGE_LOCAL dataset_name: "demos" local_path: "recording"
  }}
  models {{
    model_type: MODEL_PLUGIN plugin_config {{ [joshua/joshua.LeRobotPolicy] {{ units: UNIT_RADIANS }} }}
    node {{
      node_name: "policy" node_id: 2
      publishers {{ data_type: JOINT_STATE topic_name: "/ai/actions" publish_rate_hz: 10 }}
      subscriptions {{ data_type: IMAGE topic_name: "/camera/top/image_raw" }}
      subscriptions {{ data_type: IMAGE topic_name: "/camera/wrist/image_raw" }}
    }}
  }}
  training {{
    environment: ENV_REAL method: METHOD_IMITATION
    imitation_config {{
      dataset_name: "demos" num_epochs: 10 max_steps: 6 learning_rate: 0.001 batch_size: 4 chunk_size: 8
      hidden_size: 32 feedforward_size: 32 encoder_layers: 1 report_steps: 1 validation_steps: 4
      checkpoint_steps: 2 threads: 1 device: "cpu" validation_share: 0
      robot_evaluation_steps: 2 robot_episodes: 1 {more}
    }}
  }}
}}
"""


class Training:
    """A run in a folder, and the person in front of the robot."""

    def __init__(self, folder: Path, domain: int) -> None:
        self.folder = folder
        self._environment = {
            **os.environ,
            "PYTHONPATH": f"{STARTUP}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
            "ROS_DOMAIN_ID": str(domain),
            "XDG_RUNTIME_DIR": str(folder),
            "XDG_STATE_HOME": str(folder / "state"),
        }
        self.run: subprocess.Popen[str] | None = None

    def start(self, more: str = "", width: int = 64) -> None:
        cameras = "".join(
            CAMERA.format(name=name, number=number, width=width)
            for number, name in enumerate(("top", "wrist"), 10)
        )
        path = self.folder / "train.pbtxt"
        path.write_text(TRAIN.format(cameras=cameras, more=more))
        self.run = subprocess.Popen(
            [sys.executable, "-m", "joshua", "--config", str(path), "--emulate", "--start-timeout", "300"],
            stdout=(self.folder / "said").open("w"),
            stderr=subprocess.STDOUT,
            text=True,
            cwd=self.folder,
            env=self._environment,
            start_new_session=True,
        )

    @property
    def said(self) -> str:
        return " ".join((self.folder / "said").read_text().split())

    def wait(self, until: Callable[[], bool], what: str, timeout_s: float = 200) -> None:
        deadline = time.monotonic() + timeout_s
        while not until():
            assert time.monotonic() < deadline, f"{what}: {self.said}"
            assert self.run is not None
            assert self.run.poll() is None, f"{what}: {self.said}"
            time.sleep(0.2)

    def episode(self, action: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "joshua", "episode", action],
            capture_output=True,
            text=True,
            env=self._environment,
            check=False,
        )

    def play(self, update: int, mark: str) -> None:
        self.wait(lambda: f"update {update}: learning pauses" in self.said, f"a round after {update}")
        self.wait(lambda: self.episode("begin").returncode == 0, "an episode begins")
        time.sleep(1)
        assert self.episode(mark).returncode == 0

    def ended(self, code: int = 0) -> str:
        assert self.run is not None
        assert self.run.wait(200) == code, self.said
        assert "Traceback" not in self.said
        return self.said

    def rows(self) -> dict[int, dict[str, Any]]:
        (folder,) = (self.folder / "runs").glob("act-*")
        found: dict[int, dict[str, Any]] = {}
        for line in (folder / "metrics.jsonl").read_text().splitlines():
            row = json.loads(line)
            found.setdefault(row["steps"], {}).update(row)
        return found


@pytest.fixture
def training(tmp_path: Path) -> Any:
    tmp_path.chmod(0o700)
    write_recording(tmp_path / "recording")
    with reserved_domain() as domain:
        made = Training(tmp_path, domain)
        yield made
        if made.run is not None and made.run.poll() is None:
            os.killpg(made.run.pid, signal.SIGKILL)


def test_learning_pauses_for_episodes_that_a_person_marks(training: Training) -> None:
    training.start()
    training.play(2, "success")
    training.wait(lambda: "update 4: learning pauses" in training.said, "a second round")
    refused = training.episode("success")  # a mark without an episode changes nothing
    assert refused.returncode == 0
    training.wait(lambda: training.episode("begin").returncode == 0, "an episode begins")
    assert training.run is not None
    os.killpg(training.run.pid, signal.SIGINT)  # in an episode
    training.ended()
    assert training.rows()[2]["robot/success_rate"] == 1.0
    assert "robot/success_rate" not in training.rows()[4]
    (folder,) = (training.folder / "runs").glob("act-*")
    assert sorted(path.name for path in (folder / "checkpoints").iterdir())[-1] == "step_000000000004"
    training.start(f'robot_wait_s: 2 resume_run: "{folder}"')
    training.wait(lambda: "update 4: learning pauses" in training.said, "the round again")
    said = training.ended()
    assert "update 4 has no evaluation on the robot: nobody began episode 1 within 2 s." in said
    assert "the next evaluation is after update 6" in said
    assert "update 6 has no evaluation on the robot" in said
    assert "Evaluate the last checkpoint with METHOD_EVAL" in said
    assert "6 updates learned" in said
    assert training.rows()[2]["robot/inference_latency"] > 0


def test_a_robot_that_cannot_run_the_policy_ends_the_training_before_it_learns(training: Training) -> None:
    training.start(width=96)
    said = training.ended(1)
    assert (
        "the robot of this file cannot run the policy: policy needs" in said
        or "cannot run the policy" in said
    )
    assert "96x48" in said or "48 x 96" in said or "observation.images.top" in said
