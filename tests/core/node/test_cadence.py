"""Figures of endpoints."""

from __future__ import annotations

import pytest
from joshua.node.cadence import TrafficFigures
from joshua.plan import TopicSpec

TOPIC = TopicSpec(name="/x", type_name="std_msgs/msg/String", rate_hz=50.0)


def test_a_publisher_is_measured_against_its_rate():
    figures = TrafficFigures(TOPIC, is_publisher=True)
    for index in range(101):
        figures.add(index * 20_000_000 + (1_000_000 if index == 50 else 0))

    report = figures.report()
    assert (report.name, report.count, report.is_publisher, report.configured_hz) == ("/x", 101, True, 50.0)
    assert report.rate_hz == pytest.approx(50.0)
    assert report.jitter_p50_s == 0.0
    assert report.jitter_p999_s == pytest.approx(0.001, rel=0.05)


def test_without_a_rate_there_is_no_jitter():
    figures = TrafficFigures(TOPIC.model_copy(update={"rate_hz": 0.0}), is_publisher=False)
    figures.add(0)
    assert figures.report().rate_hz == 0.0
    figures.add(10**9)
    figures.add(3 * 10**9)
    report = figures.report()
    assert (report.rate_hz, report.jitter_p999_s, report.count) == (pytest.approx(2 / 3), 0.0, 3)
