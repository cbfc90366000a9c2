"""Standard output and error, cut into lines."""

from __future__ import annotations

import os

import pytest
from joshua.ipc.line_budget import LineBudget
from joshua.supervisor.child import MAX_LINE_BYTES, LinePipe


class Clock:
    now_s = 0.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def stream():
    reading, writing = os.pipe()
    clock, lines = Clock(), []
    budget = LineBudget(5, clock)
    pipe = LinePipe(reading, budget, lines.append)
    parts = {"clock": clock, "lines": lines, "budget": budget, "writing": writing}
    vars(pipe).update(parts)
    yield pipe
    pipe.close()
    pipe.close()
    os.close(writing)


def test_lines_come_whole_however_they_were_written(stream):
    for part in (b"one\ntw", b"o\r\n", b"\nlast"):
        os.write(stream.writing, part)
        assert stream.read()
    assert stream.lines == ["one", "two", ""]
    stream.drain()
    assert stream.lines == ["one", "two", "", "last"]


def test_reading_never_blocks(stream):
    assert stream.read()
    assert stream.lines == []


def test_a_long_line_is_cut_with_a_count(stream):
    os.write(stream.writing, b"x" * 10_000)
    stream.read()
    os.write(stream.writing, b"x" * 10_000 + b"\nnext\n")
    stream.read()
    assert stream.lines == ["x" * MAX_LINE_BYTES + f" … ({20_000 - MAX_LINE_BYTES} more bytes)", "next"]


def test_bytes_that_are_no_text_are_shown(stream):
    os.write(stream.writing, b"\xff\xfe ok \xc3\xa4\n")
    stream.read()
    assert stream.lines == ["\\xff\\xfe ok ä"]


def test_a_flood_is_counted_not_split_and_told_later(stream):
    os.write(stream.writing, b"line\n" * 8)
    stream.read()
    assert stream.lines == ["line"] * 5
    os.write(stream.writing, b"line\n" * 100)
    stream.read()
    assert stream.budget.settle() == 0
    stream.clock.now_s = 2.0
    os.write(stream.writing, b"after\n")
    stream.read()
    assert stream.budget.settle() == 103
    assert stream.lines[-1] == "after"


def test_the_end_of_the_stream_is_told():
    reading, writing = os.pipe()
    lines = []
    pipe = LinePipe(reading, LineBudget(), lines.append)
    os.write(writing, b"unfinished")
    os.close(writing)
    assert pipe.read()
    assert not pipe.read()
    assert lines == ["unfinished"]
    pipe.close()
