"""Evaluation on a robot: a person marks the episodes that a model plays on an emulated arm."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import numpy as np
import pytest
from emulators_of_runs import bring_about
from eventually import eventually
from joshua.api.nodes import TopicSpec
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from joshua_evaluation.node import blind_order
from joshua_evaluation.robot import Marks, Robot, UnansweredError
from joshua_evaluation.videos import Film
from joshua_training.run_folder import RunError
from judged_robot import begin, figures, play, run_judged, states, write_judged


@pytest.fixture
def joshua(tmp_path: Path) -> Iterator[JoshuaProgram]:
    with reserved_domain() as domain_id:
        program = JoshuaProgram(tmp_path, domain_id)
        yield program
        program.close()


def write(folder: Path, more: str = "", weights: str = "", cameras: tuple[str, ...] = ()) -> Path:
    for name in ("policy-6", "policy-7"):
        (folder / name).mkdir(exist_ok=True)
    return write_judged(
        folder / "judge.pbtxt",
        model=f"model_type: RANDOM_NOISE {weights}",
        rate_hz=20,
        cameras=cameras,
        sees=False,
        training="method: METHOD_EVAL "
        f'eval_config {{ model_checkpoint: "policy-7" num_episodes: 2 bootstrap_samples: 200 {more} }}',
    )


def errors(path: Path) -> list[Any]:
    return list(examine(Request(str(path), purpose=Purpose.VALIDATE)).errors)


def heard(joshua: JoshuaProgram) -> float:
    """Rate at which the evaluation receives states of the arm, in Hz."""
    return float(states(joshua)["/training"]["received_hz"].get("/arm/joint_states", 0.0))


@pytest.mark.parametrize("arm", ["--emulate", "--sim"])
def test_marked_episodes_of_an_arm_become_a_report(joshua: JoshuaProgram, tmp_path: Path, arm: str) -> None:
    with run_judged(joshua, write(tmp_path), arm) as run:
        run.wait("ready after", timeout_s=300)
        assert (figures(joshua)["chunks"], figures(joshua)["state"]) == (0, "paused")
        eventually(lambda: heard(joshua) > 0, "states of the arm")
        for mark in ("failure", "success"):
            play(joshua, mark, chunks=40)
        said = run.end()[1]
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
    assert [row["return"] for row in rows] == ["", ""]
    assert "<h1>Evaluation on the robot</h1>" in page
    assert "2 episodes (marked by a person; a robot gives no reward, so there is no return)" in page
    assert "Return of each episode" not in page
    assert "No videos: no node of the file publishes pictures." in page


def test_two_checkpoints_play_each_start_in_an_order_that_nobody_is_told(
    joshua: JoshuaProgram, tmp_path: Path
) -> None:
    path = write(tmp_path, 'compare_with: "policy-6"', cameras=("front",))
    marks = ["success", "failure", "failure", "success"]
    with run_judged(joshua, path) as run:
        run.wait("ready after", timeout_s=300)
        for mark in marks:
            play(joshua, mark)
        said = run.end()[1]
    assert "policy-6" not in said
    (folder,) = (tmp_path / "runs").glob("eval-robot-*")
    results = json.loads((folder / "results.json").read_text())
    order = blind_order(2, 1000)
    assert results["order"] == order
    assert sorted(order[:2]) == sorted(order[2:]) == [0, 1]
    by = {
        which: [mark == "success" for mark, one in zip(marks, order, strict=True) if one == which]
        for which in (0, 1)
    }
    assert results["metrics"]["success_rate"]["episodes"] == by[0]
    assert results["compared"]["checkpoint"] == "policy-6"
    assert results["compared"]["metrics"]["success_rate"]["episodes"] == by[1]
    assert results["compared"]["differences"]["success_rate"]["method"] == "mcnemar"
    page = (folder / "report.html").read_text()
    assert "in an order by chance that the person was not told" in page
    assert page.count("<video ") == 4  # the best and the worst episode of each
    assert "best of policy-6: start " in page


def test_an_arm_that_faults_in_an_episode_is_named_until_it_is_resumed(
    joshua: JoshuaProgram, tmp_path: Path
) -> None:
    named = "/arm is in the state fault: see `joshua status`, then run `joshua resume arm`"

    def is_named() -> bool:
        return named in states(joshua)["/training"]["shown"]

    with run_judged(joshua, write(tmp_path)) as run:
        run.wait("ready after", timeout_s=300)
        begin(joshua)
        bring_about(run.text, "arm", "overload", 2)
        eventually(is_named, "the fault is shown")
        eventually(lambda: joshua("resume", "arm").returncode == 0, "the arm is resumed")
        eventually(lambda: not is_named(), "the fault is over")
        assert joshua("episode", "failure").returncode == 0
        play(joshua, "success")
        assert "2 episodes: success 0.50, " in run.end()[1]


def test_a_model_that_fails_loads_the_weights_of_its_episode_again(
    joshua: JoshuaProgram, tmp_path: Path
) -> None:
    with run_judged(joshua, write(tmp_path, 'compare_with: "policy-6"')) as run:
        run.wait("ready after", timeout_s=300)
        begin(joshua)
        os.kill(states(joshua)["/policy"]["process_id"], signal.SIGKILL)
        run.wait("/policy was restarted: it loads its weights again; begin the episode anew", timeout_s=300)
        for mark in ("success", "failure", "failure", "success"):
            play(joshua, mark)
        said = run.end()[1]
    (folder,) = (tmp_path / "runs").glob("eval-robot-*")
    results = json.loads((folder / "results.json").read_text())
    assert len(results["metrics"]["success_rate"]["episodes"]) == 2, said


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
    (episode,) = marks.episodes
    assert episode.success
    assert episode.observations["observation.state"].shape == (5, 3)
    assert episode.steps == 4
    assert episode.period_s == pytest.approx(0.02)
    assert episode.latencies_s == pytest.approx([0.02])


@pytest.mark.parametrize(
    ("more", "at", "said"),
    [
        ("randomise: true", "randomise", "randomise has no effect on a robot"),
        ('camera: "top"', "camera", "No node top publishes pictures"),
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


def test_a_film_of_any_length_needs_little_memory_and_lasts_as_long_as_the_episode() -> None:
    film, picture = Film(), np.zeros((480, 640, 3), np.uint8)
    for number in range(9000):  # ten minutes at 15 Hz
        if film.wants(stamp := number * 66_666_667):
            film.add(picture, stamp)
    assert len(film._pictures) <= Film.MOST
    with av.open(io.BytesIO(film.develop())) as container:
        stream = container.streams.video[0]
        assert (stream.width, stream.height) == (320, 240)
        assert stream.duration is not None
        assert stream.time_base is not None
        assert float(stream.duration * stream.time_base) == pytest.approx(600, rel=0.02)
    assert Film().develop() == b""


def robot(*models: str) -> Robot:
    names = [f"{name}/episode" for name in models]
    topics = [TopicSpec(name=name, type_name="diagnostic_msgs/msg/DiagnosticStatus") for name in names]
    spec = SimpleNamespace(subscriptions=topics, full_name="/nobody_runs_this")
    context: Any = SimpleNamespace(
        spec=spec, stopping=False, subscribe=lambda *_: None, progress=lambda *_, **__: None
    )
    return Robot(context)


def test_weights_are_for_one_model_of_this_run() -> None:
    with pytest.raises(RunError, match="/left and /right would get the same weights: keep one model"):
        robot("/left", "/right").use("policy-7")
    with pytest.raises(RunError, match="this run is not among those of this user"):
        robot("/policy").use("policy-7")


def test_a_person_who_does_not_answer_is_not_waited_for() -> None:
    idle = robot("/policy")
    with pytest.raises(UnansweredError, match=r"nobody began episode 1 within 0\.1 s"):
        idle.wait(1, lambda state: None, patience_s=0.1)
    report(idle.marks, "begin", 1)
    with pytest.raises(UnansweredError, match=r"nobody marked episode 1 within 0\.1 s"):
        idle.wait(1, lambda state: None, patience_s=0.1)
    idle.marks.restart()
    report(idle.marks, "success", 1)  # of an episode that the training has given up
    assert idle.marks.episodes == []
