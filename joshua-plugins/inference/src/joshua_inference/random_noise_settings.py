"""Settings of the random action generator."""

from __future__ import annotations

from joshua.api import BlockSettings


class RandomNoiseSettings(BlockSettings):
    """Settings of the random action generator.

    Attributes:
        seed: of the generator; the same seed gives the same actions.
        amplitude_rad: half-width of the uniform distribution about zero.
    """

    seed: int
    amplitude_rad: float
