"""Policies of LeRobot as models: the same actions as LeRobot's own, and messages that say what to do."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny_policies
import torch
from joshua.api import JointRange, JointSpace, ModelError, Observation
from joshua.api.models import ChunkRequest, Compute
from joshua.features import JointUnits, Unit
from joshua_lerobot.policy import LeRobotModel
from joshua_lerobot.settings import LeRobotSettings
from joshua_smolvla.model import SmolVla
from joshua_smolvla.settings import SmolVlaSettings
from safetensors.torch import save_file

NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
ENDS = np.array([[-1.9, 1.9], [-1.7, 1.6], [-1.6, 1.6], [-1.65, 1.65], [-2.7, 2.8], [-0.2, 1.7]])
JOINTS = JointSpace(NAMES, ENDS[:, 0], ENDS[:, 1])
UNITS = JointUnits.from_ranges(JointRange(name, *ends) for name, ends in zip(NAMES, ENDS, strict=True))


@pytest.fixture(scope="session")
def act(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("act")
    return folder, *tiny_policies.make_act(folder)


@pytest.fixture(scope="session")
def smolvla(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("smolvla")
    return folder, *tiny_policies.make_smolvla(folder)


def model_of(kind: Any, settings: Any, folder: Path, **chosen: Any) -> Any:
    model = kind(settings(weights=str(folder), rate_hz=30.0, **chosen), JOINTS)
    model.load()
    model.reset()
    return model


def observation(seed: int = 1, task: str = "") -> Observation:
    draw = np.random.default_rng(seed)
    values: dict[str, Any] = {
        f"observation.images.{name}": draw.integers(0, 255, (96, 96, 3), np.uint8)
        for name in ("top", "wrist")
    }
    values["observation.state"] = draw.uniform(ENDS[:, 0], ENDS[:, 1]).astype(np.float32)
    return Observation(10**18 + seed, values, {}, task=task)


def by_lerobot(parts: Any, seen: Observation, steps: int) -> Any:
    """The actions that LeRobot's own loop takes, in radians."""
    from lerobot.policies.utils import prepare_observation_for_inference

    policy, before, after = parts
    values = dict(seen.values)
    values["observation.state"] = UNITS.from_radians(values["observation.state"], Unit.LEROBOT).astype(
        np.float32
    )
    policy.reset()
    torch.manual_seed(3)
    actions = []
    with torch.inference_mode():
        for _ in range(steps):
            batch = prepare_observation_for_inference(dict(values), torch.device("cpu"), seen.task)
            actions.append(after(policy.select_action(before(batch))).numpy()[0])
    return UNITS.to_radians(np.array(actions), Unit.LEROBOT)


def test_act_acts_as_with_lerobot(act: Any) -> None:
    folder, *parts = act
    model = model_of(LeRobotModel, LeRobotSettings, folder)
    actions = model.act(observation())
    assert actions.shape == (20, 6)
    np.testing.assert_allclose(actions, by_lerobot(parts, observation(), 20), atol=1e-5, rtol=0)
    model.close()


def test_smolvla_acts_as_with_lerobot(smolvla: Any) -> None:
    folder, *parts = smolvla
    model = model_of(SmolVla, SmolVlaSettings, folder, compute=Compute(seed=3))
    seen = observation(task="put the red cube into the box")
    actions = model.act(seen)
    assert actions.shape == (10, 6)
    np.testing.assert_allclose(actions, by_lerobot(parts, seen, 10), atol=1e-5, rtol=0)
    model.reset()
    np.testing.assert_array_equal(model.act(seen), actions)  # the seed draws the same noise
    assert np.abs(model.act(observation(task="reach the cube")) - actions).max() > 1e-6
    model.close()


def test_rtc_continues_the_chunk_before(smolvla: Any) -> None:
    """The fixed steps of a continued chunk stay near those that were planned; a free chunk does not."""
    folder = smolvla[0]
    model = model_of(SmolVla, SmolVlaSettings, folder, compute=Compute(seed=3))
    seen = observation(task="reach the cube")
    before = model.act(seen)
    planned = np.clip(before[3:] + 0.3, ENDS[:, 0], ENDS[:, 1])
    request = ChunkRequest(planned, delay=2, overlap=7, max_guidance_weight=10.0)
    model.reset()
    continued = model.continue_chunk(observation(2, "reach the cube"), request)
    model.reset()
    free = model.act(observation(2, "reach the cube"))
    assert continued.shape == free.shape == (10, 6)
    assert np.abs(continued[:2] - planned[:2]).max() < 0.2 * np.abs(free[:2] - planned[:2]).max()
    model.reset()
    np.testing.assert_array_equal(model.act(observation(2, "reach the cube")), free)  # nothing stays behind
    assert model.needs().supports_rtc
    model.close()


def test_half_precision_differs_a_little(act: Any, smolvla: Any) -> None:
    for kind, settings, folder, task in (
        (LeRobotModel, LeRobotSettings, act[0], ""),
        (SmolVla, SmolVlaSettings, smolvla[0], "reach the cube"),
    ):
        exact = model_of(kind, settings, folder, compute=Compute(seed=3))
        half = model_of(kind, settings, folder, compute=Compute(seed=3, precision="bfloat16"))
        assert next(half._loaded.policy.parameters()).dtype is torch.bfloat16
        actions = []
        for model in (exact, half):
            model.reset()  # seeds the one generator of torch
            actions.append(model.act(observation(task=task)))
        assert 0 < np.abs(actions[0] - actions[1]).max() < 0.05
        exact.close()
        half.close()


def test_fewer_steps_and_smaller_pictures_reach_the_policy(smolvla: Any) -> None:
    model = model_of(
        SmolVla, SmolVlaSettings, smolvla[0], denoising_steps=2, picture_size=64, actions_per_chunk=4
    )
    config = model._loaded.policy.config
    assert (config.num_steps, list(config.resize_imgs_with_padding)) == (2, [64, 64])
    assert model.act(observation(task="reach the cube")).shape == (4, 6)
    model.close()


def test_a_camera_that_is_absent_is_left_out(smolvla: Any) -> None:
    model = model_of(SmolVla, SmolVlaSettings, smolvla[0], absent_cameras=("observation.images.wrist",))
    seen = observation(task="reach the cube")
    values = {key: value for key, value in seen.values.items() if "wrist" not in key}
    assert model.act(Observation(1, values, {}, task=seen.task)).shape == (10, 6)
    model.close()


def test_policies_that_look_back_or_plan_run_too(tmp_path: Path) -> None:
    for kind, make in (("diffusion", tiny_policies.make_diffusion), ("tdmpc", tiny_policies.make_tdmpc)):
        parts = make(tmp_path / kind)
        model = model_of(LeRobotModel, LeRobotSettings, tmp_path / kind, compute=Compute(seed=3))
        seen = observation()
        seen = replace(seen, values={**seen.values, "observation.image": seen["observation.images.top"]})
        actions = model.act(seen)
        np.testing.assert_allclose(actions, by_lerobot(parts, seen, len(actions)), atol=1e-5, rtol=0)
        model.close()


@pytest.mark.parametrize(("kind", "history"), [("diffusion", 2), ("vqbet", 3)])
def test_policies_that_look_back_see_the_periods_before(tmp_path: Path, kind: str, history: int) -> None:
    """The chunk that LeRobot predicts in the middle of an episode."""
    from lerobot.policies.utils import prepare_observation_for_inference

    folder = tmp_path / kind
    policy, before, after = getattr(tiny_policies, f"make_{kind}")(folder)
    episode = [observation(seed) for seed in range(5)]
    policy.reset()
    for step, seen in enumerate(episode):
        values = dict(seen.values)
        state = UNITS.from_radians(values["observation.state"], Unit.LEROBOT).astype(np.float32)
        values["observation.state"] = state
        if kind == "vqbet":
            del values["observation.images.wrist"]
        if step == 4:
            policy._queues["action"].clear()
            torch.manual_seed(3)
        batch = prepare_observation_for_inference(values, torch.device("cpu"), "")
        with torch.inference_mode():
            action = after(policy.select_action(before(batch))).numpy()[0]
    model = model_of(LeRobotModel, LeRobotSettings, folder, compute=Compute(seed=3))
    assert model.needs().history == history
    earlier = tuple(reversed(episode[5 - history : 4]))
    chunk = model.act(replace(episode[-1], earlier=earlier))
    assert len(chunk) == 4
    np.testing.assert_allclose(chunk[0], UNITS.to_radians(action, Unit.LEROBOT), atol=1e-5, rtol=0)
    model.reset()
    assert np.abs(model.act(episode[-1]) - chunk).max() > 1e-5, "what was before matters"
    model.close()


def refusal(folder: Path, **chosen: Any) -> str:
    with pytest.raises(ModelError) as error:
        model_of(LeRobotModel, LeRobotSettings, folder, **chosen)
    return str(error.value)


@pytest.fixture
def copy(act: Any, tmp_path: Path) -> Path:
    return Path(shutil.copytree(act[0], tmp_path / "copy"))


def changed(folder: Path, **values: Any) -> Path:
    path = folder / "config.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | values))
    return folder


def test_a_device_that_is_not_there_says_what_is(act: Any) -> None:
    assert 'device: "cuda" is not available; PyTorch' in refusal(act[0], compute=Compute(device="cuda"))
    assert 'compute { device: "auto" }' in refusal(act[0], compute=Compute(device="cuda"))


def test_weights_of_another_policy_are_refused(copy: Path) -> None:
    said = refusal(changed(copy, dim_model=128))
    assert "model.safetensors does not fit config.json beside it" in said
    assert "size mismatch" in said
    said = refusal(changed(copy, dim_model=64, n_encoder_layers=3))
    assert "weights of the policy, such as model.encoder.layers.2." in said
    assert "which would be random" in said


def test_a_type_or_a_field_that_this_lerobot_does_not_know_is_named(copy: Path) -> None:
    assert "holds a policy of type 'future', which this LeRobot does not have; it has act," in refusal(
        changed(copy, type="future")
    )
    said = refusal(changed(copy, type="act", warp=1))
    assert "config.json does not fit this LeRobot" in said
    assert "warp" in said


def test_a_processor_that_this_lerobot_does_not_know_is_named(copy: Path) -> None:
    path = copy / "policy_preprocessor.json"
    content = json.loads(path.read_text())
    content["steps"][0]["registry_name"] = "future_processor"
    path.write_text(json.dumps(content))
    assert "The processors of" in refusal(copy)
    assert "future_processor" in refusal(copy)


def test_a_language_model_that_cannot_be_had_is_named(smolvla: Any, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(smolvla[0], tmp_path / "copy"))
    changed(folder, vlm_model_name="acme/none")
    with pytest.raises(ModelError) as error:
        model_of(SmolVla, SmolVlaSettings, folder)
    assert "builds on acme/none, whose description and tokenizer cannot be loaded" in str(error.value)


def test_without_memory_the_message_names_what_takes_less(act: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of(LeRobotModel, LeRobotSettings, act[0])
    errors = [torch.OutOfMemoryError(), MemoryError()]
    with pytest.raises(RuntimeError, match="allocate memory") as real:
        torch.empty(1 << 60, dtype=torch.uint8)  # what PyTorch raises for the memory of this machine
    for error in (*errors, real.value):

        def full(*_: Any, error: BaseException = error, **__: Any) -> None:
            raise error

        with monkeypatch.context() as patch:
            patch.setattr(model._loaded.policy, "predict_action_chunk", full)
            with pytest.raises(ModelError, match=r'The memory of cpu is too small.*precision: "bfloat16"'):
                model.act(observation())
        for place in ("safetensors.torch.load_model", "lerobot.policies.act.modeling_act.ACTPolicy.__init__"):
            with monkeypatch.context() as patch:
                patch.setattr(place, full)
                assert (
                    'The memory of cpu is too small for the policy. Set compute { precision: "bf'
                    in refusal(act[0])
                )
    model.close()
    model.close()
    with pytest.raises(ModelError, match="the policy is not loaded"):
        model.act(observation())


def test_a_compiled_policy_acts_the_same(act: Any) -> None:
    plain = model_of(LeRobotModel, LeRobotSettings, act[0])
    compiled = model_of(LeRobotModel, LeRobotSettings, act[0], compile=True)
    assert type(compiled._loaded.policy.model) is not type(plain._loaded.policy.model)
    np.testing.assert_allclose(compiled.act(observation()), plain.act(observation()), atol=1e-5, rtol=0)
    plain.close()
    compiled.close()


def test_without_a_compiler_the_message_names_it(act: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from torch._inductor import config

    monkeypatch.setattr(config.cpp, "cxx", (None, "/nowhere/g++"))
    monkeypatch.setattr(config, "force_disable_caches", True)
    torch._dynamo.reset()
    model = model_of(LeRobotModel, LeRobotSettings, act[0], compile=True)
    with pytest.raises(ModelError, match=r"No working C\+\+ compiler .* or remove compile: true"):
        model.act(observation())
    model.close()
    torch._dynamo.reset()


def test_a_policy_that_cannot_be_compiled_is_refused(tmp_path: Path) -> None:
    tiny_policies.make_vqbet(tmp_path)
    assert "Policies of type vqbet cannot be compiled" in refusal(tmp_path, compile=True)


def test_a_checkpoint_without_statistics_runs_only_if_the_file_accepts_it(
    copy: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for path in copy.glob("policy_p*_processor.safetensors"):
        save_file({}, path)
    folder = changed(copy, temporal_ensemble_coeff=0.01, n_action_steps=1)
    lacking = ("observation.state", "observation.images.top", "observation.images.wrist", "action")
    assert f"normalises {', '.join(lacking)} and has no" in refusal(folder)
    model = model_of(LeRobotModel, LeRobotSettings, folder, allow_unnormalized=lacking)
    assert "has no statistics of observation.state, observation.images.top" in caplog.text
    model.close()
