"""Figures that have no interval, in the files of an evaluation."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from evaluated import evaluated
from joshua_evaluation import report
from joshua_evaluation.metrics import BUILT_IN, Episode
from joshua_evaluation.results import Intervals, Judged, as_json, as_text


def strict(text: str) -> Any:
    """What a reader of JSON other than Python's accepts."""

    def refused(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refused)


def test_one_episode_has_means_without_an_interval(
    tmp_path: Path, reaching: Path, random_policy: Path
) -> None:
    more = f'videos: 0 compare_with: "{reaching}" metrics: ["success_rate", "avg_return"]'
    made, context = evaluated(tmp_path, random_policy, more, episodes=1)
    content = strict((made / "results.json").read_text())
    for figures in (content["metrics"], content["compared"]["metrics"]):
        mean, rate = figures["avg_return"], figures["success_rate"]
        assert (mean["value"], mean["low"], mean["high"]) == (mean["episodes"][0], None, None)
        assert 0 < rate["high"] - rate["low"] < 1
    change = content["compared"]["differences"]["avg_return"]
    assert (change["low"], change["high"], change["p_value"]) == (None, None, None)
    page = (made / "report.html").read_text()
    assert "average return" in page
    assert ">–</td><td>bootstrap</td>" in page
    assert "nan" not in page
    assert len(context.ends) == 1


def test_a_second_checkpoint_that_played_nothing_has_no_figures() -> None:
    first, second = (Judged(name, list(BUILT_IN.values())[:3]) for name in "ab")
    for seed in (1, 2):
        first.add(Episode(seed, True, False, np.ones(3), np.zeros((3, 2)), {}, np.zeros(0), 0.04))
    about = {"environment": "x", "reward_function": "reach", "wanted": 2, "complete": False}
    content = as_json([first, second], about, Intervals(samples=100))
    found = strict(as_text(content).decode())["compared"]
    assert found["metrics"]["avg_return"]["value"] is None
    assert found["differences"]["success_rate"]["value"] is None
    page = report.page(content, [first, second], [])
    assert "Comparison in the same episodes" in page
