"""The terminal: what goes where, and a terminal that stands still."""

from __future__ import annotations

import io
import logging
import os
import pty
import time

import pytest
from joshua.plan import RunReport
from joshua.plan.events import LogEntry, NodeStatus, RunStatus, StartTable
from joshua.supervisor.log_files import MAX_WAITING, BackgroundWriter
from joshua.supervisor.terminal import Terminal

REPORT = RunReport(exit_code=0, reason="done")


def entry(level, text):
    return LogEntry(0, "/a", level, text)


def status(phase="running"):
    return RunStatus("r", "m", phase, 1.0, 1, (NodeStatus("/a", "ready", 1, 0),))


def test_logs_go_to_one_stream_by_level_and_the_rest_to_the_other():
    output, errors = io.StringIO(), io.StringIO()
    terminal = Terminal(logging.INFO, output, errors)
    terminal(entry(logging.DEBUG, "detail"))
    terminal(entry(logging.INFO, "news"))
    terminal(StartTable("r.pbtxt", "m", "", "zenoh", 0.1, ()))
    terminal(status())
    terminal(REPORT)

    assert errors.getvalue().endswith("INFO    /a: news\n")
    assert "detail" not in errors.getvalue()
    assert output.getvalue().startswith("r.pbtxt · m\n")
    assert output.getvalue().endswith("ended with 0: done\n")
    assert "\x1b" not in output.getvalue() + errors.getvalue()
    assert "running 1 s" not in output.getvalue()


def test_without_a_terminal_the_status_is_a_line_now_and_then(monkeypatch):
    monkeypatch.setattr("joshua.supervisor.terminal.PLAIN_STATUS_PERIOD_S", 0.0)
    output = io.StringIO()
    terminal = Terminal(logging.INFO, output, io.StringIO())
    terminal(status("starting"))
    terminal(status())
    terminal(REPORT)
    assert output.getvalue().splitlines()[0] == "running 1 s | /a"


def test_in_a_terminal_the_status_stays_below_the_log_and_levels_have_colours(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    master, slave = pty.openpty()
    with open(slave, "w") as stream:
        terminal = Terminal(logging.INFO, stream, stream)
        terminal(status())
        terminal(entry(logging.ERROR, "broken"))
        terminal(REPORT)
        shown = b""
        while b"ended with" not in shown:
            shown += os.read(master, 65536)
    os.close(master)
    text = shown.decode()
    assert text.startswith("\r\x1b[Krunning 1 s | /a\r\x1b[K\x1b[31m")
    assert "broken\x1b[0m\r\nrunning 1 s | /a\r\x1b[K" in text


def test_a_status_of_several_lines_is_replaced_as_a_whole(monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    monkeypatch.setenv("LINES", "4")
    master, slave = pty.openpty()
    nodes = tuple(NodeStatus(f"/node_{number}", "ready", 1, 0) for number in range(9))
    with open(slave, "w") as stream:
        terminal = Terminal(logging.INFO, stream, stream)
        for _ in range(2):
            terminal(RunStatus("r", "m", "running", 1.0, 1, nodes))
        terminal(REPORT)
        shown = b""
        while b"ended with" not in shown:
            shown += os.read(master, 65536)
    os.close(master)
    lines = "running 1 s\r\n  /node_0\r\n  /node_1"  # as many as the terminal shows
    assert shown.decode().startswith(f"\r\x1b[K{lines}\r\x1b[2A\x1b[J{lines}\r\x1b[2A\x1b[Jended with 0")


def test_a_reader_that_has_gone_is_no_failure():
    reading, writing = os.pipe()
    os.close(reading)
    stream = open(writing, "w")  # noqa: SIM115
    terminal = Terminal(logging.INFO, stream, stream)
    for _ in range(10):
        terminal(entry(logging.INFO, "x" * 1000))
    terminal(REPORT)
    with pytest.raises(BrokenPipeError):
        stream.close()


def test_a_terminal_that_stands_still_holds_up_nobody():
    reading, writing = os.pipe()
    stream = open(writing, "w")  # noqa: SIM115
    terminal = Terminal(logging.INFO, stream, stream)
    terminal(entry(logging.INFO, "x" * 200_000))
    began_s = time.monotonic()
    for _ in range(3 * MAX_WAITING):
        terminal(entry(logging.INFO, "more"))
    waited_s = time.monotonic() - began_s
    assert terminal._writer.dropped > 0
    assert waited_s < 30.0
    os.set_blocking(reading, False)
    while not terminal._writer.close(0.01):
        try:
            os.read(reading, 65536)
        except BlockingIOError:
            continue
    stream.close()
    os.close(reading)


def test_a_writer_that_was_never_used_closes():
    writer = BackgroundWriter[str](lambda lines: None, "x")
    assert writer.close(1.0)
    writer.put("late")
    assert writer.dropped == 1
