"""Recording and replaying through real runs: from devices and a camera to a data set, and back to an arm."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from eventually import eventually
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from joshua_dataset.reader import Dataset
from joshua_dataset.writer import LeRobotWriter
from processes import descendants_of, title_of
from rosbags.rosbag2 import Reader
from same_process import joshua_here
from small_dataset import layout
from terminal_run import TerminalRun

ROBOT = """
robot {{
  actions {{
    node {{ node_name: "leader" node_id: 1
      publishers {{ data_type: JOINT_STATE topic_name: "/leader/joint_states" publish_rate_hz: 50 }} }}
    action_type: ACTION_LEADER
    mock_motor_config {{ num_motors: 2 position_min: 1024 position_max: 3072 motion: MOCK_MOTION_SINE }}
  }}
  actions {{
    node {{ node_name: "follower" node_id: 2
      publishers {{ data_type: JOINT_STATE topic_name: "/follower/joint_states" publish_rate_hz: 50 }}
      subscriptions {{ data_type: JOINT_STATE topic_name: "/leader/joint_states" }} }}
    action_type: ACTION_FOLLOWER
    mock_motor_config {{ num_motors: 2 position_min: 1024 position_max: 3072 }}
  }}
  perceptions {{
    node {{ node_name: "camera_top" node_id: 3
      publishers {{ data_type: IMAGE topic_name: "/top/image_raw" publish_rate_hz: 20 }} }}
    perception_type: PERCEPTION_CAMERA
    mock_camera_config {{ width: 64 height: 48 fps: 20 }}
  }}
}}
general {{ mode: {mode} name: "cell" id: "cell" robot_type: "{robot_type}" }}
ai {{ data_store {{
  format: {format} storage: STORAGE_LOCAL dataset_name: "waves" local_path: "waves" task: "wave" fps: 20
  {fields}
}} }}
"""
TOP = "observation.images.top"


def write(folder: Path, fields: str = "", **changes: str) -> Path:
    values = {"mode": "MODE_DATA_STORE", "robot_type": "mock", "format": "FORMAT_HUGGINGFACE"} | changes
    path = folder / "cell.pbtxt"
    path.write_text(ROBOT.format(fields=fields, **values))
    return path


@pytest.fixture
def joshua(tmp_path: Path) -> Iterator[JoshuaProgram]:
    with reserved_domain() as domain_id:
        program = JoshuaProgram(tmp_path, domain_id, {"JOSHUA_RUN_DIR": str(tmp_path / "runs")})
        yield program
        program.close()


def started(joshua: JoshuaProgram, path: Path) -> subprocess.Popen[str]:
    """A run whose recorder has a message on every topic."""
    process = joshua.start("--config", str(path))
    eventually(lambda: ready(joshua), "every topic has a message")
    return process


def ready(joshua: JoshuaProgram) -> bool:
    rates = status(joshua).get("rates_hz", {})
    return bool(rates) and all(rates.values())


def here(joshua: JoshuaProgram, *words: str) -> subprocess.CompletedProcess[str]:
    return joshua_here(*words, environment=joshua.environment, folder=joshua.folder)


def status(joshua: JoshuaProgram) -> dict[str, Any]:
    found = here(joshua, "call", "data_store", "status", "--format", "json")
    return dict(json.loads(found.stdout)) if found.returncode == 0 else {}


def record(joshua: JoshuaProgram, *words: str) -> str:
    found = joshua("record", *words)
    assert found.returncode == 0, found.stderr
    return found.stdout


def by_keys(joshua: JoshuaProgram) -> None:
    """A person at a terminal records and discards an episode by keys, and leaves by Ctrl-C."""
    command = [sys.executable, "-m", "joshua.cli.main", "record"]
    with contextlib.closing(TerminalRun(command, joshua.environment)) as screen:
        screen.wait_for("episode 1  ready", "task: point", "space start/stop  k keep  d discard")
        screen.type("k")
        screen.wait_for("there is no episode to keep: start one first")
        screen.type(" ")
        screen.wait_for("episode 1 starts: point")
        eventually(lambda: status(joshua)["frames"] >= 5)
        screen.wait_for("episode 1  recording")
        screen.type(" ")
        screen.wait_for("keep or discard it")
        screen.type("d")
        screen.wait_for("episode 1 is discarded")
        screen.type("\x03")
        assert screen.end() == 130
        assert "Traceback" not in screen.text
        assert screen.attributes() == screen.first


def test_a_session_by_commands(joshua: JoshuaProgram, tmp_path: Path) -> None:
    process = started(joshua, write(tmp_path))
    assert record(joshua, "start") == "episode 0 starts: wave\n"
    eventually(lambda: status(joshua)["frames"] >= 20)
    assert "ended" not in record(joshua, "status")
    assert "keep or discard it" in record(joshua, "stop")
    assert "episode 0 is kept: " in record(joshua, "keep")
    refused = joshua("record", "keep")
    assert refused.returncode == 1
    assert "there is no episode to keep: start one first" in refused.stderr
    assert record(joshua, "task", "point") == "the task is 'point'\n"
    by_keys(joshua)
    record(joshua, "start")
    eventually(lambda: status(joshua)["frames"] >= 5)
    _, errors = joshua.stop(process)  # Ctrl-C in the middle of an episode
    assert "episode 1 is kept" in errors
    assert process.returncode == 0
    found = Dataset.read(tmp_path / "waves")
    first, second = found.episode_list()
    assert (found.tasks, first.tasks, second.tasks) == (("wave", "point"), ("wave",), ("point",))
    columns = found.columns(first)
    steps_ns = np.diff(columns["stamp_ns"])
    assert np.all(steps_ns == 50_000_000)
    assert columns["timestamp"][1] == pytest.approx(0.05)
    acquired = columns["acquisition_ns"]
    assert list(found.features["acquisition_ns"].names) == ["observation.state", TOP, "action"]
    assert np.abs(acquired - columns["stamp_ns"][:, None]).max() <= 50_000_000
    assert first.counts["worst_alignment_ns"] <= 50_000_000
    # the follower's command is the action, and its state follows
    assert np.ptp(columns["action"]) > 0.02
    assert np.abs(columns["action"] - columns["observation.state"]).mean() < 0.2
    assert sum(1 for _ in found.decoded(first, TOP)) == first.length


def test_a_session_by_durations_ends_itself_and_is_appended_to(joshua: JoshuaProgram, tmp_path: Path) -> None:
    fields = "auto_start: true num_episodes: 2 episode_duration_s: 0.6 reset_duration_s: 0.1 resume: true "
    path = write(tmp_path, fields + "units: UNIT_LEROBOT")
    for total in (2, 4):
        run = joshua("--config", str(path))
        assert run.returncode == 0, run.stderr
        assert "2 episodes are in" in run.stdout + run.stderr
        assert Dataset.read(tmp_path / "waves").episodes == total
    found = Dataset.read(tmp_path / "waves")
    assert found.features["action"].names == ("joint_1.pos", "joint_2.pos")
    assert found.features["action"].unit == "lerobot"
    path = write(tmp_path, fields + "units: UNIT_DEGREES")
    refused = joshua("--config", str(path), "--duration", "4")
    assert "unit deg here and lerobot there" in refused.stdout + refused.stderr
    assert Dataset.read(tmp_path / "waves").episodes == 4


def test_a_killed_supervisor_leaves_a_complete_data_set(joshua: JoshuaProgram, tmp_path: Path) -> None:
    process = started(joshua, write(tmp_path))
    record(joshua, "start")
    eventually(lambda: status(joshua)["frames"] >= 10)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    eventually(lambda: (tmp_path / "waves/meta/info.json").exists(), "the recorder ends its episode")
    (episode,) = Dataset.read(tmp_path / "waves").episode_list()
    assert episode.length >= 10


def test_a_killed_recorder_comes_back_and_completes_its_episode(
    joshua: JoshuaProgram, tmp_path: Path
) -> None:
    fields = "auto_start: true num_episodes: 1 episode_duration_s: 600"
    process = started(joshua, write(tmp_path, fields))
    frames = eventually(lambda: (found := status(joshua)["frames"]) >= 30 and found)
    (recorder,) = [pid for pid in descendants_of(process.pid) if "data_store" in title_of(pid)]
    os.kill(recorder, signal.SIGKILL)
    eventually(lambda: (tmp_path / "waves/meta/info.json").exists(), "the episode is completed")
    (episode,) = Dataset.read(tmp_path / "waves").episode_list()
    assert episode.length >= frames - 20
    assert episode.tasks == ("wave",)
    eventually(lambda: process.poll() is not None, "the session is complete with it")
    _, errors = joshua.stop(process)
    assert "episode 0 is completed with" in errors
    assert "1 episodes are in" in errors
    assert process.returncode == 0


def test_a_data_set_that_exists_is_refused_before_anything_moves(
    joshua: JoshuaProgram, tmp_path: Path
) -> None:
    (tmp_path / "waves").mkdir()
    (tmp_path / "waves" / "mine.txt").write_text("kept")
    refused = joshua("--config", str(write(tmp_path)), "--duration", "20")
    assert refused.returncode != 0
    assert "waves is not empty, and data sets are never overwritten" in refused.stderr
    assert "Traceback" not in refused.stdout + refused.stderr
    assert re.search(
        r"/follower +out /follower/joint_states +50 Hz +0\.00 Hz", refused.stdout
    )  # never active
    assert [path.name for path in (tmp_path / "waves").iterdir()] == ["mine.txt"]


def test_a_leader_alone_is_recorded_with_a_warning(joshua: JoshuaProgram, tmp_path: Path) -> None:
    path = write(tmp_path)
    head, _, rest = path.read_text().partition('  actions {\n    node { node_name: "follower"')
    path.write_text(head + "  perceptions {" + rest.partition("  perceptions {")[2])
    (tmp_path / "waves").mkdir()
    with contextlib.closing(LeRobotWriter(layout(tmp_path / "waves", resume=True))) as other:
        other.open()  # another recorder of the same folder
        refused = joshua("--config", str(path), "--duration", "20")
    assert refused.returncode != 0
    assert re.search(r"waves is being written by process \d+ on .* since", refused.stderr)
    run = joshua("--config", str(path), "--duration", "1")
    assert "no action is recorded, because no actuator of the file takes commands" in run.stdout
    assert run.returncode == 0


def test_an_episode_needs_every_topic(joshua: JoshuaProgram, tmp_path: Path) -> None:
    process = started(joshua, write(tmp_path))
    cameras = [pid for pid in descendants_of(process.pid) if "camera_top" in title_of(pid)]
    for pid in cameras:
        os.kill(pid, signal.SIGSTOP)  # its topic does not come
    eventually(lambda: not status(joshua)["rates_hz"][TOP], "the camera is silent")
    refused = joshua("record", "start")
    for pid in cameras:
        with contextlib.suppress(ProcessLookupError):  # taken for hung meanwhile
            os.kill(pid, signal.SIGCONT)
    assert refused.returncode == 1
    assert "no message received on /top/image_raw: an episode needs every topic" in refused.stderr
    joshua.stop(process)
    assert not (tmp_path / "waves").exists()


def test_a_camera_that_is_lost_ends_the_episode(joshua: JoshuaProgram, tmp_path: Path) -> None:
    process = started(joshua, write(tmp_path, "auto_start: true episode_duration_s: 60"))
    eventually(lambda: status(joshua)["frames"] >= 10)
    deadline = time.monotonic() + 20
    while status(joshua)["phase"] == "recording" and time.monotonic() < deadline:
        for pid in descendants_of(process.pid):  # a camera that starts anew is unplugged again
            if "camera_top" in title_of(pid):
                os.kill(pid, signal.SIGKILL)
        time.sleep(0.1)
    found = status(joshua)
    assert found["phase"] == "reset"
    assert "episode 0 ended early: observation.images.top is lost: no message" in found["message"]
    assert record(joshua, "keep").startswith("episode 0 is kept: ")
    joshua.stop(process)
    (episode,) = Dataset.read(tmp_path / "waves").episode_list()
    assert episode.length >= 10
    assert 0 < episode.counts["dropped"] < 60


GAMEPAD = """robot {
  perceptions {
  node { node_name: "pad" node_id: 9
    publishers { data_type: JOY topic_name: "/pad/joy" publish_rate_hz: 30 } }
  perception_type: PERCEPTION_GAMEPAD
  gamepad_config { device: "Xbox" }
}
"""


def test_the_buttons_of_a_gamepad_control_the_episodes(joshua: JoshuaProgram, tmp_path: Path) -> None:
    path = write(tmp_path, 'record_button: "a" keep_button: "b"')
    path.write_text(path.read_text().replace("robot {", GAMEPAD, 1))
    process = joshua.start("--config", str(path), "--emulate")
    # the emulated hand presses a for a second, then b, after eleven seconds
    eventually(lambda: (tmp_path / "waves/meta/info.json").exists(), "the episode is kept")
    _, errors = joshua.stop(process)
    assert "episode 0 starts: wave" in errors
    assert "episode 0 is kept: " in errors
    found = Dataset.read(tmp_path / "waves")
    assert [key for key in found.features if "pad" in key or "joy" in key] == []  # it controls only


def test_a_button_without_a_gamepad_is_refused(joshua: JoshuaProgram, tmp_path: Path) -> None:
    refused = joshua("--config", str(write(tmp_path, 'record_button: "a"')), "--duration", "20")
    assert refused.returncode != 0
    assert "no node publishes its state. Add a publisher of data_type: JOY" in refused.stderr


def test_recording_beside_teleoperation_waits_for_its_user(joshua: JoshuaProgram, tmp_path: Path) -> None:
    path = write(tmp_path, mode="MODE_TELEOPERATE", format="FORMAT_CSV")
    process = started(joshua, path)
    assert not (tmp_path / "waves").exists()
    record(joshua, "start")
    eventually(lambda: status(joshua)["frames"] >= 5)
    record(joshua, "keep")
    joshua.stop(process)
    (episode,) = Dataset.read(tmp_path / "waves").episode_list()
    header = episode.table.read_text().partition("\n")[0]
    assert '"action.joint_1"' in header
    assert process.returncode == 0


SHIFTED = """import os, time

now, shift_ns = time.time_ns, int(os.environ["SHIFT_NS"])
time.time_ns = lambda: now() + shift_ns
"""
CAMERA = """  perceptions {
    node { node_name: "camera_side" node_id: 4 host: "nano"
      publishers { data_type: IMAGE topic_name: "/side/image_raw" publish_rate_hz: 20 } }
    perception_type: PERCEPTION_CAMERA
    mock_camera_config { width: 64 height: 48 fps: 20 }
  }
"""


def test_other_hosts_whose_clocks_are_ahead_and_behind(joshua: JoshuaProgram, tmp_path: Path) -> None:
    path = write(tmp_path, "tolerance_s: 0.05")
    node = 'node { node_name: "camera_top" node_id: 3'
    text = path.read_text().replace(node, f'{node} host: "jetson"')
    path.write_text(text.replace("}\ngeneral", f"{CAMERA}}}\ngeneral", 1))
    (tmp_path / "sitecustomize.py").write_text(SHIFTED)  # the clock of another host
    warnings = {
        "jetson": r"the stamps of /top/image_raw are 0\.\d+ s ahead of this machine",
        "nano": r"the stamps of /side/image_raw are 0\.[12]\d+ s behind this machine",
    }
    with contextlib.ExitStack() as hosts:
        cameras = []
        for host, shift_ns in (("jetson", 300_000_000), ("nano", -200_000_000)):
            other = {
                "JOSHUA_RUN_DIR": str(tmp_path / host),
                "PYTHONPATH": str(tmp_path),
                "SHIFT_NS": str(shift_ns),
            }
            program = JoshuaProgram(tmp_path, int(joshua.environment["ROS_DOMAIN_ID"]), other)
            hosts.enter_context(contextlib.closing(program))
            cameras.append((program, program.start("--config", str(path), "--host", host)))
        process = started(joshua, path)
        eventually(lambda: abs(status(joshua)["delays_s"][TOP] + 0.3) < 0.1, "the offset is estimated")

        def warned(text: str) -> bool:
            return any(re.search(text, log.read_text()) for log in (tmp_path / "log").iterdir())

        eventually(lambda: all(map(warned, warnings.values())), "both clocks are named")
        _, errors = joshua.stop(process)
        for program, camera in cameras:
            program.stop(camera)
    for warning in warnings.values():
        assert re.search(warning, errors)
    assert "Synchronise the clocks of the hosts with chrony or NTP" in errors


def test_messages_are_recorded_as_they_come(joshua: JoshuaProgram, tmp_path: Path) -> None:
    fields = "auto_start: true num_episodes: 1 episode_duration_s: 1.0"
    run = joshua("--config", str(write(tmp_path, fields, format="FORMAT_MCAP")))
    assert run.returncode == 0, run.stderr
    assert re.search(r"episode 0 is kept: \d+ messages \((0\.9|1\.\d) s\)", run.stdout + run.stderr)
    (episode,) = Dataset.read(tmp_path / "waves").episode_list()
    with Reader(episode.table) as reader:
        counts = {item.topic: item.msgcount for item in reader.connections}
    assert counts.keys() == {
        *("/leader/joint_states", "/follower/joint_states", "/follower/applied_command"),
        *("/top/image_raw",),
    }
    assert counts["/leader/joint_states"] >= 30
    assert counts["/top/image_raw"] >= 10


def test_a_replay_drives_the_arm_through_the_recording(joshua: JoshuaProgram, tmp_path: Path) -> None:
    fields = "auto_start: true num_episodes: 1 episode_duration_s: 1.5"
    assert joshua("--config", str(write(tmp_path, fields, robot_type="so101"))).returncode == 0
    recorded = Dataset.read(tmp_path / "waves")
    assert recorded.features["action"].unit == "lerobot"
    run = joshua("--config", str(write(tmp_path, "operation: DATA_STORE_REPLAY")))
    text = run.stdout + run.stderr
    assert run.returncode == 0, text
    assert "1 episodes are replayed" in text
    assert "/leader " not in text  # a replay takes the leader's place
    lines = [line for line in text.splitlines() if "joint_1  " in line]
    mean_rad = float(lines[0].split("joint_1")[1].split()[0])
    assert mean_rad < 0.2
    picture = (tmp_path / "waves-replay-0.svg").read_text()
    assert f"picture: {tmp_path / 'waves-replay-0.svg'}" in text
    assert picture.count("<polyline") == 4  # goal and position of two joints
    missing = joshua("--config", str(write(tmp_path, "operation: DATA_STORE_REPLAY episodes: [7]")))
    assert missing.returncode != 0
    assert "has no episode 7; allowed: 0 to 0" in missing.stdout + missing.stderr
