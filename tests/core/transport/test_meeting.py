"""Where the sessions of one user meet, and who may command over a router."""

from __future__ import annotations

import os
import socket
import tempfile
from collections.abc import Iterator

import pytest
from joshua.plan import TransportSettings
from joshua.testing.port import free_port
from joshua.transport import TransportError
from joshua.transport.zenoh.meeting import Hosted, MeetingPlace, live_socket, reach_of
from joshua.transport.zenoh.owners import is_trusted, listener_owner, peer_owner


@pytest.fixture
def settings(monkeypatch: pytest.MonkeyPatch) -> Iterator[TransportSettings]:
    # short, because a long path selects the folder that all runs of this user share
    with tempfile.TemporaryDirectory(dir="/tmp") as runtime:
        monkeypatch.setenv("XDG_RUNTIME_DIR", runtime)
        yield TransportSettings(listen_endpoints=(f"tcp/localhost:{free_port()}",))


@pytest.mark.parametrize(
    ("values", "reach"),
    [
        ({}, "this user"),
        ({"listen_endpoints": ("tcp/[::1]:7447", "udp/127.0.0.1:7447")}, "this user"),
        ({"open_to_local_users": True}, "everyone"),
        ({"listen_endpoints": ("tcp/localhost:7447", "tcp/0.0.0.0:7448")}, "everyone"),
        ({"connect_endpoints": ("tcp/robot.local:7447",)}, "everyone"),
        ({"listen_endpoints": ("tls/0.0.0.0:7447",)}, "certificates"),
        ({"connect_endpoints": ("tls/robot.local:7447",)}, "certificates"),
    ],
)
def test_who_may_command(values: dict[str, object], reach: str) -> None:
    assert reach_of(TransportSettings.model_validate(values)) == reach


def test_one_process_hosts_and_the_next_one_follows(settings: TransportSettings) -> None:
    hosted = Hosted(1, ("tcp/localhost:1",), "this user")
    first, second = MeetingPlace(settings), MeetingPlace(settings)
    assert first.take(hosted)
    assert not second.take(hosted)
    assert second.hosted() is None, "its router does not listen yet"
    with socket.socket(socket.AF_UNIX) as router:
        router.bind(str(first.socket))
        router.listen()
        assert second.hosted() == hosted
        assert live_socket(settings) == first.socket
    first.leave()
    assert second.take(hosted)
    second.leave()


def test_a_folder_that_others_can_enter_is_refused(settings: TransportSettings) -> None:
    place = MeetingPlace(settings)
    place.socket.parent.chmod(0o755)
    assert live_socket(settings) is None
    with pytest.raises(TransportError, match="chmod 700"):
        place.take(Hosted(1, (), "this user"))


def test_the_system_tells_whose_a_connection_is() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with socket.create_connection(("127.0.0.1", port)) as client:
            link, _ = server.accept()
            with link:
                assert peer_owner(link) == os.geteuid()
                client.close()
                assert peer_owner(link) is None, "of a closed connection nothing is known"
        assert listener_owner(port) == os.geteuid()
    assert is_trusted(os.geteuid())
    assert is_trusted(0)
    assert not is_trusted(61234)
    assert not is_trusted(None)
