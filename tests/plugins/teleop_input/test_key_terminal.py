"""The terminal as a source of keys, in a session of its own with a pseudo-terminal."""

from __future__ import annotations

import os
import pty
import select
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from typing import Any

import pytest

PROGRAM = """
import sys, time
from types import SimpleNamespace
from joshua.plan import SensorFacts
from joshua.supervisor.terminal_guard import TerminalGuard
from joshua_teleop_input.key_terminal import KeyTerminal
node = SimpleNamespace(facts=SensorFacts(terminal=True))
guard, terminal = TerminalGuard([node]), KeyTerminal()
try:
    terminal.open()
    print("open", flush=True)
    end = time.monotonic() + 60
    while time.monotonic() < end:
        data = terminal.read(0.1)
        if data:
            print("read", data, flush=True)
        if b"r" in data:
            terminal.report_releases()
        if b"i" in data:
            terminal.interrupt()
        if b"q" in data:
            break
        if b"g" in data:
            guard.close()
            print("guarded", flush=True)
            break
    else:
        print("nothing came", flush=True)
except BaseException as error:
    print(type(error).__name__, error, flush=True)
if "leave" not in sys.argv:
    terminal.close()
print("end", flush=True)
if "stay" in sys.argv:  # until it is killed: a terminal without a program has no settings to look at
    time.sleep(600)
"""


class Session:
    """A program that is the leader of a session on a pseudo-terminal."""

    def __init__(self, *arguments: str) -> None:
        go, gone = os.pipe()
        self.process_id, self.master = pty.fork()
        if self.process_id == 0:
            os.read(go, 1)  # until the terminal was looked at
            signal.signal(signal.SIGINT, signal.SIG_DFL)  # tests in the background of a shell ignore it
            os.execv(sys.executable, [sys.executable, "-c", PROGRAM, "stay", *arguments])
        self.text = b""
        self.first = self.attributes()
        os.write(gone, b"!")
        os.close(go)
        os.close(gone)

    def attributes(self) -> list[Any]:
        return termios.tcgetattr(self.master)

    def wait_for(self, text: bytes) -> None:
        deadline_s = time.monotonic() + 60
        while text not in self.text:
            assert time.monotonic() < deadline_s, self.text
            if select.select([self.master], [], [], 0.1)[0]:
                self.text += os.read(self.master, 4096)

    def type(self, data: bytes) -> None:
        os.write(self.master, data)

    def close(self) -> None:
        os.kill(self.process_id, signal.SIGKILL)
        os.waitpid(self.process_id, 0)
        os.close(self.master)


@pytest.fixture
def session() -> Iterator[Session]:
    begun = Session()
    yield begun
    begun.close()


def test_keys_come_at_once_and_are_not_shown(session: Session) -> None:
    session.wait_for(b"open")
    assert b"\x1b[?u" in session.text
    session.type(b"d")
    session.wait_for(b"read b'd'")
    assert session.attributes() != session.first
    session.type(b"q")
    session.wait_for(b"end")
    assert session.attributes() == session.first


def test_reports_of_releases_are_switched_off_again(session: Session) -> None:
    session.wait_for(b"open")
    session.type(b"r")
    session.wait_for(b"\x1b[>15u\x1b[?1004h")
    session.type(b"q")
    session.wait_for(b"end")
    assert b"\x1b[<u\x1b[?1004l" in session.text
    assert session.attributes() == session.first


def test_ctrl_c_ends_as_ever_and_ctrl_z_does_nothing(session: Session) -> None:
    session.wait_for(b"open")
    session.type(b"\x1a")
    session.wait_for(b"read b'\\x1a'")
    session.type(b"\x03")
    session.wait_for(b"KeyboardInterrupt")
    session.wait_for(b"end")
    assert session.attributes() == session.first


def test_ctrl_c_as_a_key_does_the_same(session: Session) -> None:
    session.wait_for(b"open")
    session.type(b"i")
    session.wait_for(b"KeyboardInterrupt")


def test_the_guard_restores_what_a_killed_reader_left() -> None:
    session = Session("leave")
    try:
        session.wait_for(b"open")
        assert session.attributes() != session.first
        session.type(b"g")
        session.wait_for(b"guarded")
        assert session.attributes() == session.first
        assert b"\x1b[<u\x1b[?1004l" in session.text
    finally:
        session.close()


def test_without_a_terminal_the_remedy_is_said() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, start_new_session=True, timeout=100
    )
    assert "InputDeviceError there is no terminal to read keys from" in done.stdout
    assert "over SSH: ssh -t" in done.stdout
    assert "drive with a gamepad" in done.stdout


def test_in_the_background_the_remedy_is_said() -> None:
    program = f"""
import os, subprocess, sys
child = subprocess.run([sys.executable, "-c", {PROGRAM!r}], process_group=0)
"""
    if sys.version_info < (3, 11):
        program = program.replace("process_group=0", "preexec_fn=os.setpgrp")
    process_id, master = pty.fork()
    if process_id == 0:
        os.execv(sys.executable, [sys.executable, "-c", program])
    text = b""
    deadline_s = time.monotonic() + 60
    while b"end" not in text and time.monotonic() < deadline_s:
        if select.select([master], [], [], 0.1)[0]:
            try:
                text += os.read(master, 4096)
            except OSError:
                break
    os.waitpid(process_id, 0)
    os.close(master)
    assert b"in the background of its terminal" in text, text
    assert b"bring it to the foreground (fg)" in text
