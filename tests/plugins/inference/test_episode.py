"""The screen of ``joshua episode``, and what it says without a terminal."""

from __future__ import annotations

import pytest
from joshua_inference import episode

FIGURES = {
    "state": "acts",
    "episodes": 3,
    "successes": 2,
    "chunks": 41,
    "latency_p50_s": 0.302,
    "age_p50_s": 0.724,
    "skipped": 80,
}


def test_the_screen_shows_state_and_share_of_successes() -> None:
    assert episode.screen("/policy", FIGURES, 80).splitlines() == [
        "/policy: acts",
        "episodes: 3   succeeded: 2 (67%)",
        "chunks: 41   model: 302 ms   age: 0.72 s   skipped: 80",
    ]
    none = episode.screen("/policy", {**FIGURES, "episodes": 0, "successes": 0}, 10)
    assert none.splitlines()[1] == "episodes: "


def test_every_key_is_an_action_and_stands_in_the_help() -> None:
    assert set(episode.KEYS.values()) == set(episode.ACTIONS)
    assert all(f"{key} " in episode.HELP for key in episode.KEYS)


def test_keys_need_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    assert episode._interactive(None, "/policy", 1.0) == 2  # type: ignore[arg-type]
    assert capsys.readouterr().err == (
        "joshua episode: keys need a terminal: name an action, such as `joshua episode begin`\n"
    )
