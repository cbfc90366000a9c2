"""Sockets whose path is longer than an address may be."""

from __future__ import annotations

import json
import socket
import threading
from pathlib import Path

import pytest
from joshua.ipc.client import ask
from joshua.ipc.run_bases import MAX_PATH_BYTES, socket_address


@pytest.mark.parametrize("length", [20, MAX_PATH_BYTES + 60])
def test_a_guardian_reaches_its_run_whatever_the_length_of_the_path(tmp_path: Path, length: int):
    folder = tmp_path / ("x" * max(1, length - len(str(tmp_path)) - len("/control")))
    folder.mkdir()
    heard: list[bytes] = []
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as server:
        with socket_address(folder / "control") as address:
            server.bind(address)
        server.listen()

        def serve() -> None:
            connection, _ = server.accept()
            with connection:
                heard.append(connection.recv(4096))
                connection.sendall(json.dumps({"written": True}).encode() + b"\n")

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        assert ask(folder / "control", {"request": "guardian", "text": "1 held"}) == {"written": True}
        thread.join(30)
    assert json.loads(heard[0])["text"] == "1 held"
