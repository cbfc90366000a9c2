"""Evaluations as their node plays them: figures, comparison, files, report, and what the file sets."""

from __future__ import annotations

import csv
import errno
import json
import os
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from evaluated import evaluated, prepared, results
from joshua_evaluation.episodes import Arena, play
from joshua_evaluation.players import PolicyPlayer
from joshua_mujoco_sim.opengl import RenderingError, choose_gl
from joshua_training.run_folder import RunError
from trained_policies import write_policy

TOY = Path(__file__).resolve().parents[2] / "support" / "toy_policy"


def has_gl() -> bool:
    try:
        choose_gl()
    except RenderingError:
        return False
    return True


def test_an_evaluation_writes_figures_with_intervals_and_a_report(tmp_path: Path, reaching: Path) -> None:
    made, context = evaluated(tmp_path, reaching, "videos: 0", episodes=12, seed="seed: 40")
    content = json.loads((made / "results.json").read_text())
    assert content["complete"] is True
    assert content["seeds"] == list(range(40, 52))
    assert (content["environment"], content["reward_function"]) == ("joshua/SoArm100Reach-v0", "reach")
    success = content["metrics"]["success_rate"]
    assert 0 < success["value"] < 1
    assert success["low"] < success["value"] < success["high"]
    assert (success["method"], success["count"]) == ("wilson", 12)
    mean = content["metrics"]["avg_return"]
    assert mean["method"] == "bootstrap"
    assert mean["low"] < mean["value"] < mean["high"]
    assert set(content["metrics"]) == {
        *("success_rate", "avg_return", "episode_length", "smoothness", "inference_latency")
    }
    rows = list(csv.DictReader((made / "episodes.csv").read_text().splitlines()))
    assert [int(row["seed"]) for row in rows] == content["seeds"]
    assert sum(int(row["success"]) for row in rows) == round(12 * success["value"])
    assert [float(row["avg_return"]) for row in rows] == pytest.approx(mean["episodes"])
    for row in rows:  # the terms of the reward add up to it
        terms = [float(value) for name, value in row.items() if name.startswith("reward.")]
        assert sum(terms) == pytest.approx(float(row["return"]), abs=1e-6)
    best, worst = content["best_to_worst"][0], content["best_to_worst"][-1]
    assert (rows[best]["success"], rows[worst]["success"]) == ("1", "0")
    page = (made / "report.html").read_text()
    assert "Evaluation in joshua/SoArm100Reach-v0" in page
    assert "src='http" not in page
    assert page.count("<circle") == 12
    about = json.loads((made / "run.json").read_text())
    assert (about["kind"], about["seed"], about["noise_seed"]) == ("evaluation", 40, 40)
    assert about["settings"]["model_checkpoint"] == str(reaching)
    assert "joshua-core" in about["versions"]
    (end,) = context.ends
    assert end.startswith(f"12 episodes: success {success['value']:.2f}, ")
    assert end.endswith("report.html")
    progress = context.progresses["evaluation"]
    assert (progress.current, progress.total, progress.unit) == (12, 12, "episodes")


def test_the_same_seeds_give_the_same_episodes_and_others_do_not(tmp_path: Path, reaching: Path) -> None:
    first, again = results(tmp_path, reaching, seed="seed: 7"), results(tmp_path, reaching, seed="seed: 7")
    assert first["metrics"]["avg_return"] == again["metrics"]["avg_return"]
    own = results(tmp_path, reaching, "videos: 0 seed: 9", seed="seed: 7")
    assert own["seeds"] == [9, 10, 11]
    # the episode of a seed does not depend on those before it
    assert own["metrics"]["avg_return"]["episodes"][0] == first["metrics"]["avg_return"]["episodes"][2]
    assert results(tmp_path, reaching, episodes=1)["seeds"] == [1000]


def test_two_checkpoints_are_compared_in_the_same_episodes(
    tmp_path: Path, reaching: Path, random_policy: Path
) -> None:
    more = f'videos: 0 compare_with: "{reaching}" metrics: ["success_rate", "avg_return"]'
    made, context = evaluated(tmp_path, random_policy, more, episodes=16, seed="seed: 0")
    content = json.loads((made / "results.json").read_text())
    compared = content["compared"]
    assert compared["checkpoint"] == str(reaching)
    difference = compared["differences"]["success_rate"]
    wins = round(16 * compared["metrics"]["success_rate"]["value"])
    assert content["metrics"]["success_rate"]["value"] == 0.0
    assert wins > 0
    assert (difference["better"], difference["worse"]) == (wins, 0)
    assert difference["p_value"] == pytest.approx(min(1.0, 2 / 2**wins))
    gained = compared["differences"]["avg_return"]
    means = [side["avg_return"]["value"] for side in (content["metrics"], compared["metrics"])]
    assert gained["value"] == pytest.approx(means[1] - means[0])
    assert gained["low"] < gained["value"] < gained["high"]
    assert "Comparison in the same episodes" in (made / "report.html").read_text()
    rows = list(csv.DictReader((made / "episodes.csv").read_text().splitlines()))
    assert [int(row["seed"]) for row in rows] == content["seeds"] * 2
    assert " success 0.00 against 0." in context.ends[0]


@pytest.mark.skipif(not has_gl(), reason="no OpenGL library: sudo apt install libegl1 libgl1-mesa-dri")
def test_the_report_shows_the_best_and_the_worst_episode(
    tmp_path: Path, reaching: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import base64
    import io

    import av
    import joshua_evaluation.node

    monkeypatch.setattr(joshua_evaluation.node, "VIDEO_SIZE", (64, 48))
    made, context = evaluated(tmp_path, reaching, "", episodes=3, seed="seed: 40")
    page = (made / "report.html").read_text()
    clips = re.findall(r"data:video/mp4;base64,([^']+)", page)
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", page)
    content = json.loads((made / "results.json").read_text())
    order, lengths = content["best_to_worst"], content["metrics"]["episode_length"]["episodes"]
    assert len(clips) == len(captions) == 2
    for clip, caption, label, index in zip(
        clips, captions, ("best", "worst"), (order[0], order[-1]), strict=True
    ):
        assert caption.startswith(f"{label} of {reaching}: episode {index}, seed {40 + index}, ")
        assert "differed" not in caption
        with av.open(io.BytesIO(base64.b64decode(clip))) as video:
            frames = len(list(video.decode(video=0)))
        assert frames == lengths[index] + 1
    assert context.warnings == []


def test_without_opengl_the_report_says_why_it_has_no_videos(
    tmp_path: Path, random_policy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    made, context = evaluated(tmp_path, random_policy, episodes=1)
    assert "MUJOCO_GL=disabled disables rendering" in context.warnings[0]
    assert "No videos: MUJOCO_GL=disabled" in (made / "report.html").read_text()
    assert len(context.ends) == 1


@pytest.mark.parametrize(
    ("more", "changed"),
    [
        ('metrics: ["avg_return"]', lambda content: list(content["metrics"]) == ["avg_return"]),
        ("confidence: 0.5", lambda content: content["confidence"] == 0.5),
        ("bootstrap_samples: 100", lambda content: True),
        ("randomise: true", lambda content: content["randomise"] is True),
        ('output_folder: "elsewhere"', lambda content: True),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_every_field_takes_effect(tmp_path: Path, reaching: Path, more: str, changed: Any) -> None:
    base = results(tmp_path, reaching, episodes=6, seed="seed: 41")
    settings = more if "samples" in more else f"bootstrap_samples: 200 {more}"
    node, context = prepared(tmp_path, reaching, f"videos: 0 {settings}", episodes=6, seed="seed: 41")
    node.activate()
    assert node._ended.wait(120)
    context.stop()
    content = json.loads((node._folder.path / "results.json").read_text())
    assert changed(content)
    one, other = (side["metrics"]["avg_return"] for side in (base, content))
    if "randomise" in more:
        assert one["episodes"] != other["episodes"]
    elif "confidence" in more:
        assert other["high"] - other["low"] < one["high"] - one["low"]
    elif "samples" in more:
        assert (other["low"], other["high"]) != (one["low"], one["high"])
    elif "folder" in more:
        assert node._folder.path.parent == tmp_path / "elsewhere"


def test_the_camera_of_the_videos_can_be_chosen(tmp_path: Path, random_policy: Path) -> None:
    made, context = evaluated(tmp_path, random_policy, 'camera: "back"', episodes=1)
    if has_gl():
        assert "the model has no camera 'back': choose" in context.warnings[0]
    assert (made / "results.json").is_file()


def test_a_stop_keeps_the_episodes_that_are_done(tmp_path: Path, reaching: Path) -> None:
    node, context = prepared(tmp_path, reaching, episodes=100000)
    node.activate()
    end_s = time.monotonic() + 60
    while "evaluation" not in context.progresses and time.monotonic() < end_s:
        time.sleep(0.01)
    context.stop()
    node.deactivate()
    content = json.loads((node._folder.path / "results.json").read_text())
    assert content["complete"] is False
    assert 1 <= content["episodes"] < 1000
    assert "of 100000 episodes" in (node._folder.path / "report.html").read_text()
    assert context.ends == []


def test_a_full_disk_is_said(tmp_path: Path, random_policy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    node, context = prepared(tmp_path, random_policy, "videos: 0", episodes=1)

    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    node.activate()
    assert node._ended.wait(60)
    with pytest.raises(RunError, match=r"cannot be written: No space left on device: free some space, and"):
        context.stop()


def test_weights_that_do_not_fit_the_environment_are_refused(tmp_path: Path) -> None:
    write_policy(tmp_path / "other", environment="joshua/SoArm100PickPlace-v0")
    about = json.loads((tmp_path / "other" / "policy.json").read_text())
    (tmp_path / "other" / "policy.json").write_text(
        json.dumps(about | {"environment": "joshua/SoArm100Reach-v0"})
    )
    node, context = prepared(tmp_path, "other")
    node.activate()
    assert node._ended.wait(60)
    with pytest.raises(Exception, match=r"expects observation\.to_cube of shape \[3\], but the environment"):
        context.stop()


@pytest.mark.parametrize(
    ("checkpoint", "more"), [("torn", ""), ("random", 'compare_with: "torn"')], ids=["first", "second"]
)
def test_torn_weights_are_named_before_any_episode(
    tmp_path: Path, random_policy: Path, checkpoint: str, more: str
) -> None:
    write_policy(tmp_path / "torn")
    content = (tmp_path / "torn" / "policy.safetensors").read_bytes()
    (tmp_path / "torn" / "policy.safetensors").write_bytes(content[:-5])
    given = random_policy if checkpoint == "random" else checkpoint
    node, context = prepared(tmp_path, given, more, episodes=10_000)
    node.activate()
    assert node._ended.wait(60)
    with pytest.raises(RunError, match="torn contains no policy of joshua-ppo-trainer"):
        context.stop()


def test_an_episode_is_that_of_the_single_environment(reaching: Path) -> None:
    """Success, length and return, with the actions of the policy computed by hand."""
    from joshua_mujoco_sim.envs import make_environment
    from joshua_ppo_trainer.policy import Policy

    arena = Arena("joshua_mujoco_sim.envs:make_vector_environment", "joshua/SoArm100Reach-v0", "reach")
    player = PolicyPlayer(reaching)
    player.load(arena)
    policy = Policy.load(reaching)
    environment = make_environment("joshua/SoArm100Reach-v0", disable_env_checker=True)
    for seed in (3, 40, 41):
        found = play(arena, player, seed)
        observation, _ = environment.reset(seed=seed)
        rewards = []
        while True:
            action = policy.act(observation[None])[0]
            observation, reward, terminated, truncated, info = environment.step(action)
            rewards.append(reward)
            if terminated or truncated:
                break
        assert found.steps == len(rewards)
        assert found.rewards == pytest.approx(rewards, abs=1e-9)
        assert (found.success, found.truncated) == (info["is_success"], truncated and not terminated)
        assert found.observations["observation.state"].shape == (found.steps + 1, 6)
        assert np.isfinite(found.actions).all()
    arena.close()


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(TOY))


def toy_block(fields: str = "") -> str:
    return f"videos: 0 plugin_config {{ [test/toy.PolicyConfig] {{ {fields} }} }}"


def test_any_model_plugin_is_judged_by_its_contract(toy: None, tmp_path: Path, random_policy: Path) -> None:
    """Chunks of 50 steps, each a wave on all joints from its beginning: it matters when they begin."""
    wave = 'fault: "restart"'
    made, _ = evaluated(tmp_path, random_policy, toy_block(f"latency_s: 0.002 {wave}"), episodes=2)
    content = json.loads((made / "results.json").read_text())
    assert content["metrics"]["inference_latency"]["value"] >= 2.0
    assert content["metrics"]["episode_length"]["value"] == 75
    base = content["metrics"]["avg_return"]["episodes"]
    for more in ("steps_per_chunk: 7 strategy: TEMPORAL_ENSEMBLE", "inference_delay: 9"):
        other = results(tmp_path, random_policy, f"{toy_block(wave)} {more}", episodes=2)
        assert other["metrics"]["avg_return"]["episodes"] != pytest.approx(base, rel=1e-6)


@pytest.mark.skipif(not has_gl(), reason="no OpenGL library: sudo apt install libegl1 libgl1-mesa-dri")
def test_a_model_gets_the_pictures_that_it_needs(toy: None, tmp_path: Path, random_policy: Path) -> None:
    assert results(tmp_path, random_policy, toy_block('camera: "wrist"'), episodes=1)["complete"]
    node, context = prepared(tmp_path, random_policy, toy_block('camera: "side"'), episodes=1)
    node.activate()
    assert node._ended.wait(60)
    with pytest.raises(Exception, match="the model has no camera 'side': choose top, front, wrist"):
        context.stop()


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ("reads_task: true", "does nothing without a task: add task"),
        ('fault: "loading"', "the toy policy has no weights: train it first"),
        ('fault: "nan" chunk_steps: 5', "returned an action that is not a number at step 10"),
    ],
)
def test_a_model_that_cannot_be_judged_says_why(
    toy: None, tmp_path: Path, random_policy: Path, fields: str, said: str
) -> None:
    node, context = prepared(tmp_path, random_policy, toy_block(fields), episodes=1)
    node.activate()
    assert node._ended.wait(60)
    with pytest.raises(Exception, match=said):
        context.stop()


def test_a_model_is_told_its_task(toy: None, tmp_path: Path, random_policy: Path) -> None:
    more = toy_block("reads_task: true") + ' task: "reach the goal"'
    assert results(tmp_path, random_policy, more, episodes=1)["complete"]


def test_a_model_needs_an_environment_of_joints(toy: None, tmp_path: Path) -> None:
    write_policy(tmp_path / "ant", environment="joshua/Ant-v0")
    environment = 'environment_id: "joshua/Ant-v0"'
    node, context = prepared(tmp_path, "ant", toy_block(), environment=environment, episodes=1)
    node.activate()
    assert node._ended.wait(60)
    with pytest.raises(Exception, match="no action mode 'absolute': choose torque"):
        context.stop()
