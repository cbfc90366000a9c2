"""The process of Isaac Sim, with environments of MuJoCo in its place."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from joshua_isaac_trainer.channel import Channel
from test_isaac_trainer import REACH, settings

#: Isaac Sim, which ends the process when it is closed, as NVIDIA's does, with environments of MuJoCo.
APPLICATION = """
import os
import sys

import environments


class AppLauncher:
    def __init__(self, options):
        self.app = self
        sys.modules["joshua_isaac_trainer.lab"] = environments

    def close(self):
        os._exit(0)
"""
ENVIRONMENTS = """
from joshua_isaac_trainer.tasks import TensorTask
from test_isaac_trainer import REACH, MujocoVecEnv


class OutOfMemoryError(Exception):
    pass


class Environments(MujocoVecEnv):
    def close(self):
        pass


def make_environment(job, folder):
    if job["num_envs"] == 4096:
        raise OutOfMemoryError
    return Environments(job["num_envs"]), TensorTask(REACH)
"""


@pytest.mark.parametrize(
    ("count", "said"),
    [(4096, "with 4096 environments: halve num_envs, to 2048"), (4, "absent cannot be used: ")],
)
def test_a_failure_is_reported_before_isaac_sim_ends_the_process(
    count: int, said: str, tmp_path: Path
) -> None:
    (tmp_path / "isaaclab").mkdir()
    (tmp_path / "isaaclab/__init__.py").touch()
    (tmp_path / "isaaclab/app.py").write_text(APPLICATION)
    (tmp_path / "environments.py").write_text(ENVIRONMENTS)
    mine, other = socket.socketpair()
    with other:
        process = subprocess.Popen(
            [sys.executable, "-m", "joshua_isaac_trainer.worker", str(other.fileno())],
            pass_fds=(other.fileno(),),
            env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        )
    channel = Channel(mine)
    channel.send(
        {
            "settings": settings(num_envs=count).model_dump(mode="json"),
            "num_envs": count,
            "device": "cpu",
            "seed": 1,
            "environment_id": REACH,
            "checkpoint": str(tmp_path / "checkpoints" / "absent"),
            "run": str(tmp_path),
            "folder": str(tmp_path),
        }
    )
    answer = channel.receive(240)
    channel.close()
    assert answer is not None
    assert said in answer["error"]
    assert answer["exit_code"] == 1
    assert process.wait(60) == 0
