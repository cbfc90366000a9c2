"""What every learner of a policy does, whatever it computes with: tests that a trainer's class inherits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest
from joshua_training.run_folder import RunError

#: Fields of ``rl_config`` that every trainer reads, with values that ``make`` does not choose.
FIELDS: tuple[dict[str, Any], ...] = (
    {},
    {"num_envs": 12},
    {"learning_rate": 0.001},
    {"gamma": 0.5},
    {"clip_range": 0.01},
    {"batch_size": 8},
    {"n_steps": 6},
    {"n_epochs": 3},
    {"gae_lambda": 0.2},
    {"entropy_weight": 0.5},
    {"value_weight": 0.1},
    {"max_grad_norm": 0.01},
    {"target_kl": 0.00001},
    {"hidden_sizes": [8]},
    {"activation": "relu"},
    {"initial_log_std": -2.0},
    {"normalize_observations": True},
    {"normalize_rewards": True},
)

_BASES: dict[type, dict[str, Any]] = {}


def differ(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return one.keys() != other.keys() or any(not np.array_equal(one[key], other[key]) for key in one)


class LearnerBehaviours:
    """Tests of a learner, which ``make`` makes."""

    #: After how many questions whether to stop an iteration is stopped.
    STOPS: ClassVar[tuple[int, ...]] = (3,)

    def make(self, asked: Callable[[], bool] = lambda: False, **fields: Any) -> Any:
        """Make a learner, equal to any other of the same fields."""
        raise NotImplementedError

    def weights(self, made: Any) -> dict[str, Any]:
        """Return the weights of the last complete iteration."""
        policy: dict[str, Any] = made.snapshot()[0]
        return policy

    def fill_value(self, made: Any, value: float) -> None:
        """Overwrite weights of the value function."""
        raise NotImplementedError

    def learned(self, **fields: Any) -> dict[str, Any]:
        """Return the weights after some iterations, with nothing normalised unless the fields say so."""
        made = self.make(**fields)
        assert all(made.iterate() is not None for _ in range(2))
        return self.weights(made)

    @pytest.mark.parametrize("changed", FIELDS, ids=lambda changed: next(iter(changed), "nothing"))
    def test_every_field_takes_effect(self, changed: dict[str, Any]) -> None:
        base = _BASES[type(self)] = _BASES.get(type(self)) or self.learned()
        assert differ(base, self.learned(**changed)) == bool(changed)

    def test_a_stop_in_the_middle_keeps_the_last_whole_iteration(self) -> None:
        for questions in self.STOPS:
            left = [10**9]

            def asked(left: list[int] = left) -> bool:
                left[0] -= 1
                return left[0] < 0

            made = self.make(asked, n_epochs=50)
            assert made.iterate() is not None
            kept, steps = self.weights(made), made.steps
            left[0] = questions
            assert made.iterate() is None
            assert left[0] == -1
            assert not differ(kept, self.weights(made))
            assert getattr(made, "complete_steps", made.steps) == steps

    @pytest.mark.parametrize("value", [float("nan"), 1e30])
    def test_a_loss_that_is_no_number_stops_with_what_to_do(self, value: float) -> None:
        made = self.make()
        made.iterate()
        self.fill_value(made, value)
        kept = self.weights(made)
        with pytest.raises(RunError, match=r"is not a number after \d+ steps: lower learning_rate"):
            made.iterate()
        batch = made.last_batch()
        assert batch["observations"].ndim == 2
        kept_weights = [values for name, values in batch.items() if name.startswith("weights.")]
        assert not all(np.isfinite(values).all() for values in kept_weights)
        if hasattr(made, "snapshot"):
            assert not differ(kept, self.weights(made)) or np.isnan(value)
