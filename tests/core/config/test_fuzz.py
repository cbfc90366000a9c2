"""Ten thousand mutilated files: loading, checking and rendering end in findings, never in a traceback.

Hypothesis draws a file and what is done to it. The draws follow from the number of the part alone, so that
every run tries the same files; a failure is reduced to the fewest mutilations that still break the program.
"""

from __future__ import annotations

import json
import random
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from joshua.config import check, load
from joshua.config.checks.paths import check_paths
from joshua.config.diagnostics import render_json, render_text
from joshua.modes import check_mode

FILES = 10_000
PARTS = 20
# Far more than any file needs on a busy machine: what takes longer hangs.
LONGEST_S = 30

ROOT = Path(__file__).parents[3]
ORIGINALS = {
    f"{folder.name}/{path.name}": path.read_bytes()
    for folder in (ROOT / "configs", Path(__file__).parent / "bad", Path(__file__).parent / "good")
    for path in sorted(folder.glob("*.pbtxt"))
}
HOSTILE = [
    b"\x00",
    b"\xff\xfe",
    b"\xc3",
    b"\xed\xa0\x80",
    b"\xf4\x90\x80\x80",
    b"\xef\xbb\xbf",
    "\u202e\u0000机\U0001f916".encode(),
    b'"',
    b"'",
    b"\\",
    b"\\x",
    b"\\777",
    b"\\u12",
    b"#",
    b"{" * 50,
    b"[" * 50,
    b"}" * 50,
    b"<",
    b": " * 20,
    b"\r",
    b"\t",
    b"\x1b[2J",
    b"nan",
    b"-inf",
    b"1e999",
    b"-0",
    b"0x7fffffffffffffff",
    b"99999999999999999999999999",
    b"1.5f",
    b"-",
    b"general",
    b"[type.googleapis.com/google.protobuf.Any]",
    b"[type.example.org/joshua.Config] { general { mode: 1 } }",
    b"plugin_config { type_url: 'x/joshua.Node' value: '\\377\\377' }",
    b'include: "."',
    b'include: "robot.pbtxt"',
    b'include: "/dev/stdin"',
]


def flip_bytes(data: bytes, chance: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(chance.randint(1, 8)):
        if changed:
            changed[chance.randrange(len(changed))] = chance.randrange(256)
    return bytes(changed)


def cut_out(data: bytes, chance: random.Random) -> bytes:
    start = chance.randrange(len(data) + 1)
    return data[:start] + data[start + chance.randint(1, 200) :]


def cut_end(data: bytes, chance: random.Random) -> bytes:
    return data[: chance.randrange(len(data) + 1)]


def insert_hostile(data: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(data) + 1)
    return data[:at] + chance.choice(HOSTILE) + data[at:]


def repeat_part(data: bytes, chance: random.Random) -> bytes:
    start = chance.randrange(len(data) + 1)
    part = data[start : start + chance.randint(1, 300)]
    return data[:start] + part * chance.randint(2, 8) + data[start:]


def swap_words(data: bytes, chance: random.Random) -> bytes:
    words = data.split(b" ")
    for _ in range(chance.randint(1, 6)):
        one, other = chance.randrange(len(words)), chance.randrange(len(words))
        words[one], words[other] = words[other], words[one]
    return b" ".join(words)


def swap_lines(data: bytes, chance: random.Random) -> bytes:
    lines = data.split(b"\n")
    for _ in range(chance.randint(1, 4)):
        one, other = chance.randrange(len(lines)), chance.randrange(len(lines))
        lines[one], lines[other] = lines[other], lines[one]
    return b"\n".join(lines)


def drop_lines(data: bytes, chance: random.Random) -> bytes:
    lines = data.split(b"\n")
    return b"\n".join(line for line in lines if chance.random() > 0.15)


def change_value(data: bytes, chance: random.Random) -> bytes:
    lines = data.split(b"\n")
    at = chance.randrange(len(lines))
    name, colon, _ = lines[at].partition(b":")
    if colon:
        values = (
            b"0",
            b"-1",
            b"nan",
            b'""',
            b'"\\377"',
            b"{}",
            b"[]",
            b"2147483647",
            b"1e308",
            b"true",
            b"X",
        )
        lines[at] = name + b": " + chance.choice(values)
    return b"\n".join(lines)


def splice_in(data: bytes, chance: random.Random) -> bytes:
    other = chance.choice(list(ORIGINALS.values()))
    at, start = chance.randrange(len(data) + 1), chance.randrange(len(other))
    return data[:at] + other[start : start + chance.randint(1, 2000)] + data[at:]


def nest(data: bytes, chance: random.Random) -> bytes:
    depth = chance.choice((5, 20, 50, 99, 100, 101, 1000))
    block = chance.choice((b"robot {", b"actions { node {", b"x <", b"y: [", b"general { qos {"))
    at = chance.randrange(len(data) + 1)
    return data[:at] + block * depth + data[at:]


MUTATIONS: list[Callable[[bytes, random.Random], bytes]] = [
    change_value,
    cut_out,
    cut_end,
    drop_lines,
    flip_bytes,
    insert_hostile,
    nest,
    repeat_part,
    splice_in,
    swap_lines,
    swap_words,
    change_value,
]
#: One number for each mutilation: it decides which, where and how.
STEPS = st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=6)


def mutated(original: str, steps: list[int]) -> bytes:
    """One of the files, mutilated step by step."""
    data = ORIGINALS[original]
    for number in steps:
        data = MUTATIONS[number % len(MUTATIONS)](data, random.Random(number))
    return data[:30_000]


@contextmanager
def hang_guard() -> Iterator[None]:
    def ring(_signal: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"the file took more than {LONGEST_S} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, LONGEST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("part", range(PARTS))
def test_no_mutilated_file_breaks_the_program(
    part: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "robot.pbtxt"
    with_findings: list[bool] = []

    @seed(part)
    @settings(
        max_examples=FILES // PARTS,
        deadline=None,
        database=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    @given(original=st.sampled_from(sorted(ORIGINALS)), steps=STEPS)
    def no_file_does(original: str, steps: list[int]) -> None:
        file.write_bytes(mutated(original, steps))
        with hang_guard():
            with_findings.append(examine(way=sum(steps)))

    no_file_does()
    assert len(with_findings) >= FILES // PARTS
    assert sum(with_findings) > 0.5 * len(with_findings)


def examine(way: int) -> bool:
    """Looks at the file as a launch does or as a check does, in colour or as JSON, by the number given."""
    loaded = load("robot.pbtxt")
    found = [
        *loaded.diagnostics,
        *check(loaded),
        *check_mode(loaded),
        *check_paths(loaded, launch=way % 2 == 0),
    ]
    text = render_text(found, loaded.sources, color=way % 3 == 0)
    text.encode("utf-8")
    if way % 5 == 0:
        assert len(json.loads(render_json(found, loaded.sources))) == len(found)
    assert bool(text) == bool(found)
    assert len({(item.code, str(item.position), item.field_path, item.message) for item in found}) == len(
        found
    )
    return bool(found)
