"""The control socket."""

from __future__ import annotations

import json
import socket
import threading

import pytest
from joshua.ipc.client import ask
from joshua.supervisor.control_server import MAX_CLIENTS, MAX_REQUEST_BYTES, ControlServer
from joshua.supervisor.reactor import Reactor


@pytest.fixture
def served(tmp_path):
    folder = tmp_path / ("deep" * 30)
    folder.mkdir()
    reactor = Reactor()
    handlers = {
        "echo": lambda request, _: {"got": request.get("text")},
        "big": lambda *_: {"x": "y" * 2_000_000},
    }
    server = ControlServer(reactor, folder / "control.sock", handlers)
    ended = threading.Event()

    def loop():
        while not ended.is_set():
            reactor.turn()

    thread = threading.Thread(target=loop)
    thread.start()
    yield folder / "control.sock"
    reactor.post(ended.set)
    thread.join()
    server.close()
    server.close()
    reactor.close()
    assert not (folder / "control.sock").exists()


def connect(path):
    import os

    connection = socket.socket(socket.AF_UNIX)
    connection.settimeout(60.0)
    folder = os.open(path.parent, os.O_RDONLY)
    connection.connect(f"/proc/self/fd/{folder}/{path.name}")
    os.close(folder)
    return connection


def test_a_request_is_answered_on_a_path_of_any_length(served):
    assert served.stat().st_mode & 0o777 == 0o600
    assert ask(served, {"request": "echo", "text": "ä"}, timeout_s=60.0) == {"got": "ä"}
    assert len(ask(served, {"request": "big"}, timeout_s=60.0)["x"]) == 2_000_000


@pytest.mark.parametrize(
    "line", [b"nonsense", b"[]", b"{}", b'{"request": 1}', b"\xff", b"[" * 60000, b'{"request": "no"}']
)
def test_anything_else_gets_an_error_and_the_connection_goes_on(served, line):
    with connect(served) as connection, connection.makefile("rb") as answers:
        connection.sendall(line + b"\n")
        assert "error" in json.loads(answers.readline())
        connection.sendall(b'{"request": "echo"}\n')
        assert json.loads(answers.readline()) == {"got": None}


def was_cut_off(connection):
    try:
        return connection.recv(1000) == b""
    except ConnectionResetError:
        return True


def test_a_socket_that_is_found_listens(tmp_path, monkeypatch):
    seen = []
    listen = socket.socket.listen

    def look(self, backlog):
        seen.append(sorted(path.name for path in tmp_path.iterdir()))
        listen(self, backlog)

    monkeypatch.setattr(socket.socket, "listen", look)
    reactor = Reactor()
    server = ControlServer(reactor, tmp_path / "control.sock", {})
    assert seen == [[".control.sock"]]
    assert [path.name for path in tmp_path.iterdir()] == ["control.sock"]
    server.close()
    reactor.close()


def test_a_request_without_end_is_cut_off(served):
    with connect(served) as connection:
        connection.sendall(b"x" * (MAX_REQUEST_BYTES + 10))
        assert was_cut_off(connection)
    assert ask(served, {"request": "echo"}, timeout_s=60.0) == {"got": None}


def test_too_many_clients_are_turned_away_and_the_others_served(served):
    clients = [connect(served) for _ in range(MAX_CLIENTS)]
    for client in clients:
        client.sendall(b'{"request": "echo"}\n')
        assert client.recv(1000)
    extra = connect(served)
    assert extra.recv(10) == b""
    extra.close()
    for client in clients:
        client.close()


def test_an_answer_is_abandoned_when_who_asked_has_gone(tmp_path):
    reactor, clients = Reactor(), []
    later = {"later": lambda _, client: clients.append(client)}
    server = ControlServer(reactor, tmp_path / "control.sock", later)
    with connect(tmp_path / "control.sock") as connection:
        connection.sendall(b'{"request": "later"}\n')
        while not clients:
            reactor.turn()
        assert not clients[0].closed
    while not clients[0].closed:
        reactor.turn()
    clients[0].send({"too": "late"})
    server.close()
    reactor.close()


def test_nobody_there_is_an_error(tmp_path):
    with pytest.raises(OSError, match="No such file"):
        ask(tmp_path / "none.sock", {"request": "status"})
