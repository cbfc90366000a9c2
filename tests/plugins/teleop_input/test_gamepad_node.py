"""The node of a gamepad: what an emulated one makes an arm do."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

import pytest
from gamepads import COMMANDS, STATE, STICK, gamepad_settings, node_spec, wait_until
from joshua.devices.errors import DeviceError
from joshua.messages.make import joint_state
from joshua.testing.recording_context import RecordingContext
from joshua_emulator import EmulatedGamepad
from joshua_teleop_input import input_node, jog, remote_device
from joshua_teleop_input.gamepad_node import GamepadNode
from joshua_teleop_input.input_node import READER_LIMIT_S
from joshua_teleop_input.remote_device import SILENCE_LIMIT_S, RemoteDevice

LIMITS = ((remote_device, "LOST_AFTER_S"), (jog, "STATE_LIMIT_S"), (input_node, "READER_LIMIT_S"))
Start = Callable[..., tuple[GamepadNode, RecordingContext]]
DEAD_MAN = 'dead_man_button: "left_bumper" ' + STICK


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets nothing stop because this machine holds this process up; tests of a limit bring it back."""
    monkeypatch.setattr(RemoteDevice, "silence_limit_s", 60.0)
    for module, name in LIMITS:
        monkeypatch.setattr(module, name, 60.0)


def hear(context: RecordingContext, pan: float = 0.2) -> None:
    context.receive(STATE, joint_state(["pan", "lift"], [pan, 0.0]))


def sent(context: RecordingContext) -> list[float]:
    return [float(message.position[0]) for message in context.publishers[COMMANDS].messages]


def begin(
    start: Start, pad: EmulatedGamepad, block: str, *, joy: bool = False
) -> tuple[GamepadNode, RecordingContext]:
    node, context = start(gamepad_settings(f'device: "{pad.device}" {block}'), joy=joy)
    hear(context)
    return node, context


def press_and_wait(node: GamepadNode, pad: EmulatedGamepad, **values: float) -> None:
    """Lets the driver see everything released, then the values."""
    wait_until(lambda: "no input device" not in node.drive.gate.describe(), "the first state")
    pad.set(**values)


def test_a_command_leaves_with_the_event(start: Start, pad: EmulatedGamepad) -> None:
    node, context = begin(start, pad, DEAD_MAN)
    press_and_wait(node, pad, left_bumper=1)
    wait_until(lambda: sent(context), "a command")
    assert sent(context) == [pytest.approx(0.2)], "no timer runs in this test"
    pad.set(left_x=1.0)
    wait_until(lambda: len(sent(context)) == 2, "a second command")
    assert sent(context)[1] == pytest.approx(0.22)
    pad.set(left_x=0.0)
    wait_until(lambda: len(sent(context)) == 3, "a third command")
    assert sent(context)[2] == sent(context)[1]


def test_the_goal_goes_on_at_the_rate_of_the_topic(start: Start, pad: EmulatedGamepad) -> None:
    node, context = begin(start, pad, DEAD_MAN)
    press_and_wait(node, pad, left_bumper=1)
    wait_until(lambda: node.drive.gate.active)
    pad.set(left_x=1.0)
    wait_until(lambda: node.drive.moving)
    hear(context)
    time.sleep(0.02)
    context.tick("commands")
    assert sent(context)[-1] > sent(context)[0]
    assert context.publishers[COMMANDS].messages[-1].name == ["pan"]


def test_the_release_button_returns_control_once(start: Start, pad: EmulatedGamepad) -> None:
    node, context = begin(start, pad, DEAD_MAN + ' release_button: "back"')
    press_and_wait(node, pad, left_bumper=1)
    wait_until(lambda: sent(context), "a command")
    pad.set(back=1)
    messages = context.publishers[COMMANDS].messages
    wait_until(lambda: not len(messages[-1].name), "the message without joints")
    assert not node.drive.gate.active, "the held dead-man button must be released first"
    count = len(messages)
    hear(context)
    context.tick("commands", 5)
    pad.set(back=0, left_x=1.0)
    wait_until(lambda: not node.drive.returns_control)
    context.tick("commands", 5)
    assert len(messages) == count
    pad.set(left_bumper=0, left_x=0.0)
    wait_until(lambda: node.drive.gate._dead_man_was_up, "the release of the dead-man button")
    hear(context)
    pad.set(left_bumper=1)
    wait_until(lambda: len(messages) > count, "driving is on again")


def test_nothing_is_sent_once_the_dead_man_is_released(start: Start, pad: EmulatedGamepad) -> None:
    node, context = begin(start, pad, DEAD_MAN)
    press_and_wait(node, pad, left_bumper=1, left_x=1.0)
    wait_until(lambda: sent(context))
    pad.set(left_bumper=0)
    wait_until(lambda: not node.drive.gate.active)
    count = len(sent(context))
    hear(context)
    context.tick("commands", 5)
    assert len(sent(context)) == count


def test_an_unplugged_gamepad_stops_and_needs_a_fresh_start(start: Start, pad: EmulatedGamepad) -> None:
    node, context = begin(start, pad, DEAD_MAN, joy=True)
    press_and_wait(node, pad, left_bumper=1, left_x=1.0)
    wait_until(lambda: sent(context))
    pad.fault("unplug", replug_after_s=0.5)
    wait_until(lambda: not node.drive.gate.active, "the stop")
    count = len(sent(context))
    wait_until(lambda: context.publishers["/joy"].messages, "the last Joy")
    last = context.publishers["/joy"].messages[-1]
    assert not any(last.axes)
    assert not any(last.buttons)
    wait_until(lambda: node.gamepad.connected and node._reading is not None, "the reconnection")
    hear(context)
    context.tick("commands", 3)
    assert len(sent(context)) == count, "bumper and stick are still held from before"
    pad.set(left_bumper=0, left_x=0)
    wait_until(lambda: node._reading is not None and not node._reading.data.pressed("left_bumper"))
    wait_until(lambda: node.drive.gate.describe().startswith("off: hold"))
    pad.set(left_bumper=1)
    wait_until(lambda: len(sent(context)) > count, "driving anew")


def test_a_lost_gamepad_publishes_no_joy(start: Start, pad: EmulatedGamepad) -> None:
    node, context = begin(start, pad, STICK, joy=True)
    wait_until(lambda: node._reading is not None)
    context.tick("joy")
    assert len(context.publishers["/joy"].messages) == 1
    pad.fault("unplug")
    wait_until(lambda: not node.gamepad.connected)
    count = len(context.publishers["/joy"].messages)
    context.tick("joy", 3)
    assert len(context.publishers["/joy"].messages) == count


def test_a_silent_gamepad_stops(
    start: Start, pad: EmulatedGamepad, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    node, context = begin(start, pad, DEAD_MAN)
    press_and_wait(node, pad, left_bumper=1, left_x=1.0)
    wait_until(lambda: sent(context))
    monkeypatch.setattr(RemoteDevice, "silence_limit_s", SILENCE_LIMIT_S)
    pad.fault("stall")
    wait_until(lambda: not node.drive.gate.active, "the stop")
    monkeypatch.setattr(RemoteDevice, "silence_limit_s", 60.0)
    pad.ask("clear_faults")
    wait_until(lambda: node.drive.gate.describe().startswith("off: hold"), "a sign of life")
    assert not node.drive.gate.active
    assert "all controls count as released" in caplog.text


def test_a_sender_that_is_too_slow_moves_nothing(
    start: Start, pad: EmulatedGamepad, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, context = begin(start, pad, DEAD_MAN)
    press_and_wait(node, pad, left_bumper=1, left_x=1.0)
    wait_until(lambda: sent(context))
    monkeypatch.setattr(RemoteDevice, "silence_limit_s", SILENCE_LIMIT_S)
    pad.fault("rate", 1)
    wait_until(lambda: not node.drive.gate.active, "the stop")
    assert node.drive.moving == {}


def test_a_reader_that_hangs_stops_everything(
    start: Start, pad: EmulatedGamepad, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    node, context = begin(start, pad, DEAD_MAN)
    press_and_wait(node, pad, left_bumper=1, left_x=1.0)
    wait_until(lambda: sent(context))
    hangs, release = threading.Event(), threading.Event()

    def hang(_: float) -> None:
        hangs.set()
        release.wait(60)

    monkeypatch.setattr(node.gamepad, "read", hang)
    assert hangs.wait(60)
    monkeypatch.setattr(input_node, "READER_LIMIT_S", READER_LIMIT_S)
    time.sleep(READER_LIMIT_S + 0.1)
    hear(context)
    context.tick("commands")
    assert not node.drive.gate.active
    assert "the node is not reading the device" in caplog.text
    release.set()


def test_diagnostics_say_whether_the_gamepad_is_there(start: Start, pad: EmulatedGamepad) -> None:
    node, context = begin(start, pad, DEAD_MAN)
    context.tick("diagnostics")
    pad.fault("unplug")
    wait_until(lambda: not node.gamepad.connected)
    context.tick("diagnostics")
    good, bad = (message.status[0] for message in context.publishers["/diagnostics"].messages)
    assert (good.level, good.message, good.name) == (0, "in order", "gamepad")
    assert (bad.level, bad.message) == (2, "gamepad disconnected")
    assert bad.values[0].value == "off: no input device"


def test_without_a_state_of_the_arm_nothing_is_sent(start: Start, pad: EmulatedGamepad) -> None:
    node, context = start(gamepad_settings(f'device: "{pad.device}" {DEAD_MAN}'))
    press_and_wait(node, pad, left_bumper=1, left_x=1.0)
    wait_until(lambda: node.drive.gate.active)
    context.tick("commands", 5)
    context.tick("help")
    time.sleep(0.6)
    context.tick("help")
    assert sent(context) == []
    assert context.shown == "driving waiting for a joint state of the arm"


def test_a_state_without_the_joint_names_those_that_it_has(start: Start, pad: EmulatedGamepad) -> None:
    _, context = start(gamepad_settings(f'device: "{pad.device}" {STICK}'))
    context.receive(STATE, joint_state(["pann", "lift"], [0.0, 0.0]))
    assert context.failures == [
        "no joint is named pan: the joint state received has pann, lift; correct joint in controls"
    ]


def test_a_joint_that_the_plan_does_not_know(pad: EmulatedGamepad) -> None:
    settings = gamepad_settings(
        f'device: "{pad.device}" controls {{ positive: "left_x" joint: "lfit" speed_rad_s: 1 }}'
    )
    with pytest.raises(DeviceError, match=r"/gamepad: no joint is named 'lfit'; the actuator has lift, pan"):
        GamepadNode(RecordingContext(node_spec(settings))).configure()


def test_the_screen_says_what_moves_what_and_whether_it_is_on(
    start: Start, pad: EmulatedGamepad, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    node, context = begin(start, pad, 'enable_button: "start" ' + DEAD_MAN)
    assert "left_x  pan, +1 rad/s" in caplog.text
    assert "left_bumper: nothing moves unless it is held" in caplog.text
    wait_until(lambda: "no input device" not in node.drive.gate.describe(), "the first state")
    context.tick("help")
    assert context.shown == "driving off: press start to switch driving on"
    pad.set(start=1, left_bumper=1)
    wait_until(lambda: node.drive.gate.active)
    pad.set(left_x=-1.0)
    wait_until(lambda: node.drive.moving)
    context.tick("help")
    assert context.shown == "driving ON: pan -"


def test_a_test_says_what_was_there_and_what_was_tried(start: Start, pad: EmulatedGamepad) -> None:
    node, context = begin(start, pad, STICK, joy=True)
    press_and_wait(node, pad, a=1, left_x=-1.0)
    wait_until(lambda: len(node._moved) == 2)
    for _ in range(10):
        context.tick("joy")
        time.sleep(0.02)
    rows = {check: (passed, measured) for check, passed, measured in node.test_results()}
    assert rows["gamepad"][0]
    assert rows["gamepad"][1].startswith("Emulated Xbox Controller (")
    assert rows["moved in the test"] == (True, "a, left_x")
    assert "of 50 Hz" in rows["rate of /joy"][1]
    pad.fault("unplug")
    wait_until(lambda: node._losses)
    assert node.test_results()[0][1] is False
    assert node.test_results()[0][2].endswith("lost 1 times")
