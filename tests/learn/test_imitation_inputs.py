"""Imitation: settings that do not fit LeRobot or the machine are named with what to do."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
import torch
from joshua_imitation.build import build, is_emulated
from joshua_training.run_folder import RunError
from learners import recording as recording
from learners import settings


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
