"""Terminals are recorded from real shells and drawn as text, still and in motion."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from terminal_picture import COLOURS, Recording, Type, moving, record, still

STEPS = (
    Type(r"printf 'one\n\033[1;31mred <tag>\033[0m\n'"),
    Type(r"for n in 1 2 3; do printf '\rcount %s' $n; sleep 0.15; done; echo"),
    Type("cat", until="\r\n", linger_s=0.5, then="ab\r\x03"),
)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory):
    return record(STEPS, columns=60, folder=tmp_path_factory.mktemp("shell"), timeout_s=60)


def texts(svg: str) -> list[str]:
    root = ElementTree.fromstring(svg)
    return [element.text or "" for element in root.iter("{http://www.w3.org/2000/svg}text")]


def test_a_still_shows_the_last_screen_with_colours(recording) -> None:
    svg = still(recording, title="a shell")
    assert texts(svg)[1:3] == ["one", "red <tag>"]
    assert f'fill="{COLOURS["red"]}" font-weight="700">red &lt;tag&gt;<' in svg
    assert "count 3" in texts(svg)
    assert not any("count 1" in text for text in texts(svg))
    assert "<title>a shell</title>" in svg


def test_a_part_begins_at_a_line_below_what_was_typed(recording) -> None:
    assert texts(still(recording, title="x", start="ab", end="^C")) == ["$ cat", "…", "ab"]


def test_motion_shows_what_was_overwritten_and_honours_who_wants_none() -> None:
    counts = [(0.5 * n, b"\rcount %d" % n) for n in (1, 2, 3)]
    recording = Recording(60, [(0.0, b"a\r\nb\r\nc\r\nd\r\n"), *counts, (2.0, b"\r\n")])
    svg = moving(recording, title="x", lines=4)
    assert {"count 1", "count 2", "count 3"} <= set(texts(svg))
    assert "@media (prefers-reduced-motion:reduce){.r,.l,#s{animation:none!important}}" in svg
    for text, name in (("count 1", "r"), ("count 3", "l")):  # "r" is hidden without motion, "l" is the end
        (found,) = re.findall(rf'class="(\w)"><text[^>]*>{text}<', svg)
        assert found == name
    assert "translateY(-" in svg, "more lines than the window has"


def test_a_step_that_never_shows_its_text_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(TimeoutError, match=r"was not shown within 0\.5 s"):
        record((Type("true", until="never"),), columns=40, folder=tmp_path, timeout_s=0.5)
