"""Commanders whose names arrive after their first messages."""

from __future__ import annotations

import logging

import pytest
from commanded_arm import Arm
from joshua.node.writers import KNOWN_WITHIN_S, PublisherNames, Writer
from joshua.plan import Commander
from stepped_time import SteppedTime

PLAN = (Commander("/leader", "/command"), Commander("/gamepad", "/command", override=True))
LOG = logging.getLogger("test_late_names")


class LateGraph:
    """A graph that learns of the nodes of publishers after their first messages."""

    def __init__(self, clock: SteppedTime) -> None:
        self.known: dict[bytes, str] = {}
        self._names = PublisherNames(lambda gid: self.known.get(gid, ""), clock.monotonic)

    def writer(self, gid: bytes) -> Writer:
        return self._names.writer(gid)


@pytest.fixture
def graph(stepped_time: SteppedTime) -> LateGraph:
    return LateGraph(stepped_time)


@pytest.fixture
def free(stepped_time: SteppedTime) -> Arm:
    """An arm that accepts any node."""
    return Arm(stepped_time, LOG, (), ("/command",))


@pytest.mark.parametrize("late_s", [0.1, 3 * KNOWN_WITHIN_S])
def test_a_commander_whose_name_arrives_late_stays_the_commander(
    free: Arm, graph: LateGraph, late_s: float, caplog: pytest.LogCaptureFixture
) -> None:
    free.send(graph.writer(b"t"), 0.01)
    assert free.commanders.current == ""
    free.send(graph.writer(b"t"), 0.01)
    free.step(late_s)
    free.send(graph.writer(b"t"), 0.01)
    graph.known = {b"t": "/talker"}
    free.step(KNOWN_WITHIN_S)
    for _ in range(10):
        free.send(graph.writer(b"t"), 0.01)
        free.step()
    assert free.commanders.current == "/talker"
    assert free.commanders.refused == {}
    assert len(free.arrived) == 13
    assert caplog.messages == []


def test_a_second_publisher_of_the_commander_is_the_commander_once_both_names_are_known(
    free: Arm, graph: LateGraph
) -> None:
    free.send(graph.writer(b"joint states"), 0.01)
    graph.known = {b"joint states": "/talker", b"trajectories": "/talker"}
    free.step(0.1)
    free.play(graph.writer(b"trajectories"), 0.5, 1)
    assert free.commanders.refused == {}
    assert free.step(1.2) == pytest.approx(0.5)


def test_another_program_is_refused_by_its_name_and_not_before_it_is_known(
    free: Arm, graph: LateGraph, caplog: pytest.LogCaptureFixture
) -> None:
    graph.known = {b"m": "/moveit"}
    for _ in range(5):
        free.send(graph.writer(b"m"), 0.01)
        free.send(graph.writer(b"t"), 3.0)
        assert free.step() == pytest.approx(0.01)
    assert free.commanders.refused == {}
    graph.known[b"t"] = "/talker"
    free.step(0.04)  # the graph is asked every 20 ms, and one step may end just before that
    free.send(graph.writer(b"t"), 3.0)
    assert free.commanders.refused == {"/talker": 1}
    assert caplog.messages == ["/command: commands from /talker are refused: /moveit is the commander"]


def test_two_programs_without_a_node_command_one_at_a_time(free: Arm, graph: LateGraph) -> None:
    free.send(graph.writer(b"a"), 0.0)
    free.step(0.3)
    for _ in range(100):
        free.send(graph.writer(b"a"), 0.01)
        free.send(graph.writer(b"b"), 3.0)
        assert free.step() == pytest.approx(0.01)
    assert set(free.commanders.refused) == {""}


def test_where_the_name_decides_a_publisher_waits_for_it(stepped_time: SteppedTime, graph: LateGraph) -> None:
    """A leader's positions are mapped by its name, and an override is known by it."""
    arm = Arm(stepped_time, LOG, PLAN, ("/command",))
    arm.send(graph.writer(b"l"), 3.0)
    assert (arm.commanders.current, arm.arrived, arm.commanders.refused) == (None, [], {})
    graph.known = {b"l": "/leader"}
    arm.step(0.1)
    arm.send(graph.writer(b"l"), 0.01)
    assert arm.commanders.current == "/leader"
