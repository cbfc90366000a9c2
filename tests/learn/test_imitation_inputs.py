"""Imitation: settings that do not fit LeRobot or the machine are named with what to do."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import pytest
import tiny_policies
import torch
from joshua_dataset.reader import Dataset
from joshua_imitation.build import build, is_emulated
from joshua_imitation.policies import make_config
from joshua_training.run_folder import RunError
from learners import DIFFUSION, settings
from learners import recording as recording
from lerobot.policies import factory  # noqa: F401 (makes the policies known)


def test_settings_that_lerobot_refuses_are_passed_on(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "temporary"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    with pytest.raises(
        RunError, match=r"act cannot learn from .* with these settings: .*chunk size.*: change the setting"
    ):
        build(settings(recording, chunk_size=None, actions_per_chunk=500))
    monkeypatch.setenv("TORCH_HOME", str(tmp_path / "weights"))
    for name in ("https_proxy", "HTTPS_PROXY"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")  # nobody listens there
    with pytest.raises(
        RunError, match=r"act cannot be made with these settings: .*: set pretrained_backbone: false, or conn"
    ):
        build(settings(recording, pretrained_backbone=True))
    assert list(place.glob("joshua-*")) == []


def test_pictures_of_a_data_set_that_is_fetched_are_not_distorted_either(recording: Path) -> None:
    seen = settings(recording, cameras=("top",), image_width=64, image_height=48)
    with pytest.raises(RunError, match=r"Pictures of top are 64 × 48, and 64 × 64 would .*: write image_wid"):
        build(seen.model_copy(update={"image_height": 64}))


def test_diffusion_leaves_out_the_frames_that_its_chunk_needs_after_them(
    recording: Path, tmp_path: Path
) -> None:
    def made(**fields: Any) -> Any:
        told = settings(recording, policy_type="diffusion", **{**DIFFUSION, "chunk_size": None, **fields})
        return make_config(told, Dataset.read(recording), {"observation.images.top": (48, 64)}, "cpu")[0]

    for fields in (
        {},
        {"actions_per_chunk": 4},
        {"chunk_size": 8},
        {"chunk_size": 8, "actions_per_chunk": 7},
    ):
        config = made(**fields)
        assert config.n_action_steps == fields.get("actions_per_chunk", config.horizon // 2)
        left_out = config.horizon - config.n_action_steps - config.n_obs_steps + 1  # as LeRobot states
        assert config.drop_n_last_frames == left_out
    tiny_policies.make_diffusion(tmp_path)
    told = settings(recording, policy_type="diffusion", **DIFFUSION, actions_per_chunk=7)
    far = told.model_copy(update={"pretrained": str(tmp_path), "chunk_size": None, "actions_per_chunk": 8})
    with pytest.raises(
        RunError, match=r"at most 7 of 8 actions are still .*, and 8 are not: write actions_p"
    ):
        make_config(far, Dataset.read(recording), {}, "cpu")


def test_each_process_has_a_gpu_of_its_own(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the figures of a machine with one GPU."""
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    said = "2 processes require as many GPUs, but PyTorch finds 1: set processes: 1, or CUDA_VISIBLE_DEVICES"
    with pytest.raises(RunError, match=said):
        build(settings(recording, device="cuda", processes=2))


def test_a_processor_that_emulates_half_precision_is_known(recording: Path) -> None:
    half = settings(recording, precision="bfloat16")
    assert is_emulated(half, "cpu", "AVX2")
    assert not is_emulated(half, "cpu", "AVX512")
    assert not is_emulated(half, "cuda", "AVX2")
    assert not is_emulated(settings(recording), "cpu", "AVX2")
    assert is_emulated(half, "cpu") == (torch.backends.cpu.get_cpu_capability() == "AVX2")
