"""Random changes of pictures and joints, determined by seed and update, whichever thread prepares a batch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from joshua_imitation.data import Array

#: Weights of red, green and blue in perceived brightness.
_GREY = (0.299, 0.587, 0.114)


@dataclass(frozen=True)
class Augmentation:
    """Settings of the random changes.

    Attributes:
        colour: largest change of brightness, contrast and saturation, as a share.
        shift_px: largest shift in each direction.
        seed: of the changes.
        state: spread of the noise on the joints that the policy sees, as a share of their own spread.
    """

    colour: float
    shift_px: int
    seed: int
    state: float = 0.0

    def chances(self, frames: Array, update: int, number: int) -> Array:
        """Return the changes of each sample, (B, 5) from -1 to 1: the same for all its pictures."""
        draw = np.random.default_rng([self.seed, 3, update, number])
        return draw.uniform(-1.0, 1.0, (len(frames), 5))

    def disturb(self, joints: Any, spread: Array, update: int, number: int) -> Any:
        """Return changed joints, (B, …, n), whose spread in the data set is known."""
        if not self.state:
            return joints
        draw = np.random.default_rng([self.seed, 4, update, number])
        noise = (self.state * spread * draw.standard_normal(joints.shape)).astype(np.float32)
        return joints + torch.from_numpy(noise)

    def apply(self, pictures: Any, chances: Array) -> Any:
        """Return changed pictures, (B, …, 3, H, W) from 0 to 1."""
        shape = (len(chances), *(1 for _ in pictures.shape[1:]))
        if self.colour:
            factors = torch.from_numpy(1.0 + self.colour * chances[:, :3]).float()
            bright, contrast, colour = (factors[:, index].reshape(shape) for index in range(3))
            pictures = pictures * bright
            middle = pictures.mean(dim=(-3, -2, -1), keepdim=True)
            pictures = middle + contrast * (pictures - middle)
            weights = torch.tensor(_GREY).reshape(3, 1, 1)
            grey = (pictures * weights).sum(dim=-3, keepdim=True)
            pictures = (grey + colour * (pictures - grey)).clamp(0.0, 1.0)
        if self.shift_px:
            moves = np.rint(self.shift_px * chances[:, 3:]).astype(int)
            pictures = torch.stack(
                [_shifted(picture, *move) for picture, move in zip(pictures, moves, strict=True)]
            )
        return pictures


def _shifted(pictures: Any, right: int, down: int) -> Any:
    """Shift pictures (…, H, W) by some pixels; the gap repeats the border."""
    height, width = pictures.shape[-2:]
    rows = torch.arange(height).sub(down).clamp(0, height - 1)
    columns = torch.arange(width).sub(right).clamp(0, width - 1)
    return pictures[..., rows, :][..., columns]
