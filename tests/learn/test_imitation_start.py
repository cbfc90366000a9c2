"""Imitation: what a training takes from the checkpoint that it starts from, without a connection."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from joshua_imitation.learner import POLICY, Learner
from joshua_lerobot.checkpoint import read_checkpoint
from learners import DIFFUSION, differ, rows, weights
from learners import learner as learner
from learners import recording as recording
from torchvision.models import WeightsEnum, resnet18

MEAN = (0.485, 0.456, 0.406)


@pytest.mark.parametrize(
    "fields", [{}, {"policy_type": "diffusion", **DIFFUSION, "cameras": ("top",)}], ids=["act", "diffusion"]
)
def test_pictures_stay_normalised_as_in_the_checkpoint_and_nothing_is_downloaded(
    learner: Callable[..., Learner], monkeypatch: pytest.MonkeyPatch, fields: dict[str, Any]
) -> None:
    torch.manual_seed(0)
    downloaded = resnet18().state_dict()
    monkeypatch.setattr(WeightsEnum, "get_state_dict", lambda self, **options: downloaded)
    first = learner(pretrained_backbone=True, **fields)
    rows(first, 1)
    kept = first.save()

    def offline(self: Any, **options: Any) -> Any:
        raise OSError("no connection")

    monkeypatch.setattr(WeightsEnum, "get_state_dict", offline)
    own = learner(**fields)
    for again in (
        learner(pretrained=str(kept / POLICY), **fields),
        learner(kept, pretrained_backbone=True, **fields),
    ):
        assert not differ(weights(again), weights(first))
        saved = again.save() / POLICY
        found = read_checkpoint(saved).statistics
        assert found["observation.images.top"]["mean"] == pytest.approx(MEAN)
        assert found["action"] == read_checkpoint(own.save() / POLICY).statistics["action"]
        config = json.loads((saved / "config.json").read_text())
        assert config["pretrained_backbone_weights"] == "ResNet18_Weights.IMAGENET1K_V1"


def test_a_new_camera_is_normalised_as_all_of_the_checkpoint_are(
    learner: Callable[..., Learner], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    torch.manual_seed(0)
    downloaded = resnet18().state_dict()
    monkeypatch.setattr(WeightsEnum, "get_state_dict", lambda self, **options: downloaded)
    start = learner(pretrained_backbone=True, cameras=("wrist",)).save() / POLICY
    found = read_checkpoint(learner(pretrained=str(start), cameras=("top",)).save() / POLICY).statistics
    assert found["observation.images.top"]["mean"] == pytest.approx(MEAN)
