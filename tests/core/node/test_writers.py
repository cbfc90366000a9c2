from __future__ import annotations

from joshua.node.writers import KNOWN_WITHIN_S, PublisherNames


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


def test_a_writer_stays_the_same_when_its_name_arrives() -> None:
    graph = Graph()
    names = graph.names()
    writer = names.writer(b"a")
    assert (writer.name, writer.awaits_name) == ("", True)
    graph.now_s += KNOWN_WITHIN_S
    assert (writer.name, writer.awaits_name) == ("", False)
    graph.known = {b"a": "/talker"}
    graph.now_s += KNOWN_WITHIN_S
    assert (writer.name, writer.awaits_name) == ("/talker", False)
    assert writer.same_node(names.writer(b"a"))


def test_publishers_of_one_node_are_the_same_node_once_both_names_are_known() -> None:
    graph = Graph()
    graph.known = {b"a": "/talker", b"c": "/moveit"}
    names = graph.names()
    first, second, other = (names.writer(gid) for gid in (b"a", b"b", b"c"))
    assert not first.same_node(second)
    graph.known[b"b"] = "/talker"
    graph.now_s += 0.1
    assert first.same_node(second)
    assert second.same_node(first)
    assert not first.same_node(other)
    assert not first.same_node(None)


def test_publishers_without_a_node_are_told_apart() -> None:
    graph = Graph()
    names = graph.names()
    first, second = names.writer(b"a"), names.writer(b"b")
    assert [writer.name for writer in (first, second)] == ["", ""]
    assert not first.same_node(second)
    assert names.writer(b"").same_node(names.writer(b"")), "messages without an id cannot be told apart"
