"""Batch normalisation that learns, for an image network without pretrained weights.

LeRobot's ACT freezes its batch normalisation, so that pretrained weights keep their statistics. Without such
weights, the frozen statistics are 0 and 1, and nothing is normalised. Here, such a network learns with batch
normalisation (Ioffe and Szegedy 2015). Its weights have the names and shapes of the frozen kind, so LeRobot
loads the checkpoint and computes the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch

from joshua_imitation.group import Group

_IMAGES = "observation.images"


class LearnedBatchNorm(torch.nn.BatchNorm2d):  # type: ignore[misc,unused-ignore]
    """Batch normalisation whose state has the entries of the frozen kind."""

    @classmethod
    def of(cls, frozen: Any) -> LearnedBatchNorm:
        """Return one with the weights and statistics of a frozen one."""
        made = cls(len(frozen.weight), eps=frozen.eps)
        made.register_buffer("num_batches_tracked", None)
        for name in ("weight", "bias", "running_mean", "running_var"):
            getattr(made, name).data.copy_(getattr(frozen, name))
        return made

    def forward(self, input: torch.Tensor) -> torch.Tensor:  # noqa: A002 (of torch)
        """Normalise by the batch; by the running statistics if it has one value, which has no spread."""
        if self.training and input[:, 0].numel() > 1:
            return super().forward(input)
        return torch.nn.functional.batch_norm(
            input, self.running_mean, self.running_var, self.weight, self.bias, eps=self.eps
        )


def learn_batch_norm(policy: Any) -> None:
    """Let the batch normalisation of an ACT policy learn, from all cameras together.

    LeRobot computes the features of one camera after the other. A batch of one camera has other statistics
    than all pictures, by which the finished policy normalises. So pictures of the same size pass through the
    network at once.
    """
    from torchvision.ops.misc import FrozenBatchNorm2d

    model = policy.model
    for module in list(model.backbone.modules()):
        for name, child in list(module.named_children()):
            if isinstance(child, FrozenBatchNorm2d):
                setattr(module, name, LearnedBatchNorm.of(child))
    ready: dict[int, Any] = {}

    def begin(_: Any, arguments: tuple[Mapping[str, Any], ...]) -> None:
        ready.clear()
        images = arguments[0].get(_IMAGES) or []
        if not model.training or len({image.shape for image in images}) != 1:
            return
        # colours last: convolutions on a CPU need up to a tenth less time
        stacked = torch.cat(list(images)).contiguous(memory_format=torch.channels_last)
        features = backbone(stacked)["feature_map"]
        ready.update(zip(map(id, images), features.chunk(len(images)), strict=True))

    def features_of(image: Any) -> dict[str, Any]:
        found = ready.pop(id(image), None)
        return backbone(image) if found is None else {"feature_map": found}

    backbone = model.backbone.forward
    model.backbone.forward = features_of
    model.register_forward_pre_hook(begin)


class Statistics:
    """Running statistics of the batch normalisations of a policy that learn; there may be none.

    They are those of ``LearnedBatchNorm``, and of Diffusion's image network with pretrained weights.
    """

    def __init__(self, policy: Any) -> None:
        norms = (module for module in policy.modules() if isinstance(module, torch.nn.BatchNorm2d))
        # without the counts of batches, which change nothing
        self._values = [value for norm in norms for value in norm.buffers() if value.is_floating_point()]
        self._kept: list[Any] = []
        self._changes: list[Any] = []

    def keep(self) -> None:
        """Begin an update: remember the values, to which every batch of it adds its part."""
        self._kept = [value.clone() for value in self._values]
        self._changes = [torch.zeros_like(value) for value in self._values]

    def collect(self, weight: float) -> None:
        """Take the change by a batch, which has a weight in the update, and return to the values before."""
        for value, kept, change in zip(self._values, self._kept, self._changes, strict=True):
            change.add_(value - kept, alpha=weight)
        self.undo()

    def undo(self) -> None:
        """Return to the values before the update."""
        for value, kept in zip(self._values, self._kept, strict=True):
            value.copy_(kept)

    def apply(self, group: Group) -> None:
        """Change the values by the batches of all processes. Raises RunError."""
        if self._values:
            group.sum_each(self._changes)
        for value, change in zip(self._values, self._changes, strict=True):
            value.add_(change)
