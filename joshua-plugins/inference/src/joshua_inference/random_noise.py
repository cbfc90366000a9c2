"""Uniformly random joint positions: a test of the inference pipeline, and the baseline of every policy."""

from __future__ import annotations

import numpy as np
from joshua.api import FloatArray, JointSpace, Model, ModelError, Observation
from joshua.features import FeatureSet

from joshua_inference.random_noise_settings import RandomNoiseSettings


class RandomNoise(Model):
    """Draws each joint's position uniformly about zero, clipped to its limits; ignores observations.

    Args:
        settings: seed and amplitude.
        joints: the commanded joints.
        features: not used.
    """

    settings: RandomNoiseSettings

    def __init__(
        self, settings: RandomNoiseSettings, joints: JointSpace, features: FeatureSet | None = None
    ) -> None:
        super().__init__(settings, joints, features)
        self._generator: np.random.Generator | None = None

    def load(self) -> None:
        """Seed the generator."""
        self._generator = np.random.default_rng(self.settings.seed)

    def reset(self) -> None:
        """Restart the sequence of actions."""
        self.load()

    def act(self, observation: Observation) -> FloatArray:
        """Draw one step of actions, shape (1, N)."""
        del observation
        if self._generator is None:
            raise ModelError("RandomNoise.act: the model is not loaded: call load first")
        amplitude = self.settings.amplitude_rad
        noise = self._generator.uniform(-amplitude, amplitude, (1, len(self.joints.names)))
        return np.clip(noise, self.joints.position_min_rad, self.joints.position_max_rad)

    def close(self) -> None:
        """Free the generator. Idempotent."""
        self._generator = None
