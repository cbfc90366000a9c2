"""Player and environment of one checkpoint, in this process or in a worker."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from joshua_evaluation.episodes import Arena, Player, play
from joshua_evaluation.metrics import Episode
from joshua_evaluation.settings import Candidate


@dataclass(frozen=True)
class Bout:
    """A checkpoint in an environment.

    Attributes:
        make: import string of the environment's factory; environment_id, reward_function: of the plan.
        randomise, task, strategy, steps_per_chunk, delay: as in ``EvaluationSettings``.
        noise_seed: of the model's random numbers, together with the seed of an episode.
    """

    candidate: Candidate
    make: str
    environment_id: str
    reward_function: str
    randomise: bool = False
    task: str = ""
    strategy: str = "SYNCHRONOUS"
    steps_per_chunk: int | None = None
    delay: int = 0
    noise_seed: int = 0

    def player(self) -> Player:
        """Make the player, which has loaded nothing."""
        from joshua_evaluation.players import ModelPlayer, PolicyPlayer

        if self.candidate.model is None:
            return PolicyPlayer(Path(self.candidate.path))
        return ModelPlayer(
            self.candidate.model,
            task=self.task,
            strategy=self.strategy,
            steps_per_chunk=self.steps_per_chunk,
            delay=self.delay,
            noise_seed=self.noise_seed,
        )

    def arena(self, options: dict[str, Any]) -> Arena:
        """Make the environment, with the options of a player."""
        varied = {"randomise": True} if self.randomise else {}
        return Arena(self.make, self.environment_id, self.reward_function, **options, **varied)


#: The player and the environment of the last episode that this process played as a worker.
_loaded: dict[str, tuple[Player, Arena]] = {}


def played(item: tuple[Bout, int]) -> Episode:
    """Play the episode of a seed in a worker, which keeps what it has loaded for the next one."""
    bout, seed = item
    key = repr(bout)
    if key not in _loaded:
        while _loaded:
            _, (player, arena) = _loaded.popitem()
            player.close()
            arena.close()
        player = bout.player()
        arena = bout.arena(player.options)
        player.load(arena)
        _loaded[key] = player, arena
    player, arena = _loaded[key]
    return play(arena, player, seed)
