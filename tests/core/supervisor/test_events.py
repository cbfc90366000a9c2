"""What those hear who watch a run: in its process, and over the control socket."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from joshua.ipc.client import CallError, RunInfo, RunningSystem, ask, running_systems
from joshua.ipc.run_bases import socket_address
from joshua.plan import RunReport
from joshua.plan.events import (
    EVENT_NAMES,
    Event,
    Gap,
    LogEntry,
    NodeStatus,
    RunEvent,
    RunStatus,
    StartTable,
    event_name,
    event_of,
    event_record,
)
from joshua.plan.progress import Progress
from joshua.supervisor.control_server import STREAM_BACKLOG_BYTES, ControlServer
from joshua.supervisor.logbook import MAX_STREAMS, Logbook
from joshua.supervisor.reactor import Reactor
from joshua.supervisor.run_requests import RunRequests
from joshua.supervisor.tables import progress_text, status_lines

STATUS = RunStatus("r.pbtxt", "MODE_TEST", "running", 1.0, 7, (NodeStatus("/a", "ready", 1, 0),))
READY = RunEvent("ready", "/a", "", 5)
EPISODES = Progress("/a", "episodes", 3, 10, "episodes", 0.5, 14.0)

EVENTS: list[Event] = [
    StartTable("r.pbtxt", "MODE_TEST", "", "zenoh", 0.5, ()),
    STATUS,
    LogEntry(5, "/a", 20, "hello"),
    READY,
    EPISODES,
    RunReport(exit_code=0, reason="done"),
    Gap(3),
]


@pytest.mark.parametrize("event", EVENTS)
def test_an_event_survives_its_way_as_json(event: Event) -> None:
    record = json.loads(json.dumps(event_record(event)))
    assert record["event"] == event_name(event)
    assert record["event"] in EVENT_NAMES
    assert event_of(record) == event


def test_progress_is_said_in_the_status() -> None:
    assert progress_text(EPISODES) == "episodes 3/10, 0.5/s, 14 s left"
    assert progress_text(Progress("/a", "copy", 2.5, None, "GB")) == "copy 2.5 GB"
    nodes = (NodeStatus("/a", "ready", 1, 0, progress=(EPISODES,)),)
    (line,) = status_lines(RunStatus("r", "m", "running", 1.0, 1, nodes))
    assert line == "running 1 s | /a [episodes 3/10, 0.5/s, 14 s left]"


def test_a_display_that_fails_is_cut_off_and_the_others_go_on(tmp_path: Path) -> None:
    heard: list[dict[str, Any]] = []

    def broken(event: Event) -> None:
        raise ValueError("no paint")

    reactor = Reactor()
    logbook = Logbook(reactor, tmp_path / "log.jsonl", broken)
    client: Any = SimpleNamespace(closed=False, offer=lambda line: heard.append(json.loads(line)))
    assert logbook.subscribe(client, ["ready", "status", "log"])
    logbook.publish(READY)
    logbook.publish(STATUS)
    logbook.close()
    reactor.close()
    traceback, said, *events = heard
    assert "no paint" in traceback["text"]
    assert said["text"] == "the user interface broken failed and is disconnected: ValueError: no paint"
    assert [event_of(record) for record in events] == [READY, STATUS]


class Served:
    """A control socket with a stream of events, in a thread of its own."""

    def __init__(self, folder: Path) -> None:
        self.reactor = Reactor()
        self.bus = Logbook(self.reactor, folder / "log.jsonl")
        handlers = RunRequests(self.bus, self.reactor, (), lambda: STATUS, lambda _: None).handlers()
        self.path = folder / "control.sock"
        self.server = ControlServer(self.reactor, self.path, handlers)
        self.system = RunningSystem(folder, RunInfo("x", 7, "r.pbtxt", "", 0, ("/a",)))
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while not self._over.is_set():
            self.reactor.turn()

    def publish(self, *events: Event) -> None:
        """On the loop's thread, as the supervisor does; returns when that is done."""
        done = threading.Event()
        for event in events:
            self.reactor.post(partial(self.bus.publish, event))
        self.reactor.post(done.set)
        assert done.wait(30)

    def connect(self) -> socket.socket:
        connection = socket.socket(socket.AF_UNIX)
        connection.settimeout(60.0)
        with socket_address(self.path) as address:
            connection.connect(address)
        connection.sendall(b'{"request": "subscribe"}\n')
        return connection

    def close(self) -> None:
        self.reactor.post(self._over.set)
        self._thread.join()
        self.server.close()
        self.bus.close()
        self.reactor.close()


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    made = Served(tmp_path)
    yield made
    made.close()


def test_a_program_hears_what_it_asked_for(served: Served) -> None:
    everything = served.system.events()
    some = served.system.events(["progress", "ready"])
    assert next(everything) == STATUS  # at once
    first = threading.Thread(target=lambda: heard.append(next(some)))
    heard: list[Event] = []
    first.start()
    while len(served.bus._streams) < 2:
        time.sleep(0.01)
    served.publish(LogEntry(1, "/a", 20, "not in the stream unless it is asked for"), STATUS, READY, EPISODES)
    first.join(30)
    assert heard == [READY]
    assert next(some) == EPISODES
    assert [next(everything) for _ in range(3)] == [STATUS, READY, EPISODES]


def test_who_does_not_read_misses_events_and_is_told_how_many(served: Served) -> None:
    with served.connect() as slow, slow.makefile("rb") as lines:
        assert json.loads(lines.readline())["event"] == "status"
        long = RunEvent("failed", "/a", "x" * 10_000)
        began_s = time.monotonic()
        for _ in range(3 * STREAM_BACKLOG_BYTES // 10_000 + 100):
            served.publish(long)
        assert time.monotonic() - began_s < 30
        client = next(iter(served.server.clients))
        assert client.dropped > 0
        assert len(client._outgoing) < STREAM_BACKLOG_BYTES + 20_000
        assert ask(served.path, {"request": "status"}, 60.0)["status"]["phase"] == "running"
        seen = 0
        # publishing nothing waits until the loop is not between sending the last line and forgetting it
        while served.publish() or client._outgoing:
            seen += json.loads(lines.readline())["event"] == "failed"
        dropped = client.dropped
        served.publish(READY)
        while (record := json.loads(lines.readline()))["event"] == "failed":
            seen += 1
        assert record == {"event": "gap", "dropped": dropped}
        assert seen + dropped == 3 * STREAM_BACKLOG_BYTES // 10_000 + 100
        assert json.loads(lines.readline())["event"] == "ready"


def test_requests_keep_their_connections(served: Served) -> None:
    watching = [served.connect() for _ in range(MAX_STREAMS)]
    for connection in watching:
        assert connection.recv(10)
    with pytest.raises(CallError, match="8 programs watch this run already: end one of them"):
        next(served.system.events())
    assert ask(served.path, {"request": "status"}, 60.0)
    watching.pop().close()
    while True:  # once the loop has seen that
        try:
            assert next(served.system.events()) == STATUS
            break
        except CallError:
            time.sleep(0.01)
    for connection in watching:
        connection.close()


def test_what_is_no_event_is_said(served: Served) -> None:
    for names in (["ready", "raedy"], "ready", [1]):
        answer = ask(served.path, {"request": "subscribe", "events": names}, 60.0)
        assert answer["error"] == f"events is {names!r}; allowed is a list of names"
        assert "ready" in answer["allowed"]


def test_a_stream_that_nobody_reads_any_more_is_forgotten(tmp_path: Path) -> None:
    bus = Logbook(Reactor(), tmp_path / "log.jsonl")
    client: Any = SimpleNamespace(closed=True)
    assert bus.subscribe(client)
    bus.publish(READY)
    assert bus._streams == []


def test_a_whole_run_is_heard_to_its_end(robot: Any) -> None:
    heard: list[Event] = []

    def watch() -> None:
        base = robot.options().run_base
        end_s = time.monotonic() + 60
        while not (systems := running_systems(base)) or not (systems[0][0] / "control.sock").exists():
            assert time.monotonic() < end_s
            time.sleep(0.005)
        system = RunningSystem(*systems[0])
        for event in system.events():
            heard.append(event)
            if isinstance(event, Progress) and event.current == event.total:
                system.stop(0.001)

    watcher = threading.Thread(target=watch)
    watcher.start()
    node = robot.node("Works", module="verb_behaviours")
    report = robot.run(node, duration_s=60.0, status_period_s=0.2)
    watcher.join(60)
    assert report.exit_code == 0, robot.ui.text()
    assert {"ready", "table", "status"} <= {event_name(event) for event in heard}
    assert isinstance(heard[-1], RunReport)
    assert heard[-2] == RunEvent("stopped", "", report.reason, heard[-2].time_ns)
    assert {"stopping", "stopped"} <= {event_name(event) for event in heard}
    assert robot.ui.kinds("/works") == ["started", "ready", "stopped"]
    last = robot.ui.progress[-1]
    assert (last.node, last.name, last.current, last.total, last.unit) == ("/works", "parts", 40, 40, "parts")
    assert last.remaining_s == 0
    assert last.rate is not None
    assert 0 < len(robot.ui.progress) < 40  # a few times a second is enough
