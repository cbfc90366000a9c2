"""Evaluation on a robot: a person marks the episodes that a model plays on an emulated arm."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from eventually import eventually
from joshua.api.nodes import TopicSpec
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from joshua_evaluation.robot import Marks

ROBOT = """
general {{ mode: MODE_TRAINING robot_type: "SO-ARM100" name: "judge" id: "judge-robot" }}
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
}}
ai {{
  models {{
    model_type: RANDOM_NOISE
    {weights}
    node {{
      node_name: "policy" node_id: 2
      publishers {{ data_type: JOINT_STATE topic_name: "/ai/actions" publish_rate_hz: 20 }}
    }}
  }}
  training {{
    environment: ENV_REAL method: METHOD_EVAL
    eval_config {{ model_checkpoint: "policy-7" num_episodes: 2 bootstrap_samples: 200 {more} }}
  }}
}}
"""


@pytest.fixture
def joshua(tmp_path: Path) -> Iterator[JoshuaProgram]:
    with reserved_domain() as domain_id:
        program = JoshuaProgram(tmp_path, domain_id)
        yield program
        program.close()


def write(folder: Path, more: str = "", weights: str = "") -> Path:
    (folder / "policy-7").mkdir(exist_ok=True)
    path = folder / "judge.pbtxt"
    path.write_text(ROBOT.format(more=more, weights=weights))
    return path


def errors(path: Path) -> list[Any]:
    return list(examine(Request(str(path), purpose=Purpose.VALIDATE)).errors)


def figures(joshua: JoshuaProgram) -> dict[str, Any]:
    return dict(json.loads(joshua("call", "policy", "figures", "--format", "json").stdout))


def test_marked_episodes_of_an_emulated_arm_become_a_report(joshua: JoshuaProgram, tmp_path: Path) -> None:
    run = joshua.start("--config", str(write(tmp_path)), "--emulate", "--duration", "300")
    assert run.stdout is not None
    assert any(" ready after " in line for line in run.stdout)
    assert (figures(joshua)["chunks"], figures(joshua)["state"]) == (0, "paused")
    for mark in ("failure", "success"):
        eventually(lambda: joshua("episode", "begin").returncode == 0, "an episode begins", timeout_s=60)
        wanted = figures(joshua)["chunks"] + 10  # time for many states of the arm
        while figures(joshua)["chunks"] < wanted:
            continue
        assert joshua("episode", mark).returncode == 0
    said = run.communicate(timeout=60)[0]
    assert run.returncode == 0, said
    assert "2 episodes: success 0.50, " in said
    (folder,) = (tmp_path / "runs").glob("eval-robot-*")
    results = json.loads((folder / "results.json").read_text())
    assert results["checkpoint"] == "policy-7"
    assert results["environment"] == "the robot"
    assert set(results["metrics"]) == {"success_rate", "episode_length", "smoothness", "inference_latency"}
    assert results["metrics"]["success_rate"]["value"] == 0.5
    assert min(results["metrics"]["episode_length"]["episodes"]) > 2
    assert min(results["metrics"]["smoothness"]["episodes"]) < 0
    rows = list(csv.DictReader((folder / "episodes.csv").read_text().splitlines()))
    assert [row["success"] for row in rows] == ["0", "1"]
    page = (folder / "report.html").read_text()
    assert "2 episodes (marked by a person)" in page
    assert "Return of each episode" not in page


def report(marks: Marks, what: str, number: int) -> None:
    values = [
        SimpleNamespace(key="number", value=str(number)),
        SimpleNamespace(key="inference_latency_ms", value="20"),
    ]
    marks.report(SimpleNamespace(message=what, values=values), 0)


def test_a_second_mark_corrects_the_first_and_keeps_the_motion() -> None:
    marks = Marks([TopicSpec(name=name, type_name="sensor_msgs/msg/JointState") for name in ("/a", "/b")])
    report(marks, "begin", 1)
    for step in range(5):
        marks.state("/b", SimpleNamespace(position=[9.0]), step)
        marks.state("/a", SimpleNamespace(position=[float(step), 1.0]), step * 20_000_000)
    report(marks, "failure", 1)
    report(marks, "success", 1)
    (episode,) = marks.episodes.values()
    assert episode.success
    assert episode.observations["observation.state"].shape == (5, 3)
    assert episode.steps == 4
    assert episode.period_s == pytest.approx(0.02)
    assert episode.latencies_s == pytest.approx([0.02])


@pytest.mark.parametrize(
    ("more", "at", "said"),
    [
        ("videos: 3", "videos", "videos has no effect on a robot"),
        ('compare_with: "policy-6"', "compare_with", "one checkpoint at a time"),
        ('metrics: ["avg_return"]', "metrics[0]", "A robot gives no reward"),
    ],
)
def test_what_a_robot_cannot_do_is_named(tmp_path: Path, more: str, at: str, said: str) -> None:
    (error,) = errors(write(tmp_path, more))
    assert error.field_path == f"ai.training.eval_config.{at}"
    assert said in error.message


def test_the_weights_are_those_of_the_model(tmp_path: Path) -> None:
    assert errors(write(tmp_path)) == []
    found = errors(write(tmp_path, weights='pretrained_model_name_or_path: "policy-8"'))
    (error,) = (item for item in found if item.code == "checkpoint-not-run")
    assert error.message.startswith("No model of ai.models runs policy-7")
    assert error.allowed == ('"policy-8"',)
