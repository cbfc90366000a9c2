"""A robot with an emulated arm and a model whose episodes a person marks: its file, and that person."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from eventually import eventually
from joshua.testing.program import JoshuaProgram
from watched import Watched, watched_run

ROBOT = """
general {{ mode: MODE_TRAINING robot_type: "SO-ARM100" name: "judged" id: "judged-robot" }}
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
  {store}
  models {{
    {model}
    node {{
      node_name: "policy" node_id: 2
      publishers {{ data_type: JOINT_STATE topic_name: "/ai/actions" publish_rate_hz: {rate_hz} }}
      {seen}
    }}
  }}
  training {{ environment: ENV_REAL {training} }}
}}
"""

CAMERA = """
  perceptions {{
    node {{
      node_name: "{name}" node_id: {number}
      publishers {{ data_type: IMAGE topic_name: "/camera/{name}/image_raw" publish_rate_hz: {fps} }}
    }}
    perception_type: PERCEPTION_CAMERA mock_camera_config {{ width: {width} height: {height} fps: {fps} }}
  }}
"""


def write_judged(
    path: Path,
    *,
    model: str,
    training: str,
    rate_hz: int,
    cameras: Sequence[str] = (),
    sees: bool = True,
    size: tuple[int, int] = (640, 480),
    fps: int = 15,
    store: str = "",
) -> Path:
    """Writes the file of the robot. The model sees its cameras, of some (width, height), if it ``sees``."""
    shown = (
        CAMERA.format(name=name, number=number, width=size[0], height=size[1], fps=fps)
        for number, name in enumerate(cameras, 10)
    )
    seen = (
        f'subscriptions {{ data_type: IMAGE topic_name: "/camera/{name}/image_raw" }}'
        for name in cameras
        if sees
    )
    parts = {"cameras": "".join(shown), "seen": " ".join(seen), "store": store, "rate_hz": rate_hz}
    path.write_text(ROBOT.format(model=model, training=training, **parts))
    return path


@contextmanager
def run_judged(joshua: JoshuaProgram, path: Path, arm: str = "--emulate") -> Iterator[Watched]:
    """Runs the file, with an emulated or a simulated arm; kills the run in the end if it still runs."""
    command = [sys.executable, "-m", "joshua.cli.main", "--config", str(path), arm, "--start-timeout", "300"]
    with watched_run(command, joshua.environment) as watched:
        yield watched


def states(joshua: JoshuaProgram) -> dict[str, dict[str, Any]]:
    """Status of each node of the only run."""
    (answer,) = json.loads(joshua("status", "--format", "json").stdout)
    return {node["full_name"]: node for node in answer["nodes"]}


def figures(joshua: JoshuaProgram) -> dict[str, Any]:
    """What the model of the run has done."""
    done = joshua("call", "policy", "figures", "--format", "json", "--timeout", "60")
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


def begin(joshua: JoshuaProgram, chunks: int = 10) -> None:
    """Begins an episode as soon as the model takes it, and waits until it has predicted some chunks."""
    eventually(lambda: joshua("episode", "begin").returncode == 0, "an episode begins", timeout_s=200)
    wanted = figures(joshua)["chunks"] + chunks  # time for many states of the arm
    eventually(lambda: figures(joshua)["chunks"] >= wanted, "chunks of the model", timeout_s=200)


def play(joshua: JoshuaProgram, mark: str, chunks: int = 10) -> None:
    """Begins an episode, and marks it."""
    begin(joshua, chunks)
    assert joshua("episode", mark).returncode == 0
