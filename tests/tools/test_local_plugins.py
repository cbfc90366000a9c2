"""Plugins of a clone are installed from the clone, whatever an index offers under their names."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import zipfile
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from pathlib import Path

import local_plugins
import pytest

ROOT = Path(__file__).resolve().parents[2]
STRANGER = "99.0"


def test_everything_that_a_plugin_needs_of_this_repository_comes_with_it() -> None:
    assert set(local_plugins.closure(["sts3215"])) >= {
        "joshua-core",
        "joshua-servo",
        "joshua-serial",
        "joshua-sts3215",
    }
    lidar = set(local_plugins.closure(["lidar"]))
    assert lidar >= {"joshua-core", "joshua-serial", "joshua-lidar"}
    assert lidar & {"joshua-servo", "joshua-sts3215"} == set()
    assert local_plugins.closure(["joshua-emulator[spike]"])["joshua-emulator"] == {"spike"}
    assert set(local_plugins.closure(["all"])) == set(local_plugins.distributions())


def test_what_is_not_of_this_repository_is_listed_with_extras() -> None:
    needed = local_plugins.requirements(local_plugins.closure(["joshua-core[dds]", "sts3215"]))
    names = {local_plugins._parts(requirement)[0] for requirement in needed}
    assert names >= {"numpy", "cyclonedds", "feetech-servo-sdk"}
    assert not any(name.startswith("joshua") for name in names)


def test_a_plugin_that_is_not_here_is_named_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert local_plugins.main(["sts3215,encodr"]) == 2
    assert "joshua-plugins has no 'encodr'; allowed: encoder, core, " in capsys.readouterr().err


class Index(ThreadingHTTPServer):
    """A package index at which a stranger has taken the names of this project; it notes what it is asked."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Answer)
        self.asked: list[str] = []


class Answer(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        assert isinstance(self.server, Index)
        self.server.asked.append(self.path)
        name = self.path.strip("/").split("/")[1]
        wheel = f"{name.replace('-', '_')}-{STRANGER}-py3-none-any.whl"
        if not name.startswith("joshua"):
            self.send_error(404)
        elif self.path.endswith(".whl"):
            self._send(strange_wheel(name, wheel))
        else:
            self._send(f'<a href="/simple/{name}/{wheel}">{wheel}</a>'.encode(), "text/html")

    def _send(self, data: bytes, kind: str = "application/octet-stream") -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: object) -> None:
        pass


def strange_wheel(name: str, file_name: str) -> bytes:
    folder = "-".join(file_name.split("-")[:2]) + ".dist-info"
    data = BytesIO()
    with zipfile.ZipFile(data, "w") as wheel:
        wheel.writestr(f"{folder}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: {STRANGER}\n")
        wheel.writestr(f"{folder}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        wheel.writestr(f"{folder}/RECORD", "")
    return data.getvalue()


@pytest.fixture
def index() -> Iterator[Index]:
    with Index() as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


def would_install(index: Index, *arguments: str) -> dict[str, str]:
    """What pip would install, by name, with the address that it comes from."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PIP_")}
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--dry-run"]
    command += ["--no-build-isolation", "--report", "-", "--index-url"]
    command += [f"http://127.0.0.1:{index.server_port}/simple", *arguments]
    environment |= {"PIP_CONFIG_FILE": os.devnull, "PIP_NO_CACHE_DIR": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    return {item["metadata"]["name"]: item["download_info"]["url"] for item in report["install"]}


def test_a_stranger_s_package_of_our_name_does_not_get_in(
    index: Index, capsys: pytest.CaptureFixture[str]
) -> None:
    strange = would_install(index, "--upgrade", "--no-deps", "joshua-servo")
    assert strange["joshua-servo"].startswith("http://127.0.0.1")  # the index would win by its version
    index.asked.clear()
    assert local_plugins.main(["sts3215,lidar,emulator"]) == 0
    folders = capsys.readouterr().out.split()
    # Without -e, which needs more of this environment: pip resolves a folder alike with it and without.
    found = would_install(index, "--upgrade", *folders)
    ours = {name: url for name, url in found.items() if name.startswith("joshua-")}
    assert set(ours) == set(local_plugins.closure(["sts3215", "lidar", "emulator"]))
    assert {url for url in ours.values() if not url.startswith("file://")} == set()
    assert [path for path in index.asked if "joshua" in path] == []


def test_what_a_plugin_leaves_out_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert local_plugins.main(["smolvla"]) == 0
    said = capsys.readouterr().err
    assert said.startswith("run: policies are checked, not run: LeRobot and PyTorch")
    assert "tools/policies.sh makes it (1 to 9 GB)" in said
    assert local_plugins.main(["sts3215"]) == 0
    assert capsys.readouterr().err == ""
