"""How many signals kill the nodes, and what each of them says."""

from __future__ import annotations

import signal

import pytest
from joshua.plan import ActuatorFacts, NodeKind, NodeSpec, SafeStop, TopicSpec
from joshua.supervisor.repeated_stop import REPEAT_S, Press, RepeatedStop, StopNotice

COMMANDS = (TopicSpec(name="/commands", type_name="sensor_msgs/msg/JointState"),)


def arm(name: str, state: str, *, commanded: bool = True, timeout_s: float = 5.0) -> NodeSpec:
    return NodeSpec(
        name=name,
        kind=NodeKind.ACTUATOR,
        behaviour="unused",
        implementation="",
        subscriptions=COMMANDS if commanded else (),
        facts=ActuatorFacts(safe_state=state, safe_stop=SafeStop("unused", state, (), timeout_s)),
    )


@pytest.mark.parametrize(
    ("presses", "expected"),
    [
        ([(signal.SIGINT, 0.0)], [Press.STOP]),
        ([(signal.SIGINT, 0.0), (signal.SIGINT, 0.6)], [Press.STOP, Press.AGAIN]),
        (
            [(signal.SIGINT, 0.0), (signal.SIGINT, 60.0), (signal.SIGTERM, 60.0 + REPEAT_S)],
            [Press.STOP, Press.AGAIN, Press.FORCE],
        ),
        (
            [(signal.SIGINT, 0.0), (signal.SIGINT, 1.0), (signal.SIGINT, 3.1), (signal.SIGINT, 5.2)],
            [Press.STOP, Press.AGAIN, Press.AGAIN, Press.AGAIN],
        ),
        (
            [(signal.SIGHUP, 0.0), (signal.SIGHUP, 0.5), (signal.SIGHUP, 1.0)],
            [Press.STOP, Press.NOTHING, Press.NOTHING],
        ),
    ],
    ids=["once", "twice", "three times", "slowly", "closed terminal"],
)
def test_only_two_further_signals_close_together_kill(presses, expected):
    repeated = RepeatedStop()

    assert [repeated.press(number, now_s) for number, now_s in presses] == expected


@pytest.mark.parametrize(
    ("specs", "energised", "first"),
    [
        (
            [arm("a", "PARK_THEN_RELEASE", timeout_s=12.0), arm("b", "RELEASE")],
            True,
            "parking /a, up to 12 s; Ctrl-C twice more within 2 s stops at once and drops /a",
        ),
        (
            [arm("a", "PARK_THEN_RELEASE"), arm("b", "PARK_THEN_RELEASE"), arm("c", "HOLD")],
            True,
            "parking /a, /b, up to 5 s; Ctrl-C twice more within 2 s stops at once and drops /a, /b, "
            "while /c holds",
        ),
        (
            [arm("a", "HOLD"), arm("b", "HOLD")],
            True,
            "stopping, up to 9 s; Ctrl-C twice more within 2 s kills the nodes at once, while /a, /b hold",
        ),
        (
            [arm("a", "RELEASE")],
            True,
            "stopping, up to 9 s; Ctrl-C twice more within 2 s kills the nodes at once",
        ),
        (
            [arm("a", "PARK_THEN_RELEASE")],
            False,
            "stopping, up to 9 s; Ctrl-C twice more within 2 s kills the nodes at once",
        ),
        (
            [arm("a", "PARK_THEN_RELEASE", commanded=False)],
            True,
            "stopping, up to 9 s; Ctrl-C twice more within 2 s kills the nodes at once",
        ),
    ],
    ids=["park", "park and hold", "hold", "release", "before torque", "never torque"],
)
def test_the_first_signal_says_what_a_repetition_does(specs, energised, first):
    assert StopNotice(specs, 9.0, energised=energised).first(signal.SIGINT) == first


def test_a_further_signal_says_how_many_are_left():
    notice = StopNotice([arm("a", "PARK_THEN_RELEASE")], 9.0, energised=True)

    assert notice.again(signal.SIGTERM) == "SIGTERM once more within 2 s stops at once and drops /a"
