"""``joshua estop`` and ``joshua resume``: what is chosen, and what is said where there is nothing to do."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from joshua.cli.main import main
from joshua.guardian.latch import LatchFolder, Subject
from joshua.ipc import run_bases
from joshua.supervisor.run_directory import RunDirectory
from joshua.supervisor.starting import starting
from joshua.testing.port import free_port
from same_process import joshua_here

CONFIGURATION = """
general { mode: MODE_TEST id: "NAME" name: "estop test" }
test { duration_s: 300 }
robot {
  actions {
    node {
      node_name: "NAME_arm" node_id: 1 node_type: PYTHON
      publishers { data_type: JOINT_STATE topic_name: "/NAME/state" publish_rate_hz: 20.0 }
      subscriptions { data_type: JOINT_STATE topic_name: "/NAME/goal" }
    }
    action_type: ACTION_MOCK
    mock_motor_config { num_motors: 2 position_max: 4095 }
  }
  perceptions {
    node {
      node_name: "NAME_encoder" node_id: 2 node_type: PYTHON
      publishers { data_type: JOINT_STATE topic_name: "/NAME/encoder" publish_rate_hz: 20.0 }
    }
    perception_type: PERCEPTION_ENCODER
    mock_encoder_config { resolution: 4096 }
  }
}
transport { listen_endpoints: "tcp/localhost:PORT" }
"""


class Shell:
    """Commands of the program, and runs in the background."""

    def __init__(self, folder: Path, domain_id: int) -> None:
        (folder / "run").mkdir(mode=0o700)
        self.folder = folder
        self.environment = {
            **os.environ,
            "XDG_RUNTIME_DIR": str(folder / "run"),
            "JOSHUA_LOG_DIR": str(folder / "log"),
            "ROS_DOMAIN_ID": str(domain_id),
        }
        self.processes: list[subprocess.Popen[str]] = []
        self.nodes: list[dict[str, Any]] = []

    @property
    def latches(self) -> LatchFolder:
        return LatchFolder(self.folder / "run" / "joshua" / "estop")

    def joshua(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return joshua_here(*arguments, environment=self.environment, folder=self.folder)

    def file(self, name: str) -> Path:
        path = self.folder / f"{name}.pbtxt"
        path.write_text(CONFIGURATION.replace("NAME", name).replace("PORT", str(free_port())))
        return path

    def launch(self, path: Path) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-m", "joshua.cli.main", "--config", str(path)],
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.processes.append(process)
        return process

    def start(self, name: str) -> Path:
        path = self.file(name)
        process = self.launch(path)
        assert process.stdout is not None
        shown = ""
        for line in process.stdout:
            shown += line
            if "nodes ready after" in line:
                return path
        raise AssertionError(shown)

    def states(self) -> dict[str, str]:
        answers: list[dict[str, Any]] = json.loads(self.joshua("status", "--format", "json").stdout)
        self.nodes = [node for answer in answers for node in answer["nodes"]]
        return {node["full_name"]: node["state"] for node in self.nodes}

    def await_states(self, **expected: str) -> None:
        """An actuator says that its torque is off before it says that it is in fault."""
        wanted = {f"/{node}": state for node, state in expected.items()}
        end_s = time.monotonic() + 60
        while not wanted.items() <= self.states().items():
            assert time.monotonic() < end_s, self.nodes
            time.sleep(0.02)


@pytest.fixture
def shell(tmp_path: Path, joshua_domain_id: int) -> Iterator[Shell]:
    shell = Shell(tmp_path, joshua_domain_id)
    yield shell
    for process in shell.processes:
        process.terminate()
        process.communicate(timeout=120)


def test_every_system_is_stopped_and_each_latch_is_released_by_itself(shell: Shell) -> None:
    desk, shelf = shell.start("desk"), shell.start("shelf")
    result = shell.joshua("estop")
    assert result.returncode == 0, result.stderr
    assert "/desk_arm  off     read back from 2 joints by its driver" in result.stdout
    assert "/shelf_arm  off     read back from 2 joints by its driver" in result.stdout
    shell.await_states(desk_arm="fault", desk_encoder="ready", shelf_arm="fault", shelf_encoder="ready")
    unclear = shell.joshua("estop", "--release")
    assert unclear.returncode == 2
    assert "name one of these" in unclear.stderr
    assert str(shelf) in unclear.stderr
    assert len(shell.latches.all()) == 2
    unknown = shell.joshua("estop", "--release", "attic")
    assert unknown.returncode == 2
    assert "no e-stop of 'attic' is latched" in unknown.stderr
    released = shell.joshua("estop", "--release", "desk.pbtxt")
    assert released.returncode == 0, released.stderr
    assert str(desk) in released.stdout
    assert shell.joshua("resume", "desk_arm").returncode == 0
    refused = shell.joshua("resume", "/shelf_arm")
    assert refused.returncode == 4
    assert "the e-stop of shelf is latched since" in refused.stderr


def test_two_users_at_once_are_both_told_the_truth(shell: Shell) -> None:
    shell.start("desk")
    command = [sys.executable, "-m", "joshua.cli.main", "estop"]
    options = {"env": shell.environment, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    users = [subprocess.Popen(command, **options) for _ in range(3)]  # type: ignore[call-overload]
    for user in users:
        output, errors = user.communicate(timeout=120)
        assert user.returncode == 0, output + errors
        assert "/desk_arm  off     read back from 2 joints by its driver" in output
    assert shell.latches.all()
    released = shell.joshua("estop", "--release")
    assert released.returncode == 0, released.stderr
    assert shell.latches.all() == []


def test_one_of_several_is_stopped(shell: Shell) -> None:
    shell.start("desk")
    shell.start("shelf")
    unknown = shell.joshua("estop", "attic.pbtxt")
    assert unknown.returncode == 2
    assert "attic.pbtxt is neither a running system nor a file, so nothing was stopped" in unknown.stderr
    assert "shelf.pbtxt" in unknown.stderr
    result = shell.joshua("estop", "--config", "shelf.pbtxt")
    assert result.returncode == 0, result.stderr
    assert "the e-stop of shelf is latched since" in shell.joshua("status").stdout
    shell.await_states(desk_arm="ready", shelf_arm="fault")


def test_the_same_robot_under_another_file_is_stopped(shell: Shell) -> None:
    running = shell.start("desk")
    other = shell.folder / "copy.pbtxt"
    other.write_text(running.read_text())
    result = shell.joshua("estop", "--config", str(other))
    assert result.returncode == 0, result.stderr
    assert f"e-stop latched: {running} (process" in result.stdout
    assert "read back from 2 joints by its driver" in result.stdout
    shell.await_states(desk_arm="fault")


def test_a_run_that_is_just_being_started_is_stopped(shell: Shell) -> None:
    path = shell.file("desk")
    process = shell.launch(path)
    marks, end_s = shell.folder / "run" / "joshua" / "starting", time.monotonic() + 60
    while not list(marks.glob("*.run")):
        assert time.monotonic() < end_s
        time.sleep(0.01)
    result = shell.joshua("estop")  # the file is being read
    assert result.returncode == 0, result.stderr
    assert f"e-stop latched: {path}" in result.stdout
    assert process.stdout is not None
    assert any("nodes ready after" in line for line in process.stdout)
    shell.await_states(desk_arm="fault")


def test_a_slow_start_is_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("joshua.cli.commands.estop.STARTING_S", 0.0)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    base = run_bases.base_directory(os.environ)
    runs: list[RunDirectory] = []

    def start() -> None:
        time.sleep(0.3)
        runs.append(RunDirectory.create(base, "/srv/robot.pbtxt", 7, ["/arm"], robot="desk"))

    with starting(base):
        thread = threading.Thread(target=start)
        thread.start()
        assert main(["estop"]) == 0
        thread.join()
    assert "e-stop latched: /srv/robot.pbtxt" in capsys.readouterr().out
    runs[0].close()
    assert main(["estop"]) == 1


def test_a_run_that_starts_beside_another_is_stopped_too(shell: Shell) -> None:
    shell.start("desk")
    process = shell.launch(path := shell.file("shelf"))
    mark, end_s = shell.folder / "run" / "joshua" / "starting" / f"{process.pid}.run", time.monotonic() + 60
    while not mark.exists():
        assert time.monotonic() < end_s
        time.sleep(0.01)
    result = shell.joshua("estop")
    assert result.returncode == 0, result.stderr
    assert f"e-stop latched: {path}" in result.stdout
    shell.await_states(desk_arm="fault", shelf_arm="fault")


def test_nothing_runs(shell: Shell) -> None:
    result = shell.joshua("estop")
    assert result.returncode == 1
    assert "no system is running, so nothing was stopped" in result.stderr
    assert shell.latches.all() == []
    released = shell.joshua("estop", "--release")
    assert (released.returncode, released.stdout) == (0, "no e-stop is latched\n")
    resumed = shell.joshua("resume", "desk_arm")
    assert resumed.returncode == 1
    assert "no system is running. Start one: joshua --config FILE" in resumed.stderr


def test_a_file_that_does_not_run_is_latched_and_a_bad_one_is_not(shell: Shell) -> None:
    path = shell.file("desk")
    result = shell.joshua("estop", "--config", str(path))
    assert result.returncode == 0, result.stderr
    assert "(not running)" in result.stdout
    assert "/desk_arm  off     read back from 2 joints by this command" in result.stdout
    assert [latch.robot for latch in shell.latches.all()] == ["desk"]
    shell.start("desk")
    shell.await_states(desk_arm="fault")
    bad = shell.folder / "bad.pbtxt"
    bad.write_text("robot {")
    refused = shell.joshua("estop", "--config", str(bad))
    assert refused.returncode == 2
    assert "the file is invalid, so nothing was stopped" in refused.stderr


def test_resume_names_what_there_is(shell: Shell) -> None:
    shell.start("desk")
    typo = shell.joshua("resume", "desk_amr")
    assert typo.returncode == 2
    assert "no actuator is named 'desk_amr'" in typo.stderr
    assert "allowed: /desk_arm" in typo.stderr
    sensor = shell.joshua("resume", "desk_encoder")
    assert sensor.returncode == 2
    healthy = shell.joshua("resume", "desk_arm")
    assert healthy.returncode == 0
    assert "there is nothing to resume" in healthy.stdout


def test_a_run_that_cannot_be_latched_is_told_over_its_socket(shell: Shell) -> None:
    shell.start("desk")
    shutil.rmtree(shell.latches.path)
    shell.latches.path.write_text("in the way")
    result = shell.joshua("estop")
    assert result.returncode == 0, result.stderr
    rows = [line.split(maxsplit=1) for line in result.stdout.splitlines()]
    assert ["/desk_arm", "off     read back from 2 joints by its driver"] in rows
    assert any(row[0] == "latch" and row[1].startswith(f"not set in {shell.latches.path}: ") for row in rows)
    assert ["device", "not needed"] in [[row[0], row[-1].strip()] for row in rows]
    assert "Torque stays off until you run: joshua estop --release" in result.stdout
    shell.await_states(desk_arm="fault")
    refused = shell.joshua("resume", "desk_arm")
    assert refused.returncode == 4
    assert "the e-stop of desk is latched since" in refused.stderr
    released = shell.joshua("estop", "--release")
    assert released.returncode == 0, released.stderr
    assert "released: " in released.stdout
    again = shell.joshua("estop", "--release")
    assert again.stdout == "no e-stop is latched\n"
    refused = shell.joshua("resume", "desk_arm")
    assert refused.returncode == 4
    assert "an e-stop might not be possible" in refused.stderr
    shell.latches.path.unlink()
    assert shell.joshua("resume", "desk_arm").returncode == 0


def test_a_run_of_another_environment_is_stopped_and_released_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    user = str(os.getuid())
    (tmp_path / "run" / user).mkdir(parents=True)
    monkeypatch.setattr(run_bases, "_RUNTIME_FOLDERS", tmp_path / "run")
    monkeypatch.setattr(run_bases, "_FALLBACK", tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "run" / user))
    run = RunDirectory.create(run_bases.base_directory({}), "/srv/robot.pbtxt", 7, ["/arm"], robot="desk")
    arm = Subject("desk", 7, "/arm")

    assert main(["estop"]) == 0
    assert "e-stop latched: /srv/robot.pbtxt" in capsys.readouterr().out
    folders = [LatchFolder(base / "estop") for base in run_bases.base_directories({})]
    assert [bool(folder.standing(arm)) for folder in folders] == [True, True]  # wherever it starts next

    assert main(["status"]) == 1  # this test does not answer for the run
    assert capsys.readouterr().out.count("the e-stop of desk is latched") == 1
    assert main(["estop", "--release"]) == 0
    assert [folder.standing(arm) for folder in folders] == [None, None]
    run.close()


RECORD_IMPORTS = """
import sys

def note(event, arguments):
    if event == "os.rename" and str(arguments[1]).endswith(".json"):
        loaded = set(sys.modules) - {"pydantic.plugin._loader"}  # an empty one that keeps pydantic's out
        known = {*sys.stdlib_module_names, *before}
        print("MODULES", *sorted(name for name in loaded if name.partition(".")[0] not in known))

before = {name.partition(".")[0] for name in sys.modules}  # those of the interpreter's start
sys.addaudithook(note)
from joshua.cli.main import main
main(["estop"])
"""


def test_nothing_is_imported_before_the_latch_stands_that_the_estop_does_not_need(tmp_path: Path) -> None:
    base = run_bases.base_directory({"XDG_RUNTIME_DIR": str(tmp_path)})
    run = RunDirectory.create(base, "/srv/robot.pbtxt", 7, [], robot="desk")
    command = subprocess.run(
        [sys.executable, "-c", RECORD_IMPORTS],
        env={**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    run.close()
    (modules,) = [line.split()[1:] for line in command.stdout.splitlines() if line.startswith("MODULES")]
    assert modules == [
        "joshua",
        "joshua.cli",
        "joshua.cli.commands",
        "joshua.cli.commands.estop",
        "joshua.cli.estop",
        "joshua.cli.exit_codes",
        "joshua.cli.main",
        "joshua.cli.options",
        "joshua.cli.parser",
        "joshua.cli.table",
        "joshua.guardian",
        "joshua.guardian.latch",
        "joshua.ipc",
        "joshua.ipc.client",
        "joshua.ipc.run_bases",
        "joshua.plan",
        "joshua.plan.foreign_text",
        "joshua.plan.lazy",
    ]
