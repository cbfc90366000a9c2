"""SAC that normalises with the present moments: its replay buffer holds what the environments returned."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from joshua_training.run_folder import RunError
from stable_baselines3 import SAC
from stable_baselines3.common.buffers import ReplayBuffer

from joshua_ppo_trainer.normalise import Normaliser

#: Arrays of a replay buffer for each step, and their prefix in a checkpoint.
_REPLAYED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
PREFIX = "replay."


class Replay(ReplayBuffer):  # type: ignore[misc,unused-ignore]
    """Replay buffer that normalises its batches, and can return to the last complete iteration.

    A copy for each iteration would take as much memory as the buffer, so only the steps that an iteration
    overwrites are kept.

    Args:
        normaliser: of the learner; the others are those of stable-baselines3.

    Attributes:
        last: the last batch.
    """

    pos: int
    full: bool

    def __init__(self, *args: Any, normaliser: Normaliser, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._present = SimpleNamespace(normalize_obs=normaliser.shown, normalize_reward=normaliser.scaled)
        self.last: Any = None
        self.mark()

    def sample(self, batch_size: int, env: Any = None) -> Any:
        """Return a batch, normalised with the moments of now; ``env`` has no effect."""
        self.last = super().sample(batch_size, self._present)
        return self.last

    def add(self, *args: Any) -> None:
        """Add a step of all environments."""
        at = self.pos
        if (self._marked_full or at < self._marked_at) and at not in self._overwritten:
            self._overwritten[at] = [getattr(self, name)[at].copy() for name in _REPLAYED]
        super().add(*args)

    def mark(self) -> None:
        """Make the present content the one that ``undo`` returns to."""
        self._marked_at, self._marked_full = self.pos, self.full
        self._overwritten: dict[int, list[Any]] = {}

    def undo(self) -> None:
        """Remove the steps since the last ``mark``."""
        for at, rows in self._overwritten.items():
            for name, row in zip(_REPLAYED, rows, strict=True):
                getattr(self, name)[at] = row
        self.pos, self.full = self._marked_at, self._marked_full
        self._overwritten = {}

    def arrays(self) -> dict[str, Any]:
        """Return views of the content by name, for a checkpoint."""
        rows = self.buffer_size if self.full else self.pos
        return {f"{PREFIX}{name}": getattr(self, name)[:rows] for name in _REPLAYED}

    def state(self) -> dict[str, Any]:
        """Return where the next step goes, for a checkpoint."""
        return {"position": self.pos, "full": bool(self.full)}

    def load(self, arrays: Mapping[str, Any], state: Mapping[str, Any]) -> None:
        """Load the content from a checkpoint. Raises RunError if it does not fit."""
        for name in _REPLAYED:
            kept, wanted = arrays.get(f"{PREFIX}{name}"), getattr(self, name)
            if kept is None or len(kept) > len(wanted) or kept.shape[1:] != wanted.shape[1:]:
                raise RunError(
                    "the replay buffer of the checkpoint does not fit: continue with the buffer_size of "
                    "the run"
                )
            wanted[: len(kept)] = kept
        self.pos, self.full = state["position"], state["full"]
        self.mark()


class NormalisedSac(SAC):  # type: ignore[misc,unused-ignore]
    """SAC whose policy sees normalised observations, though the environments return others.

    Args:
        normaliser: of the learner; the others are those of stable-baselines3.
    """

    def __init__(self, *args: Any, normaliser: Normaliser, **kwargs: Any) -> None:
        self._normaliser = normaliser
        replay = {"replay_buffer_class": Replay, "replay_buffer_kwargs": {"normaliser": normaliser}}
        super().__init__(*args, **replay, **kwargs)

    def predict(self, observation: Any, *args: Any, **kwargs: Any) -> Any:
        """Return actions for observations of the environments, which are normalised here."""
        return super().predict(self._normaliser.shown(np.asarray(observation)), *args, **kwargs)
