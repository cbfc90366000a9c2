"""The page's server: what it shows, to whom, and what it takes from whom."""

from __future__ import annotations

import http.client
import json
import re
import socket
from collections.abc import Iterator
from importlib.resources import files
from typing import Any

import pytest
from calibration_run import Page
from joshua_calibration.front_end import ArmState, Ask, Board, Request
from joshua_calibration.page import server
from joshua_calibration.page.front_end import PageFrontEnd
from joshua_calibration.page.server import FILES
from joshua_calibration.procedure import Procedure
from joshua_calibration.target import arm_motors

VIEW = Procedure(arm_motors(range(1, 7))).view()
BOARD = Board("rig", (("leader_arm", ArmState.ACTIVE), ("follower_arm", ArmState.WAITING)), 0, VIEW)


@pytest.fixture
def front_end() -> Iterator[PageFrontEnd]:
    front_end = PageFrontEnd()
    yield front_end
    front_end.close()
    front_end.close()


@pytest.fixture
def page(front_end: PageFrontEnd) -> Page:
    return Page(front_end.address)


def asked(front_end: PageFrontEnd) -> list[Request]:
    """What was asked for before the last answer came."""
    return list(front_end.requests())


def raw(page: Page, method: str, path: str, headers: dict[str, str], body: bytes = b"") -> int:
    """A request whose Host is what the test says."""
    connection = http.client.HTTPConnection(page.origin.removeprefix("http://"), timeout=60)
    try:
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for name, value in headers.items():
            connection.putheader(name, value)
        if body:
            connection.putheader("Content-Length", str(len(body)))
        connection.endheaders(body)
        return connection.getresponse().status
    finally:
        connection.close()


def path_of(page: Page, name: str = "") -> str:
    return page.address.removeprefix(page.origin) + name


def test_the_page_comes_whole_and_needs_nothing_from_elsewhere(page: Page):
    for name, (_, kind) in FILES.items():
        status, headers, body = page.get(name)
        assert (status, headers["Content-Type"]) == (200, kind)
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert headers["Cache-Control"] == "no-store"
        outside = body.replace(b"http://www.w3.org/2000/svg", b"")  # a name, not an address
        assert not re.search(rb"https?://|//[a-z]+\.", outside), name
        assert b"innerHTML" not in body
        assert b" style=" not in body
    html = files("joshua_calibration.page").joinpath("page.html").read_text(encoding="utf-8")
    assert re.findall(r'(?:src|href)="([^"]+)"', html) == ["data:,", "page.css", "page.js", "middle-pose.svg"]


def test_the_address_for_a_browser_leads_to_the_page_once(front_end: PageFrontEnd, page: Page):
    path = front_end.opening_address().removeprefix(page.origin)
    assert page.address not in front_end.opening_address()
    connection = http.client.HTTPConnection(page.origin.removeprefix("http://"), timeout=60)
    connection.request("GET", path)
    first = connection.getresponse()
    first.read()
    assert (first.status, first.headers["Location"]) == (303, path_of(page))
    connection.request("GET", path)
    assert connection.getresponse().status == 404
    connection.close()


def test_it_listens_on_loopback_only(front_end: PageFrontEnd):
    port = int(front_end.address.split(":")[2].partition("/")[0])
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for host in others - {"127.0.0.1"}:
        with socket.socket() as client:
            client.settimeout(1)
            assert client.connect_ex((host, port)) != 0 or host.startswith("127.")


def test_each_address_has_a_port_and_a_token_of_its_own(front_end: PageFrontEnd):
    other = PageFrontEnd()
    token, second = (f.address.split("/")[3] for f in (front_end, other))
    assert token != second
    assert len(token) >= 32
    assert other.address.split("/")[2] != front_end.address.split("/")[2]
    other.close()


@pytest.mark.parametrize("name", ["", "page.js", "events", "ask"])
def test_without_the_token_nothing_is_there(page: Page, name: str):
    host = {"Host": page.origin.removeprefix("http://")}
    for path in (f"/{name}", f"/wrong/{name}", f"//{name}", "/", path_of(page)[:-2] + f"/{name}"):
        assert raw(page, "GET", path, host) == 404, path


@pytest.mark.parametrize("name", ["..", "../page.html", "server.py", "page.html", "%2e%2e/server.py", "x"])
def test_only_the_files_of_the_page_are_served(page: Page, name: str):
    assert raw(page, "GET", path_of(page, name), {"Host": page.origin.removeprefix("http://")}) == 404


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1", "0.0.0.0:1", ""])
def test_a_name_that_leads_here_is_refused(page: Page, host: str):
    """DNS rebinding: the browser believes that the page of evil.example stands on this server."""
    assert raw(page, "GET", path_of(page), {"Host": host}) == 403
    assert raw(page, "GET", path_of(page, "events"), {"Host": host}) == 403
    assert raw(page, "GET", path_of(page), {}) == 403


def test_localhost_is_this_machine_too(page: Page):
    port = page.origin.rpartition(":")[2]
    assert raw(page, "GET", path_of(page), {"Host": f"localhost:{port}"}) == 200


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_other_sites_embed_nothing(page: Page, site: str):
    assert page.get("page.js", Sec_Fetch_Site=site)[0] == 200, "urllib sends underscores as they are"
    host = page.origin.removeprefix("http://")
    assert raw(page, "GET", path_of(page, "page.js"), {"Host": host, "Sec-Fetch-Site": site}) == 403


@pytest.mark.parametrize(
    ("body", "request_"),
    [
        ({"ask": "confirm"}, Request(Ask.CONFIRM)),
        ({"ask": "back", "joint": -1}, Request(Ask.BACK)),
        ({"ask": "repeat", "joint": 3}, Request(Ask.REPEAT, 3)),
        ({"ask": "quit"}, Request(Ask.QUIT)),
    ],
)
def test_buttons_ask(front_end: PageFrontEnd, page: Page, body: Any, request_: Request):
    assert page.ask(body) == 204
    assert asked(front_end) == [request_]


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "", "https://127.0.0.1"])
def test_another_pages_requests_are_refused(front_end: PageFrontEnd, page: Page, origin: str):
    assert page.ask({"ask": "confirm"}, Origin=origin) == 403
    assert asked(front_end) == []


def test_a_form_cannot_ask(front_end: PageFrontEnd, page: Page):
    assert page.ask({"ask": "confirm"}, Content_Type="text/plain") == 415
    assert asked(front_end) == []


@pytest.mark.parametrize(
    "body",
    [b"", b"[]", b"{", b'{"ask": "write"}', b'{"ask": "repeat", "joint": "1"}', b'{"ask": ["confirm"]}',
     b'{"ask": "repeat", "joint": true}', b"\xff", b"null"],
)  # fmt: skip
def test_nonsense_is_refused(front_end: PageFrontEnd, page: Page, body: bytes):
    assert page.ask(body) == 400
    assert asked(front_end) == []


def test_a_long_body_is_not_read(front_end: PageFrontEnd, page: Page):
    assert page.ask(b" " * 2000 + b'{"ask": "confirm"}') == 413
    assert asked(front_end) == []


def test_the_stream_sends_each_change_once(
    front_end: PageFrontEnd, page: Page, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(server, "KEEP_ALIVE_S", 3600.0)  # only changes come
    front_end.show(BOARD)
    front_end.show(BOARD)
    connection = http.client.HTTPConnection(page.origin.removeprefix("http://"), timeout=60)
    connection.request("GET", path_of(page, "events"))
    answer = connection.getresponse()
    assert answer.getheader("Content-Type") == "text/event-stream; charset=utf-8"
    first = json.loads(answer.readline().removeprefix(b"data: "))
    assert first["arms"] == [["leader_arm", "active"], ["follower_arm", "waiting"]]
    assert first["view"]["joints"][5]["name"] == "gripper"
    assert answer.readline() == b"\n"
    front_end.show(Board("rig", BOARD.arms, 0, VIEW, "over"))
    assert json.loads(answer.readline().removeprefix(b"data: "))["ended"] == "over"
    front_end.close()
    assert answer.read() == b"\n"
    connection.close()


def test_it_is_gone_after_the_end(front_end: PageFrontEnd, page: Page):
    assert front_end.can_ask
    front_end.close()
    assert not front_end.can_ask
    with pytest.raises(OSError, match="refused"):
        page.get()
