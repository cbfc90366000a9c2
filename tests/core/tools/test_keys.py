"""A screen with single keys, on a pseudo-terminal."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import sys
import termios
from collections.abc import Iterator
from typing import Any

import pytest
from joshua.tools import CallError, key_screen


class Terminal:
    """A pseudo-terminal in place of the standard input and output."""

    def __init__(self) -> None:
        self.master, self.slave = pty.openpty()
        self.before = termios.tcgetattr(self.slave)
        self.screens = 0

    def screen(self, keys: str) -> Any:
        """A screen whose first drawing has a person press keys."""

        def drawn(width: int) -> str:
            self.screens += 1
            if self.screens == 1:
                os.write(self.master, keys.encode())
            return f"{width} columns, drawn {self.screens} times"

        return drawn

    def text(self) -> str:
        found = b""
        while select.select([self.master], [], [], 0.1)[0]:
            found += os.read(self.master, 65536)
        return found.decode()


@contextlib.contextmanager
def at_terminal() -> Iterator[Terminal]:
    """In the test itself: pytest replaces the standard output between a fixture and its test."""
    made = Terminal()
    with (
        os.fdopen(os.dup(made.slave), "r") as keys,
        os.fdopen(os.dup(made.slave), "w") as screen,
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setattr(sys, "stdin", keys)
        patch.setattr(sys, "stdout", screen)
        patch.setenv("COLUMNS", "60")
        yield made
    assert termios.tcgetattr(made.slave) == made.before, "the terminal is as it was"
    os.close(made.slave)
    os.close(made.master)


def refuse() -> str:
    raise CallError("refused", "there is no episode to keep")


def test_each_key_acts_and_its_answer_stands_below() -> None:
    done: list[str] = []

    def begin() -> str:
        done.append("begin")
        return f"begun {len(done)}"

    with at_terminal() as terminal:
        # typed at once: none may wait in a buffer; others, and letters of several bytes, do nothing
        screen = terminal.screen("bxübkq")
        code = key_screen("x begin", screen, {"b": begin, "k": refuse}, "b begin   k keep")
        text = terminal.text()
    assert (code, done) == (0, ["begin", "begin"])
    assert "60 columns, drawn 1 times\r\n\r\nb begin   k keep\r\n\r\n" in text
    assert "begun 2" in text
    assert text.endswith("there is no episode to keep\r\n")


@pytest.mark.parametrize("keys", ["q", "\x04"])
def test_q_and_the_end_of_the_input_leave(keys: str) -> None:
    with at_terminal() as terminal:
        assert key_screen("x begin", terminal.screen(keys), {}, "") == 0
        assert terminal.screens == 1


def test_the_end_of_the_system_ends_the_screen() -> None:
    def gone() -> str:
        raise CallError("gone", "the system has ended")

    with at_terminal() as terminal, pytest.raises(CallError, match="the system has ended"):
        key_screen("x begin", terminal.screen("b"), {"b": gone}, "")


def test_without_a_terminal_an_action_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with open(os.devnull) as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        assert key_screen("record start", lambda width: "", {}, "") == 2
    assert capsys.readouterr().err == (
        "joshua record: keys need a terminal: name an action, such as `joshua record start`\n"
    )
