"""Addresses that are no camera: each says what was found and what to do."""

from __future__ import annotations

import http.server
import socket
import threading
from collections.abc import Callable, Iterator

import pytest
from joshua.devices.errors import DeviceError
from joshua_camera.camera import OpenCvCamera
from joshua_camera.settings import CameraSettings
from joshua_camera.source import CameraSource

Maker = Callable[..., OpenCvCamera]


class Page(http.server.BaseHTTPRequestHandler):
    """A web server that is no camera."""

    def do_GET(self) -> None:
        answers = {
            "/page": (200, "text/html", b"<html>Camera</html>"),
            "/private": (401, "text/plain", b"no"),
            "/bad.mp4": (200, "video/mp4", b"\0" * 5000),
        }
        status, kind, body = answers.get(self.path, (404, "text/plain", b"none"))
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def web() -> Iterator[str]:
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Page) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


def refusal(camera_at: Maker, source: str) -> str:
    with pytest.raises(DeviceError) as caught:
        camera_at(source).connect()
    return str(caught.value)


def test_a_web_page(web: str, camera_at: Maker) -> None:
    assert refusal(camera_at, f"{web}/page") == (
        f"{web}/page is not a video stream but text/html: copy the address of the stream itself, not of "
        "the page that shows it"
    )


def test_a_wrong_path(web: str, camera_at: Maker) -> None:
    assert refusal(camera_at, f"{web}/none") == (
        f"{web}/none has no stream (HTTP 404 Not Found): copy the path of the stream from the camera's or "
        "the phone's page"
    )


def test_a_password_is_missing(web: str, camera_at: Maker) -> None:
    assert refusal(camera_at, f"{web}/private") == (
        f"{web}/private denies access (HTTP 401 Unauthorized): add user name and password to the address, "
        "as in http://USER:PASSWORD@HOST/PATH"
    )


def test_a_video_that_cannot_be_read(web: str, camera_at: Maker) -> None:
    assert refusal(camera_at, f"{web}/bad.mp4") == (
        f"{web}/bad.mp4 cannot be read as video/mp4: choose Motion JPEG or H.264 on the camera's page"
    )


def test_a_password_is_not_shown(web: str, camera_at: Maker) -> None:
    address = web.replace("http://", "http://me:secret@") + "/private"
    text = refusal(camera_at, address)
    assert "secret" not in text
    assert "***@127.0.0.1" in text


def test_nobody_listens(camera_at: Maker) -> None:
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        port = reserved.getsockname()[1]
        text = refusal(camera_at, f"http://127.0.0.1:{port}/video")
    assert f"cannot be reached: connection refused at 127.0.0.1 port {port}" in text


@pytest.mark.parametrize("host", ["camera.invalid", "192.168..20"])
def test_an_unknown_host(camera_at: Maker, host: str) -> None:
    text = refusal(camera_at, f"http://{host}/video")
    assert text.startswith(f"http://{host}/video cannot be reached: the host {host} is unknown")
    assert text.endswith("check its name, or write its IP address")


@pytest.mark.parametrize("scheme", ["http", "rtsp"])
def test_somebody_who_never_answers(camera_at: Maker, monkeypatch: pytest.MonkeyPatch, scheme: str) -> None:
    monkeypatch.setattr("joshua_camera.stream_capture.OPEN_TIMEOUT_S", 0.3)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        address = f"{scheme}://127.0.0.1:{silent.getsockname()[1]}/video"
        text = refusal(camera_at, address)
    assert address in text
    assert ("does not answer like a camera: no answer" in text) or ("it sent nothing within 0.3 s" in text)


def test_labels() -> None:
    def label(source: str) -> str:
        settings = CameraSettings.model_construct(source=source, device_id=4)  # type: ignore[call-arg]
        return CameraSource.of(settings).label

    assert label("") == "/dev/video4"
    assert label("usb-Cam-video-index0") == "/dev/v4l/by-id/usb-Cam-video-index0"
    assert label("rtsp://me:pw@cam:554/live?x=1") == "rtsp://***@cam:554/live?x=1"
    assert label("http://[::1]:8080/") == "http://[::1]:8080/"
