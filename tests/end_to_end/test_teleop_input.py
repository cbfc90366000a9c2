"""Gamepad and keyboard drive an emulated arm by the shipped presets."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from emulators_of_runs import bring_about
from joshua.messages import decode
from joshua.plan import QosProfile, TransportSettings
from joshua.testing.program import JoshuaProgram
from joshua.transport import open_transport
from joshua_emulator import EmulatedGamepad
from processes import descendants_of, title_of
from terminal_run import TerminalRun
from watched import watched_run

JOINT_STATE = "sensor_msgs/msg/JointState"
CONFIGS = Path(__file__).parents[2] / "configs"


class Ear:
    """Hears what an arm says of itself."""

    def __init__(
        self, joshua_run: JoshuaProgram, domain_id: int, topic: str, alive: Callable[[], object]
    ) -> None:
        spec = TransportSettings(domain_id=domain_id, listen_endpoints=(joshua_run.router,))
        self.positions: list[dict[str, float]] = []
        deadline_s = time.monotonic() + 60
        while True:  # the run hosts the router
            assert alive()
            assert time.monotonic() < deadline_s
            self.transport = open_transport(spec)
            if self.transport.connected:
                break
            self.transport.close()
            time.sleep(0.1)
        self.transport.create_node("ear").create_subscription(topic, JOINT_STATE, QosProfile(), self._hear)

    def _hear(self, sample: Any) -> None:
        message = decode(JOINT_STATE, sample.cdr)
        self.positions.append(dict(zip(message.name, map(float, message.position), strict=True)))

    def travelled(self, joint: str) -> float:
        """Distance between the farthest two positions of a joint, in rad."""
        angles = [position[joint] for position in list(self.positions)]
        return max(angles) - min(angles) if angles else 0.0

    def now(self, joint: str) -> float:
        """Newest position of a joint."""
        return self.positions[-1][joint]

    def close(self) -> None:
        self.transport.close()


@pytest.fixture
def in_terminal(joshua_run: JoshuaProgram, tmp_path: Path) -> Iterator[Callable[..., TerminalRun]]:
    """Runs ``joshua`` in a terminal."""
    begun: list[TerminalRun] = []

    def begin(*arguments: str) -> TerminalRun:
        environment = {**joshua_run.environment, "XDG_STATE_HOME": str(tmp_path / "state")}
        router = f'transport.listen_endpoints="{joshua_run.router}"'
        run = TerminalRun([sys.executable, "-m", "joshua.cli.main", *arguments, "--set", router], environment)
        begun.append(run)
        return run

    yield begin
    for run in begun:
        run.close()


def test_the_gamepad_preset_moves_an_emulated_arm(
    joshua_run: JoshuaProgram, joshua_domain_id: int, tmp_path: Path
) -> None:
    joshua_run.environment["XDG_STATE_HOME"] = str(tmp_path / "state")
    preset = str(CONFIGS / "teleop_xbox_controller.pbtxt")
    run = joshua_run.start("--config", preset, "--emulate")
    ear = Ear(joshua_run, joshua_domain_id, "/follower/joint_states", lambda: run.poll() is None)
    try:
        deadline_s = time.monotonic() + 60
        while ear.travelled("shoulder_pan") < 0.1:
            assert time.monotonic() < deadline_s
            time.sleep(0.05)
    finally:
        ear.close()
        output, errors = joshua_run.stop(run)
    assert run.returncode == 0, output + errors
    assert "emulated: gamepad at " in output
    assert "/gamepad: left_x" in errors
    assert "/gamepad: driving is ON" in errors


def test_a_gamepad_that_is_unplugged_and_plugged_in_again(joshua_run: JoshuaProgram, tmp_path: Path) -> None:
    joshua_run.environment["XDG_STATE_HOME"] = str(tmp_path / "state")
    preset = str(CONFIGS / "teleop_xbox_controller.pbtxt")
    command = [sys.executable, "-m", "joshua.cli.main", "--config", preset, "--emulate"]
    with watched_run(command, joshua_run.environment) as run:
        run.wait("nodes ready")
        run.wait("/gamepad: driving is ON")
        bring_about(run.text, "gamepad", "unplug", replug_after_s=1)
        run.wait("gamepad disconnected; the arm holds")
        run.wait("/gamepad: driving is off: no input device")
        run.wait("gamepad reconnected: Emulated Xbox Controller")
        run.process.send_signal(signal.SIGINT)
        code, said = run.end()
    assert code == 0, said


def test_no_gamepad_is_an_error_that_says_what_to_do(joshua_run: JoshuaProgram, tmp_path: Path) -> None:
    text = (CONFIGS / "teleop_xbox_controller.pbtxt").read_text()
    start, end = text.index("    sts3215_config {"), text.index("  perceptions {")
    mock = "    mock_motor_config { num_motors: 6 position_max: 4095 }\n  }\n"
    names = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
    text = text[:start] + mock + text[end:]
    for number, name in enumerate(names, start=1):
        text = text.replace(f'"{name}"', f'"joint_{number}"')
    (tmp_path / "robot.pbtxt").write_text(text)
    result = joshua_run(
        "--config", "robot.pbtxt", "--set", 'robot.perceptions[0].gamepad_config.device="/dev/input/event77"'
    )
    assert result.returncode == 4, result.stdout + result.stderr
    assert "there is no /dev/input/event77; run joshua find-gamepads to list the gamepads" in result.stderr


def test_the_keyboard_preset_moves_an_emulated_arm(
    in_terminal: Callable[..., TerminalRun], joshua_run: JoshuaProgram, joshua_domain_id: int
) -> None:
    run = in_terminal("--config", str(CONFIGS / "teleop_keyboard.pbtxt"), "--emulate")
    run.wait_for("d (+) a (-)  shoulder_pan, +0.5 rad/s", "driving is off: press space", "all 2 nodes ready")
    ear = Ear(joshua_run, joshua_domain_id, "/follower/joint_states", run.look)
    try:
        run.wait(lambda: ear.positions, "the state")
        first = ear.now("shoulder_pan")
        for _ in range(20):  # driving is off
            run.type("d")
            run.look(0.03)
        assert ear.travelled("shoulder_pan") < 0.02
        run.type(" ")
        run.wait_for("driving is ON")
        run.wait(lambda: ear.now("shoulder_pan") > first + 0.3, "the motion", keys="d")
        run.wait(lambda: "[driving ON: shoulder_pan +]" in run.text, "the status", keys="d")
        run.wait(lambda: ear.now("shoulder_pan") < first + 0.1, "the way back", keys="a")
        assert ear.travelled("gripper") < 0.02
    finally:
        ear.close()
    run.type("?")
    run.wait_for("?: shows this")
    run.type("\x03")
    assert run.end() == 0, run.text
    assert "stopped by SIGINT" in run.text
    assert run.attributes() == run.first


def test_a_killed_keyboard_node_leaves_the_terminal_as_it_was(
    in_terminal: Callable[..., TerminalRun],
) -> None:
    run = in_terminal("--config", str(CONFIGS / "teleop_keyboard.pbtxt"), "--emulate")
    run.wait_for("driving is off: press space", "all 2 nodes ready")
    assert run.attributes() != run.first
    (node,) = (number for number in descendants_of(run.process_id) if title_of(number) == "keyboard")
    os.kill(node, signal.SIGKILL)
    run.wait(lambda: run.attributes() == run.first, "the terminal as it was")
    run.wait_for("driving is off: press space")  # it starts again
    run.wait(lambda: run.attributes() != run.first, "the terminal as the new node wants it")
    run.type("\x03")
    run.end()
    assert run.attributes() == run.first


def test_keys_of_a_terminal_that_reports_releases(in_terminal: Callable[..., TerminalRun]) -> None:
    run = in_terminal("--config", str(CONFIGS / "teleop_keyboard.pbtxt"), "--emulate")
    run.wait_for("\x1b[?u")
    run.type("\x1b[?0u")
    run.wait_for("\x1b[>15u\x1b[?1004h", "driving is off: press space", "all 2 nodes ready")
    run.type("\x1b[32u\x1b[32;1:3u")
    run.wait_for("driving is ON")
    run.type("\x1b[100u")
    run.wait_for("[driving ON: shoulder_pan +]")
    run.type("\x1b[100;1:3u")
    run.wait_for("[driving ON]")
    run.type("\x1b[99;5u")
    assert run.end() == 0, run.text
    assert "\x1b[<u\x1b[?1004l" in run.text
    assert run.attributes() == run.first


def test_a_terminal_that_is_closed_ends_the_run_in_good_order(
    in_terminal: Callable[..., TerminalRun], joshua_run: JoshuaProgram
) -> None:
    run = in_terminal("--config", str(CONFIGS / "teleop_keyboard.pbtxt"), "--emulate")
    run.wait_for("driving is off: press space", "all 2 nodes ready")
    run.type(" ")
    run.wait_for("driving is ON")
    run.hang_up()
    log = "".join(path.read_text() for path in (joshua_run.folder / "log").glob("*.jsonl"))
    assert "stopped by SIGHUP" in log, log[-3000:]


def test_a_keyboard_needs_a_terminal(joshua_run: JoshuaProgram, tmp_path: Path) -> None:
    environment = {**joshua_run.environment, "XDG_STATE_HOME": str(tmp_path / "state")}
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "joshua.cli.main",
            "--config",
            str(CONFIGS / "teleop_keyboard.pbtxt"),
            "--emulate",
        ],
        env=environment,
        capture_output=True,
        text=True,
        start_new_session=True,
        stdin=subprocess.DEVNULL,
        timeout=90,
    )
    assert done.returncode == 4, done.stdout + done.stderr
    assert "there is no terminal to read keys from" in done.stderr
    assert "ssh -t" in done.stderr


TAKE_OVER = """
general { mode: MODE_TELEOPERATE id: "bench" }
robot {
  actions {
    node {
      node_name: "leader" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/command" publish_rate_hz: 50 }
    }
    action_type: ACTION_LEADER
    mock_motor_config { num_motors: 1 position_max: 4095 }
  }
  actions {
    node {
      node_name: "follower" node_id: 2
      publishers { data_type: JOINT_STATE topic_name: "/follower/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/command" }
    }
    action_type: ACTION_FOLLOWER
    mock_motor_config { num_motors: 1 position_max: 4095 }
  }
  perceptions {
    node {
      node_name: "gamepad" node_id: 3
      publishers { data_type: JOINT_STATE topic_name: "/command" publish_rate_hz: 50 override: true }
      subscriptions { data_type: JOINT_STATE topic_name: "/follower/joint_states" }
    }
    perception_type: PERCEPTION_GAMEPAD
    gamepad_config {
      device: "DEVICE"
      dead_man_button: "left_bumper"
      release_button: "back"
      controls { positive: "left_x" joint: "joint_1" speed_rad_s: 1.5 }
    }
  }
}
"""


def test_a_person_takes_over_and_gives_back(
    joshua_run: JoshuaProgram, joshua_domain_id: int, tmp_path: Path
) -> None:
    with EmulatedGamepad() as pad:
        (tmp_path / "robot.pbtxt").write_text(TAKE_OVER.replace("DEVICE", pad.device))
        run = joshua_run.start("--config", "robot.pbtxt")
        ear = Ear(joshua_run, joshua_domain_id, "/follower/joint_states", lambda: run.poll() is None)

        def wait(condition: Callable[[], object], what: str) -> None:
            deadline_s = time.monotonic() + 60
            while not condition():
                assert time.monotonic() < deadline_s, what
                time.sleep(0.02)

        try:
            wait(lambda: pad.ask("state")["clients"], "the driver")
            wait(lambda: len(ear.positions) > 25, "the state")
            pad.set(left_bumper=1)
            time.sleep(0.3)
            pad.set(left_x=1.0)
            wait(lambda: ear.now("joint_1") > 0.5, "the motion")
            pad.set(left_x=0.0, left_bumper=0)
            time.sleep(1.0)
            assert ear.now("joint_1") > 0.5, "the arm holds"
            pad.set(back=1)
            wait(lambda: abs(ear.now("joint_1")) < 0.05, "the way back to the leader")
        finally:
            ear.close()
            output, errors = joshua_run.stop(run)
    said = output + errors
    assert run.returncode == 0, said
    assert said.count("/gamepad overrides: commands of other nodes are ignored") == 1
    assert said.count("the override /gamepad stopped publishing: the joints hold their position") == 1
    assert said.count("the override /gamepad is released: other commanders have control again") == 1


KEYBOARD_JOY = """
general { mode: MODE_TELEOPERATE id: "bench" }
robot {
  actions {
    node {
      node_name: "arm" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/command" }
    }
    action_type: ACTION_SINGLE
    mock_motor_config { num_motors: 2 position_max: 4095 }
  }
  perceptions {
    node {
      node_name: "keyboard" node_id: 2
      publishers { data_type: JOINT_STATE topic_name: "/command" publish_rate_hz: 50 }
      publishers { data_type: JOY topic_name: "/joy" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/arm/joint_states" }
    }
    perception_type: PERCEPTION_KEYBOARD
    keyboard_config {
      controls { positive: "up" negative: "down" joint: "joint_1" speed_rad_s: 1 }
      controls { positive: "x" joint: "joint_2" speed_rad_s: -1 }
    }
  }
}
"""


def test_the_keys_as_a_joy_and_arrows_without_a_switch(
    in_terminal: Callable[..., TerminalRun], joshua_run: JoshuaProgram, joshua_domain_id: int, tmp_path: Path
) -> None:
    (tmp_path / "robot.pbtxt").write_text(KEYBOARD_JOY)
    run = in_terminal("--config", str(tmp_path / "robot.pbtxt"))
    run.wait_for("all 2 nodes ready")
    joys: list[tuple[list[float], list[int]]] = []

    def hear(sample: Any) -> None:
        message = decode("sensor_msgs/msg/Joy", sample.cdr)
        joys.append((list(map(float, message.axes)), list(map(int, message.buttons))))

    ear = Ear(joshua_run, joshua_domain_id, "/arm/joint_states", run.look)
    try:
        node = ear.transport.create_node("second_ear")
        node.create_subscription("/joy", "sensor_msgs/msg/Joy", QosProfile(), hear)
        run.wait(lambda: joys and ear.positions, "both topics")
        assert joys[-1] == ([0.0, 0.0], [0, 0, 0])
        run.wait(lambda: joys[-1] == ([-1.0, 0.0], [0, 1, 0]), "the arrow", keys="\x1b[B")
        run.wait(lambda: ear.now("joint_1") < -0.1, "the motion", keys="\x1b[B")
        run.wait(lambda: joys[-1] == ([0.0, 1.0], [0, 0, 1]), "the letter", keys="x")
        run.wait(lambda: ear.now("joint_2") < -0.1, "the motion", keys="x")
        run.wait(lambda: joys[-1] == ([0.0, 0.0], [0, 0, 0]), "the release")
    finally:
        ear.close()
    run.type("\x03")
    assert run.end() == 0, run.text
