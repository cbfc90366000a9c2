from __future__ import annotations

import numpy as np
from joshua.models.chunk_player import ChunkPlayer


def chunk(*steps: float) -> np.ndarray:
    return np.array(steps)[:, None]


def test_chunks_play_one_after_the_other_and_are_wanted_in_time() -> None:
    player = ChunkPlayer()
    assert player.step() is None
    assert player.wait_until_wanted(0.0)
    player.put(chunk(1, 2, 3, 4))
    assert not player.wait_until_wanted(0.0)
    assert player.step() == 1
    assert not player.wait_until_wanted(0.0)
    assert player.step() == 2
    assert player.wait_until_wanted(0.0), "half of it is left"
    player.put(chunk(5))
    assert [float(step[0]) for step in (player.step(), player.step(), player.step()) if step is not None] == [
        3,
        4,
        5,
    ]
    assert player.step() is None


def test_what_was_to_be_played_can_be_dropped() -> None:
    player = ChunkPlayer()
    player.put(chunk(1, 2))
    player.step()
    player.put(chunk(3))
    player.clear()
    assert player.step() is None
