"""Running moments that bring observations and rewards to unit size."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

#: Limit of normalised observations and rewards.
LIMIT = 10.0


class Moments:
    """Mean and variance of a stream of rows, by the parallel algorithm of Chan et al.

    Args:
        shape: of one row; () for numbers.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.mean: FloatArray = np.zeros(shape)
        self.variance: FloatArray = np.ones(shape)
        self.count = 1e-4

    def update(self, rows: Any) -> None:
        """Add rows, shape (N, …)."""
        values = np.asarray(rows, np.float64)
        mean, variance, count = values.mean(axis=0), values.var(axis=0), len(values)
        total = self.count + count
        way = mean - self.mean
        spread = self.variance * self.count + variance * count + way**2 * (self.count * count / total)
        self.mean = self.mean + way * (count / total)
        self.variance = spread / total
        self.count = total

    def arrays(self, prefix: str) -> dict[str, FloatArray]:
        """Return the numbers by name, for a checkpoint."""
        return {
            f"{prefix}.mean": np.atleast_1d(self.mean),
            f"{prefix}.variance": np.atleast_1d(self.variance),
            f"{prefix}.count": np.array([self.count]),
        }

    def load(self, prefix: str, arrays: dict[str, Any]) -> None:
        """Load the numbers of a checkpoint."""
        shape = self.mean.shape
        self.mean = np.array(arrays[f"{prefix}.mean"], np.float64).reshape(shape)
        self.variance = np.array(arrays[f"{prefix}.variance"], np.float64).reshape(shape)
        self.count = float(arrays[f"{prefix}.count"][0])


class Normaliser:
    """Normalises the observations and rewards of an environment.

    Args:
        width: numbers of an observation; count: environments; gamma: discount of the learner.
        observations, rewards: what is normalised; the rest passes unchanged.

    Attributes:
        learning: whether to update the moments; False for evaluation.
    """

    def __init__(self, width: int, count: int, gamma: float, *, observations: bool, rewards: bool) -> None:
        self.observations, self.rewards = observations, rewards
        self.observed, self.returned = Moments((width,)), Moments(())
        self._returns = np.zeros(count)
        self._gamma = gamma
        self.learning = True

    def observation(self, values: Any) -> Any:
        """Normalise the observations of a step, shape (N, K), float32, and update the moments."""
        if self.observations and self.learning:
            self.observed.update(values)
        return self.shown(values)

    def shown(self, values: Any) -> Any:
        """Normalise observations without an update of the moments."""
        if not self.observations:
            return values
        scaled = (values - self.observed.mean) / np.sqrt(self.observed.variance + 1e-8)
        return np.clip(scaled, -LIMIT, LIMIT).astype(np.float32)

    def reward(self, values: Any, over: Any) -> Any:
        """Divide the rewards of a step, shape (N,), by the spread of the discounted returns, float32."""
        if self.rewards and self.learning:
            self._returns = self._returns * self._gamma + values
            self.returned.update(self._returns)
            self._returns[over] = 0.0
        return self.scaled(values)

    def scaled(self, values: Any) -> Any:
        """Divide rewards by the spread of the discounted returns without an update of the moments."""
        if not self.rewards:
            return values.astype(np.float32)
        scaled = values / np.sqrt(self.returned.variance + 1e-8)
        return np.clip(scaled, -LIMIT, LIMIT).astype(np.float32)

    def arrays(self) -> dict[str, FloatArray]:
        """Return the numbers by name, for a checkpoint."""
        own = {"normalise.returns": self._returns.copy()}
        return own | self.observed.arrays("normalise.observed") | self.returned.arrays("normalise.returned")

    def load(self, arrays: dict[str, Any]) -> None:
        """Load the numbers of a checkpoint."""
        self.observed.load("normalise.observed", arrays)
        self.returned.load("normalise.returned", arrays)
        if arrays["normalise.returns"].shape == self._returns.shape:
            self._returns = np.array(arrays["normalise.returns"], np.float64)


class Unapplied:
    """Updates the moments of a normaliser with values, and returns the values unchanged.

    For learners that keep values for long, and normalise them when they use them.
    """

    def __init__(self, normaliser: Normaliser) -> None:
        self._normaliser = normaliser

    def observation(self, values: Any) -> Any:
        """See ``Normaliser``."""
        self._normaliser.observation(values)
        return values

    def shown(self, values: Any) -> Any:
        """See ``Normaliser``."""
        return values

    def reward(self, values: Any, over: Any) -> Any:
        """See ``Normaliser``."""
        self._normaliser.reward(values, over)
        return values.astype(np.float32)
