"""Messages survive their encoding; anything else is refused."""

from __future__ import annotations

import math

import pytest
from joshua.ipc import messages as ipc
from joshua.ipc.frames import FrameError
from joshua.plan import (
    ActuatorFacts,
    CheckResult,
    Commander,
    JointRange,
    NodeKind,
    NodeReport,
    NodeSpec,
    OnStale,
    QosProfile,
    RunFacts,
    SafeStop,
    TimerReport,
    TopicReport,
    TopicSpec,
    TransportSettings,
)

SPEC = NodeSpec(
    name="arm",
    namespace="/left",
    kind=NodeKind.ACTUATOR,
    behaviour="a:B",
    implementation="c:D",
    settings={"ports": [1, 2.5, None, "ä"], "velocity_max_rad_s": [math.inf, 1.0]},
    facts=ActuatorFacts(
        joints=(JointRange("pan", -1.0, math.inf),),
        commanders=(
            Commander("/leader", "/leader/joint_states", (JointRange("pan", 0.0, 1.0),)),
            Commander("/gamepad", "/leader/joint_states", override=True),
        ),
        external=("/moveit/joint_commands",),
        safe_stop=SafeStop("a:stop", "PARK_THEN_RELEASE", (0.5,), 5.0),
        on_stale=OnStale("RELEASE", 1.0, (), 5.0),
        simulation={"model_path": "arm.xml"},
        stop_timeout_s=11.0,
        run=RunFacts(log="/log", domain_id=7),
    ),
    publishers=(TopicSpec(name="/x", type_name="std_msgs/msg/String", qos=QosProfile(depth=3), rate_hz=5.0),),
)
TIMER = TimerReport(
    name="t",
    period_s=0.01,
    achieved_hz=math.inf,
    jitter_p50_s=0.0,
    jitter_p99_s=0.0,
    jitter_p999_s=0.0,
    ticks=3,
    overruns=0,
)
TOPIC = TopicReport(name="/x", type_name="std_msgs/msg/String", is_publisher=True, count=1, rate_hz=2.0)

TO_CHILD = [
    ipc.Start(nodes=(SPEC,), transport=TransportSettings(domain_id=7)),
    ipc.Activate(),
    ipc.Stop(reason="Ctrl-C", urgent=True),
]
TO_SUPERVISOR = [
    ipc.Hello(version="1", process_id=2, python="3.10.1"),
    ipc.Step(node="/a", step="configured"),
    ipc.Said(kind="waiting", node="/a", text="motor 3"),
    ipc.Heartbeat(node="/a", stamp_ns=5, threads=(ipc.ThreadAge(name="r", age_s=0.1, limit_s=2.0),)),
    ipc.Log(node="/a", time_ns=1, level=30, text="ä\n"),
    ipc.Topics(node="/a", stamp_ns=1, published={"/x": 3}, received={}),
    ipc.FirstMessage(node="/a", topic="/x", stamp_ns=1),
    ipc.Said(kind="warning", node="/a", text="w"),
    ipc.Failure(node="/a", step="configure", exit_code=4, text="t", traceback="b", unexpected=False),
    ipc.Said(kind="stop-run", node="/a", text="done"),
    ipc.Report(
        report=NodeReport(
            full_name="/a",
            state="stopped",
            topics=(TOPIC,),
            timers=(TIMER,),
            checks=(CheckResult(check="c", passed=True),),
        )
    ),
]


@pytest.mark.parametrize("message", TO_CHILD, ids=lambda message: message.kind)
def test_messages_to_a_child_survive(message):
    assert ipc.decode_for_child(ipc.encode(message)) == message


@pytest.mark.parametrize("message", TO_SUPERVISOR, ids=lambda message: message.kind)
def test_messages_to_the_supervisor_survive(message):
    assert ipc.decode_for_supervisor(ipc.encode(message)) == message


@pytest.mark.parametrize("payload", [b"", b"{}", b"[1]", b'{"kind": "start"}', b'{"kind": "x"}', b"\xff"])
def test_anything_else_is_refused(payload):
    with pytest.raises(FrameError, match="not a message of this protocol"):
        ipc.decode_for_child(payload)


def test_a_message_for_the_other_side_is_refused():
    with pytest.raises(FrameError):
        ipc.decode_for_child(ipc.encode(TO_SUPERVISOR[0]))
