"""Buttons and spoken cues of a recording."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from eventually import eventually
from joshua.api import RefusedError
from joshua.messages import message_class
from joshua_dataset.buttons import NAMES, Buttons
from joshua_dataset.cues import Cues
from joshua_dataset.settings import StoreSettings


class Context:
    """What buttons and cues use of a node's context."""

    def __init__(self) -> None:
        self.log = logging.getLogger("buttons")
        self.stopping = False
        self.warnings: list[str] = []

    def warn(self, text: str) -> None:
        self.warnings.append(text)


@pytest.fixture
def context() -> Iterator[Context]:
    made = Context()
    yield made
    made.stopping = True


def joy(*held: str) -> Any:
    return message_class("sensor_msgs/msg/Joy")(axes=[], buttons=[int(name in held) for name in NAMES])


def test_a_button_acts_when_it_goes_down(context: Any, caplog: pytest.LogCaptureFixture) -> None:
    done: list[str] = []

    def refuse() -> str:
        raise RefusedError("there is no episode to keep: start one first")

    def start() -> str:
        done.append("start")
        return "episode 0 starts"

    buttons = Buttons(context, {"y": start, "a": refuse})
    thread = threading.Thread(target=buttons.run)
    with caplog.at_level(logging.INFO):
        thread.start()
        for held in (("y",), ("y",), (), ("y", "b"), ("y",), (), ("a",)):  # held at first: counts later
            buttons.take(joy(*held), 0)
        eventually(lambda: "no episode to keep" in caplog.text)
        context.stopping = True
        thread.join()
    assert done == ["start"]
    assert "episode 0 starts" in caplog.text


def test_two_meanings_of_one_button_are_refused() -> None:
    with pytest.raises(ValueError, match="the button 'a' has two functions"):
        StoreSettings(folder="/data", buttons={"record": "a", "keep": "a"})


def speaker(folder: Path, seconds: float) -> None:
    program = folder / "espeak-ng"
    program.write_text(f'#!/bin/sh\nshift\necho "$1" >> "{folder}/said"\nsleep {seconds}\n')
    program.chmod(0o755)


def test_cues_are_spoken_one_after_the_other(
    context: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    speaker(tmp_path, 0.3)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}/usr/bin{os.pathsep}/bin")
    monkeypatch.setattr("joshua_dataset.cues.SPEAKERS", (("espeak-ng", "--"),))
    cues = Cues(context, spoken=True)
    for text in ("recording episode 0", "stopped", "reset the scene"):
        cues.say(text)

    def said() -> list[str]:
        cues.tick()
        return (tmp_path / "said").read_text().splitlines() if (tmp_path / "said").exists() else []

    eventually(lambda: len(said()) == 2)
    assert said() == ["recording episode 0", "reset the scene"]  # what is out of date is left out
    cues.close()
    assert context.warnings == []


def test_a_missing_voice_is_a_warning(context: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    Cues(context, spoken=False).say("stopped")
    assert context.warnings == []
    Cues(context, spoken=True).say("stopped")
    (warning,) = context.warnings
    assert "spoken_cues has no effect: none of spd-say, espeak-ng, espeak, say is installed" in warning
