"""Batch normalisation that learns: LeRobot computes the same, and validation leaves it as it is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from joshua_imitation.batch_norm import LearnedBatchNorm
from joshua_imitation.learner import POLICY, DivergedError, Learner
from learners import DIFFUSION, differ, rows, weights
from learners import learner as learner
from learners import recording as recording
from lerobot.policies.act.modeling_act import ACTPolicy
from torchvision.models import WeightsEnum, resnet18
from torchvision.ops.misc import FrozenBatchNorm2d

STATISTICS = ("running_mean", "running_var")


def norms(policy: Any, kind: type) -> list[Any]:
    return [module for module in policy.modules() if isinstance(module, kind)]


def statistics(made: Learner) -> dict[str, Any]:
    return {key: value for key, value in weights(made).items() if key.endswith(STATISTICS)}


def test_lerobot_computes_what_was_learned(learner: Callable[..., Learner]) -> None:
    made = learner(use_vae=False)
    rows(made, 8)
    policy = made.parts.policy
    learned = norms(policy, LearnedBatchNorm)
    assert learned
    assert all((norm.weight != 1).any() and (norm.running_var != 1).any() for norm in learned)
    theirs = ACTPolicy.from_pretrained(made.save() / POLICY, strict=True)
    assert len(norms(theirs, FrozenBatchNorm2d)) == len(learned)
    batch = made.parts.before(dict(made._maker.make(np.arange(4))))
    found = [each.eval().predict_action_chunk(dict(batch)) for each in (policy, theirs)]
    assert torch.allclose(*found, atol=1e-6)


def test_a_batch_is_normalised_over_all_cameras(learner: Callable[..., Learner]) -> None:
    made = learner(use_vae=False)
    policy = made.parts.policy
    (first,) = (norm for name, norm in policy.named_modules() if name == "model.backbone.bn1")
    seen: list[Any] = []
    first.register_forward_pre_hook(lambda _, arguments: seen.append(arguments[0].detach()))
    rows(made, 1)
    pictures = len(policy.config.image_features)
    assert pictures == 2
    assert [len(values) for values in seen[:1]] == [made._settings.batch_size * pictures]
    mean = seen[0].mean((0, 2, 3))
    assert torch.allclose(first.running_mean, first.momentum * mean, atol=1e-6)
    seen.clear()
    policy.eval().predict_action_chunk(made.parts.before(dict(made._maker.make(np.arange(4)))))
    assert [len(values) for values in seen] == [4, 4]  # as in LeRobot


def test_accumulated_batches_change_the_statistics_by_their_mean(learner: Callable[..., Learner]) -> None:
    made = learner(use_vae=False, accumulation_steps=2)
    first = next(norm for name, norm in made.parts.policy.named_modules() if name == "model.backbone.bn1")
    means: list[Any] = []
    first.register_forward_pre_hook(lambda _, arguments: means.append(arguments[0].detach().mean((0, 2, 3))))
    made.update()
    made.close()
    assert len(means) == 2
    assert torch.allclose(first.running_mean, first.momentum * (means[0] + means[1]) / 2, atol=1e-6)


def test_validation_and_a_batch_without_a_number_leave_the_statistics(
    learner: Callable[..., Learner], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = learner(use_vae=False, validation_share=0.5)
    rows(made, 2)
    before = {key: value.clone() for key, value in statistics(made).items()}
    assert before
    whole = weights(made)
    made.validate()
    assert all(norm.training for norm in norms(made.parts.policy, LearnedBatchNorm))
    assert not differ(whole, weights(made))
    make = type(made._maker).make

    def broken(self: Any, *arguments: Any) -> Any:
        batch = make(self, *arguments)
        return batch | {"observation.images.top": batch["observation.images.top"] * torch.nan}

    monkeypatch.setattr(type(made._maker), "make", broken)
    made.close()
    made._loader = None
    with pytest.raises(DivergedError):
        made.update()
    made.close()
    assert not differ(before, statistics(made))


@pytest.fixture
def pretrained(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Settings of a Diffusion policy with a pretrained image network, whose weights are not downloaded."""
    torch.manual_seed(0)
    made = resnet18().state_dict()
    monkeypatch.setattr(WeightsEnum, "get_state_dict", lambda self, **options: made)
    return {"policy_type": "diffusion", **DIFFUSION, "cameras": ("top",), "pretrained_backbone": True}


def test_validation_changes_nothing_of_a_pretrained_diffusion_policy(
    learner: Callable[..., Learner], pretrained: dict[str, Any]
) -> None:
    made = learner(**pretrained, validation_share=0.5)
    before = weights(made)
    assert any(key.endswith("running_mean") for key in before)
    one, other = made.validate(), made.validate()
    assert one == other
    assert not differ(before, weights(made))
    often, seldom = (learner(**pretrained, validation_steps=steps) for steps in (1, 100))
    for each in (often, seldom):
        rows(each, 2)
    assert not differ(weights(often), weights(seldom))


def test_batches_of_a_pretrained_diffusion_policy_change_its_statistics_by_their_mean(
    learner: Callable[..., Learner], pretrained: dict[str, Any]
) -> None:
    made = learner(**pretrained, accumulation_steps=2)
    first = next(norm for norm in made.parts.policy.modules() if isinstance(norm, torch.nn.BatchNorm2d))
    means: list[Any] = []
    first.register_forward_pre_hook(lambda _, arguments: means.append(arguments[0].detach().mean((0, 2, 3))))
    expected = 0.9 * first.running_mean
    made.update()
    made.close()
    assert len(means) == 2
    assert torch.allclose(first.running_mean, expected + 0.1 * (means[0] + means[1]) / 2, atol=1e-6)


def test_one_value_is_normalised_by_the_statistics() -> None:
    norm = LearnedBatchNorm.of(FrozenBatchNorm2d(3))
    value = torch.ones(1, 3, 1, 1)
    assert torch.allclose(norm(value), value, atol=1e-4)
    assert (norm.running_mean == 0).all()


def test_the_weights_of_a_checkpoint_stay_frozen(learner: Callable[..., Learner], tmp_path: Path) -> None:
    made = learner(use_vae=False)
    rows(made, 2)
    folder = made.save() / POLICY
    again = learner(use_vae=False, pretrained=str(folder))
    assert not norms(again.parts.policy, LearnedBatchNorm)
    before = {key: value.clone() for key, value in statistics(again).items()}
    assert not differ(before, statistics(made))
    rows(again, 1)
    assert not differ(before, statistics(again))
