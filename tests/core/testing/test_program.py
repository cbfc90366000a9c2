from __future__ import annotations

import json
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from joshua.testing.program import JoshuaProgram, router_port

CONFIGURATION = """
general { mode: MODE_TELEOPERATE name: "watched" id: "watched" }
robot {
  perceptions {
    node {
      node_name: "shaft" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/shaft/joint_states" publish_rate_hz: 20 }
    }
    perception_type: PERCEPTION_ENCODER
    mock_encoder_config { resolution: 4096 }
  }
}
"""


@pytest.fixture
def robot(tmp_path: Path) -> str:
    path = tmp_path / "robot.pbtxt"
    path.write_text(CONFIGURATION, encoding="utf-8")
    return str(path)


def test_a_run_has_router_logs_and_domain_of_its_own(
    joshua_run: JoshuaProgram, joshua_domain_id: int, robot: str, tmp_path: Path
) -> None:
    result = joshua_run("--config", robot, "--set", "general.mode=MODE_TEST", "--duration", "1")
    said = result.stdout + result.stderr
    assert result.returncode == 0, said
    assert f"hosts the Zenoh router on {joshua_run.router}" in said
    assert f"domain {joshua_domain_id}" in said
    assert list((tmp_path / "log").iterdir())


def test_a_run_that_takes_too_long_is_stopped_and_shows_what_it_said(
    joshua_run: JoshuaProgram, robot: str
) -> None:
    words = ("--config", robot, "--set", "general.mode=MODE_TEST", "--duration", "600")
    for timeout_s in (4, 60):  # a machine that is late has said nothing after four seconds
        with pytest.raises(subprocess.TimeoutExpired) as caught:
            joshua_run(*words, timeout_s=timeout_s)
        assert caught.value.timeout == timeout_s
        if "robot.pbtxt" in (said := str(caught.value.output) + str(caught.value.stderr)):
            break
    assert "robot.pbtxt" in said


def test_a_test_that_is_stopped_early_has_not_passed(joshua_run: JoshuaProgram, robot: str) -> None:
    process = joshua_run.start("--config", robot, "--set", "general.mode=MODE_TEST", "--duration", "600")
    assert process.stdout is not None
    shown = ""
    while "ready after" not in shown:
        line = process.stdout.readline()
        assert line, shown
        shown += line
    output, errors = joshua_run.stop(process)
    assert process.returncode == 1, output + errors
    assert output.endswith("test not finished: stopped by SIGINT before its time was over\n")


def test_what_still_runs_is_stopped_at_the_end(tmp_path: Path, joshua_domain_id: int, robot: str) -> None:
    program = JoshuaProgram(tmp_path, joshua_domain_id)
    process = program.start("--config", robot, "--set", "general.mode=MODE_TEST", "--duration", "600")
    program.close()
    assert process.returncode is not None


def test_commands_without_a_file_run_as_they_are(joshua_run: JoshuaProgram) -> None:
    result = joshua_run("plugins", "--json")
    assert result.returncode == 0, result.stderr
    assert any(row["name"] == "joshua-core" for row in json.loads(result.stdout))


def test_a_router_has_the_port_of_its_domain_unless_that_is_taken(joshua_domain_id: int) -> None:
    port = router_port(joshua_domain_id)
    assert port < 32768, "systems give out those above"
    assert router_port(joshua_domain_id) == port
    with socket.socket() as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # what ran before may linger
        server.bind(("127.0.0.1", port))
        server.listen()
        assert router_port(joshua_domain_id) != port


def test_the_fixtures_reach_another_test_suite(tmp_path: Path) -> None:
    (tmp_path / "test_it.py").write_text(
        "def test_domain(joshua_domain_id, joshua_run):\n    assert joshua_domain_id\n", encoding="utf-8"
    )
    command = [sys.executable, "-m", "pytest", "-q", str(tmp_path)]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=90, check=False)
    assert result.returncode == 0, result.stdout
