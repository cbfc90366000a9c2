"""``joshua status`` and ``joshua stop`` against a run in another process."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from argparse import Namespace
from pathlib import Path
from types import SimpleNamespace

import pytest
from joshua.cli.commands import stop
from joshua.ipc.client import RunningSystem
from joshua.testing.port import free_port

CONFIGURATION = """
general { mode: MODE_TEST id: "status-test" name: "status test" }
test { duration_s: 300 }
robot {
  perceptions {
    node {
      node_name: "watched_encoder" node_id: 1 node_type: PYTHON
      publishers { data_type: JOINT_STATE topic_name: "/watched/joint_states" publish_rate_hz: 20.0 }
    }
    perception_type: PERCEPTION_ENCODER
    mock_encoder_config { resolution: 4096 }
  }
}
transport { listen_endpoints: "tcp/localhost:PORT" }
"""


@pytest.fixture
def environment(tmp_path, joshua_domain_id):
    (tmp_path / "run").mkdir(mode=0o700)
    return {
        **os.environ,
        "XDG_RUNTIME_DIR": str(tmp_path / "run"),
        "JOSHUA_LOG_DIR": str(tmp_path / "log"),
        "ROS_DOMAIN_ID": str(joshua_domain_id),
    }


def joshua(environment, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "joshua.cli.main", *arguments],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )


def start(environment, tmp_path, name):
    path = tmp_path / name
    path.write_text(CONFIGURATION.replace("PORT", str(free_port())).replace("watched", Path(name).stem))
    process = subprocess.Popen(
        [sys.executable, "-m", "joshua.cli.main", "--config", str(path)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    shown = ""
    for line in process.stdout:
        shown += line
        if " ready after " in line:
            return process, path
    process.wait()
    process.stdout.close()
    raise AssertionError(shown)


@pytest.fixture
def running(environment, tmp_path):
    process, path = start(environment, tmp_path, "one.pbtxt")
    yield process, path
    if process.poll() is None:
        process.terminate()
    process.communicate(timeout=120)


def test_nothing_runs(environment):
    for command in ("status", "stop"):
        result = joshua(environment, command)
        assert (result.returncode, result.stdout) == (0, "no system is running\n"), result.stderr


def test_status_shows_the_run_and_stop_ends_it(environment, running):
    process, path = running

    text = joshua(environment, "status")
    assert text.returncode == 0, text.stderr
    assert str(path) in text.stdout
    assert "/one_encoder" in text.stdout
    (answer,) = json.loads(joshua(environment, "status", "--format", "json").stdout)
    assert answer["process_id"] == process.pid
    assert [node["state"] for node in answer["nodes"]] == ["ready"]

    for words in ((str(path),), ("--config", str(path)), (str(process.pid),)):
        assert joshua(environment, "status", *words).stdout.startswith(str(path))
    other = joshua(environment, "status", "three.pbtxt")
    assert (other.returncode, other.stderr) == (
        1,
        f"joshua status: three.pbtxt is not running\n  {process.pid}  {path}\n",
    )

    stopped = joshua(environment, "stop", str(path))
    assert stopped.returncode == 0, stopped.stderr
    assert stopped.stdout == f"stopped {path} (process {process.pid})\n"
    assert process.wait(120) == 1, "a test that was not finished has not passed"


def test_a_run_that_does_not_end_in_time_is_named(monkeypatch, capsys):
    system = SimpleNamespace(info=SimpleNamespace(process_id=7), stop=lambda timeout_s: False)
    monkeypatch.setattr(RunningSystem, "find", lambda word: system)
    assert stop.run(Namespace(config="", timeout=90.0)) == 1
    assert capsys.readouterr().err == (
        "joshua stop: process 7 still runs 90 s after the request to stop. Run `joshua status` to see why; "
        "`kill 7` ends it and loses what it still writes\n"
    )


def test_stop_asks_which_when_several_run(environment, running, tmp_path):
    second, path = start(environment, tmp_path, "two.pbtxt")
    try:
        unclear = joshua(environment, "stop")
        assert unclear.returncode == 2
        assert "several systems are running, name one of them" in unclear.stderr
        assert str(path) in unclear.stderr

        unknown = joshua(environment, "stop", "three.pbtxt")
        assert unknown.returncode == 2
        assert "three.pbtxt is not running" in unknown.stderr

        chosen = joshua(environment, "stop", str(second.pid))
        assert chosen.returncode == 0, chosen.stderr
        assert second.wait(120) == 1
        assert running[0].poll() is None
    finally:
        if second.poll() is None:
            second.terminate()
        second.communicate(timeout=120)


def test_a_system_that_does_not_answer_is_named(environment, running):
    process, path = running
    os.kill(process.pid, signal.SIGSTOP)
    try:
        status = joshua(environment, "status")
        assert status.returncode == 1
        assert f"process {process.pid}, which runs {path}, does not answer" in status.stderr
        stop = joshua(environment, "stop")
        assert stop.returncode == 1
        assert f"kill {process.pid}" in stop.stderr
    finally:
        os.kill(process.pid, signal.SIGCONT)
