"""What a user gets for input that cannot be right: a clear error, exit code 2, and nothing started."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

JOSHUA = Path(sysconfig.get_path("scripts")) / "joshua"
GOOD = """\
general { mode: MODE_TELEOPERATE name: "rig" id: "rig-1" }
robot {
  actions {
    node {
      node_name: "leader" node_id: 1 node_type: PYTHON
      publishers { data_type: JOINT_STATE topic_name: "/leader/joint_states" publish_rate_hz: 50 }
    }
    action_type: ACTION_LEADER
    mock_motor_config { num_motors: 2 position_max: 4095 }
  }
  actions {
    node {
      node_name: "follower" node_id: 2 node_type: PYTHON
      publishers { data_type: JOINT_STATE topic_name: "/follower/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/leader/joint_states" }
    }
    action_type: ACTION_FOLLOWER
    mock_motor_config { num_motors: 2 position_max: 4095 }
  }
}
"""


def joshua(*arguments: str, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(JOSHUA), *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        stdin=subprocess.DEVNULL,
        **options,
    )


@pytest.fixture
def good(tmp_path) -> Path:
    path = tmp_path / "robot.pbtxt"
    path.write_text(GOOD)
    return path


def refused(result: subprocess.CompletedProcess[str]) -> str:
    assert result.returncode == 2, result.stderr
    assert "Traceback" not in result.stderr
    assert result.stderr.isprintable() or "\n" in result.stderr
    return result.stderr


@pytest.mark.parametrize("more", [(), ("--validate-only",)], ids=["launch", "validate"])
class TestFiles:
    """Files that cannot be used, for a launch and for a validation alike."""

    def test_a_missing_file_is_named(self, tmp_path, more):
        text = refused(joshua("--config", str(tmp_path / "robt.pbtxt"), *more))
        assert "robt.pbtxt" in text

    def test_a_directory_is_no_file(self, tmp_path, more):
        assert "directory" in refused(joshua("--config", str(tmp_path), *more)).lower()

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may read every file")
    def test_an_unreadable_file_says_how_to_read_it(self, good, more):
        good.chmod(0)
        assert "permission" in refused(joshua("--config", str(good), *more)).lower()

    def test_a_malformed_file_shows_each_place(self, good, more):
        good.write_text(GOOD.replace("node_id: 2", "node_id: two").replace("MODE_TELEOPERATE", "MODE_TELEOP"))
        text = refused(joshua("--config", str(good), *more))
        assert f"{good}:1:" in text
        assert "MODE_TELEOPERATE" in text
        assert f"{good}:13:" in text

    def test_a_huge_file_is_refused_at_once(self, tmp_path, more):
        path = tmp_path / "huge.pbtxt"
        with path.open("wb") as file:
            file.truncate(100 * 1024 * 1024)
        assert "at most 8 MiB" in refused(joshua("--config", str(path), *more))

    def test_binary_data_is_no_configuration(self, tmp_path, more):
        path = tmp_path / "binary.pbtxt"
        path.write_bytes(bytes(range(256)) * 8)
        refused(joshua("--config", str(path), *more))

    def test_an_empty_file_lacks_the_general_block(self, tmp_path, more):
        path = tmp_path / "empty.pbtxt"
        path.write_text("")
        assert "general" in refused(joshua("--config", str(path), *more))

    def test_an_override_of_an_unknown_field_names_the_nearest(self, good, more):
        text = refused(joshua("--config", str(good), "--set", "general.nmae=x", *more))
        assert "name" in text
        assert "--set" in text


def test_an_unknown_flag_names_the_nearest(good):
    text = refused(joshua("--config", str(good), "--validate-olny"))
    assert "nearest: --validate-only" in text


def test_an_unknown_command_names_the_nearest():
    assert "nearest: plan" in refused(joshua("plam"))


@pytest.mark.parametrize("text", ["-3", "0", "nan", "inf", "soon"])
def test_a_duration_must_be_a_time(good, text):
    assert "expected seconds" in refused(joshua("--config", str(good), f"--duration={text}"))


def test_no_arguments_show_the_help():
    result = joshua()
    assert result.returncode == 2
    assert "--config PATH" in result.stdout


def test_the_version_is_printed():
    result = joshua("--version")
    assert result.returncode == 0
    assert result.stdout.startswith("joshua ")


def test_a_good_file_is_valid(good):
    result = joshua("--config", str(good), "--validate-only")
    assert (result.returncode, result.stdout, result.stderr) == (0, f"{good}: valid\n", "")


def test_findings_for_editors_are_json_on_standard_output(good):
    good.write_text(GOOD.replace("node_id: 2", "node_id: 1"))
    result = joshua("--config", str(good), "--validate-only", "--format", "json")
    assert result.returncode == 2
    found = json.loads(result.stdout)
    findings = found["diagnostics"] if isinstance(found, dict) else found
    assert findings
    assert {"code", "severity", "message"} <= set(findings[0])


def test_validation_needs_no_heavy_library(good):
    program = (
        "import sys\n"
        "from joshua.cli.main import main\n"
        f"code = main(['--config', {str(good)!r}, '--validate-only'])\n"
        "heavy = {'numpy', 'rosbags', 'zenoh', 'cyclonedds', 'rich', 'torch', 'cv2', 'mujoco', 'pandas',\n"
        "         'jax', 'serial', 'importlib.metadata', 'subprocess', 'asyncio'}\n"
        "print(sorted(heavy & set(sys.modules)))\n"
        "sys.exit(code)\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines()[-1] == "[]"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full device")
def test_a_verdict_that_cannot_be_written_is_no_success(good):
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "joshua.cli.main", "--config", str(good), "--validate-only"]
        result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert (result.returncode, result.stderr) == (
        1,
        "joshua: the output cannot be written: No space left on device\n",
    )


def test_the_plan_is_shown_and_nothing_is_started(good):
    result = joshua("plan", "--config", str(good))
    assert result.returncode == 0, result.stderr
    assert "/leader (id 1): ACTION_LEADER" in result.stdout
    assert "subscribes /leader/joint_states [sensor_msgs/msg/JointState]" in result.stdout
    shown = joshua("plan", "--config", str(good), "--format", "json")
    assert [node["name"] for node in json.loads(shown.stdout)["nodes"]] == ["leader", "follower"]


def test_a_plan_without_a_file_says_what_is_missing():
    assert "joshua plan FILE" in refused(joshua("plan"))
