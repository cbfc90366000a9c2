from __future__ import annotations

from joshua.node.endpoints import KNOWN_WITHIN_S, PublisherNames


class Graph:
    """Counts what it is asked."""

    def __init__(self) -> None:
        self.known: dict[bytes, str] = {}
        self.asked = 0
        self.now_s = 100.0

    def look_up(self, gid: bytes) -> str:
        self.asked += 1
        return self.known.get(gid, "")

    def names(self) -> PublisherNames:
        return PublisherNames(self.look_up, lambda: self.now_s)


def test_a_publisher_is_looked_up_once() -> None:
    graph = Graph()
    graph.known = {b"a": "/leader", b"b": "/gamepad"}
    names = graph.names()
    assert [names.name(gid) for gid in (b"a", b"b", b"a", b"b")] == ["/leader", "/gamepad"] * 2
    assert graph.asked == 2


def test_a_publisher_that_the_graph_learns_of_late_is_waited_for() -> None:
    graph = Graph()
    names = graph.names()
    assert [names.name(b"a") for _ in range(1000)] == [None] * 1000
    assert graph.asked == 1, "the graph is not searched for each message"
    graph.known = {b"a": "/leader"}
    graph.now_s += 0.1
    assert names.name(b"a") == "/leader"


def test_one_that_no_node_owns_counts_as_unknown_after_a_while() -> None:
    graph = Graph()
    names = graph.names()
    assert names.name(b"") == ""
    assert names.name(b"x") is None
    graph.now_s += KNOWN_WITHIN_S
    assert names.name(b"x") == ""
    asked = graph.asked
    assert names.name(b"x") == ""
    assert graph.asked == asked


def test_one_that_the_graph_learns_of_very_late_gets_its_name() -> None:
    graph = Graph()
    names = graph.names()
    assert names.name(b"x") is None
    graph.now_s += 2 * KNOWN_WITHIN_S
    assert names.name(b"x") == ""
    graph.known = {b"x": "/leader"}
    assert names.name(b"x") == ""
    graph.now_s += KNOWN_WITHIN_S
    assert names.name(b"x") == "/leader"


def test_what_is_remembered_is_bounded() -> None:
    graph = Graph()
    names = graph.names()
    for number in range(5000):
        names.name(number.to_bytes(16, "little"))
    assert len(names._waiting) <= 1000
