from __future__ import annotations

import numpy as np
import pytest
from joshua.models.model import ChunkRequest


def test_the_mask_of_a_chunk_is_that_of_the_paper():
    # H = 10 steps, d = 3 fixed, s = 4 of the horizon, so that the overlap is H - s = 6 (equation 5)
    request = ChunkRequest(np.zeros((6, 2)), delay=3, overlap=6)
    falling = [(6 - i) / (6 - 3 + 1) for i in (3, 4, 5)]
    soft = [c * (np.exp(c) - 1) / (np.e - 1) for c in falling]
    assert request.weights(10) == pytest.approx([1, 1, 1, *soft, 0, 0, 0, 0])
    linear = ChunkRequest(np.zeros((6, 2)), 3, 6, schedule="linear")
    assert linear.weights(10) == pytest.approx([1, 1, 1, *falling, 0, 0, 0, 0])


@pytest.mark.parametrize(("schedule", "soft"), [("ones", 1.0), ("zeros", 0.0)])
def test_the_plain_schedules_weigh_the_overlap_alike(schedule: str, soft: float):
    request = ChunkRequest(np.zeros((6, 2)), delay=2, overlap=4, schedule=schedule)
    assert request.weights(5).tolist() == [1, 1, soft, soft, 0]


def test_a_delay_beyond_the_overlap_or_the_chunk_fixes_what_there_is():
    assert ChunkRequest(np.zeros((2, 1)), delay=5, overlap=2).weights(4).tolist() == [1, 1, 0, 0]
    assert ChunkRequest(np.zeros((9, 1)), delay=9, overlap=9).weights(3).tolist() == [1, 1, 1]
