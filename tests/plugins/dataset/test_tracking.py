"""The table and the picture of a replay."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
from joshua_dataset.tracking import MOST_POINTS, Tracking

SVG = "{http://www.w3.org/2000/svg}"


def tracking(count: int) -> Tracking:
    found = Tracking(("pan", "<lift>"))
    for number in range(count):
        found.add(number / 50, np.array([0.1 * number, 1.0]), np.array([0.1 * number - 0.2, 1.0]))
    return found


def test_the_table_has_the_error_of_each_joint() -> None:
    assert list(tracking(10).table()) == [
        "pan                  0.200  0.200  0.200",
        "<lift>               0.000  0.000  0.000",
    ]


def test_the_picture_is_valid_and_bounded() -> None:
    root = ElementTree.fromstring(tracking(5000).svg("waves, episode 0 & more"))
    texts = [item.text for item in root.iter(f"{SVG}text")]
    assert "waves, episode 0 & more" in texts
    assert "<lift>" in texts
    lines = [item.get("points").split() for item in root.iter(f"{SVG}polyline")]
    assert len(lines) == 4
    assert all(MOST_POINTS <= len(points) < 2 * MOST_POINTS for points in lines)
    heights = [float(point.split(",")[1]) for points in lines for point in points]
    assert min(heights) > 0
    assert max(heights) < float(root.get("height", ""))


def test_goal_and_position_are_two_lines() -> None:
    goal, position, *_ = ElementTree.fromstring(tracking(10).svg("waves")).iter(f"{SVG}polyline")
    ends = [float(line.get("points", "").rpartition(",")[2]) for line in (goal, position)]
    assert ends[0] < ends[1]  # the position is below its goal


def test_one_sample_makes_a_picture() -> None:
    assert "<polyline" in tracking(1).svg("waves")
