"""FollowJointTrajectory as a client of ROS 2 uses it: services and topics of the action, over Zenoh."""

from __future__ import annotations

import json
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joshua.messages import decode, encode, message_class, type_hash
from joshua.messages.fields import build
from joshua.plan import QosProfile, TransportSettings
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from joshua.transport import NodeHandle, TransportError, open_transport
from joshua_services.action_server import ABORTED, CANCELED, EXECUTING, SUCCEEDED, UNKNOWN
from joshua_services.action_types import ACTION, CANCEL, define_action, define_types
from joshua_services.values import flat, nested, parameter_value, value_of

ROBOT = """
general { mode: MODE_TELEOPERATE name: "bench" id: "bench-002" }
robot {
  actions {
    node { node_name: "arm" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_TRAJECTORY topic_name: "/arm/trajectory" external: true } }
    action_type: ACTION_FOLLOWER mock_motor_config { num_motors: 2 position_max: 4095 }
  }
}
"""
ARM = "/arm/follow_joint_trajectory/_action"
JOINTS = ("joint_1", "joint_2")
LOG = "rcl_interfaces/msg/Log"
STATUS = "action_msgs/msg/GoalStatusArray"


class Client:
    """One client of the action."""

    port: str
    domain_id: int

    def __init__(self, node: NodeHandle) -> None:
        self.node = node
        self.feedback: list[Any] = []
        self.states: list[list[tuple[bytes, int]]] = []
        kind = f"{ACTION}_FeedbackMessage"
        node.create_subscription(
            f"{ARM}/feedback",
            kind,
            QosProfile(),
            lambda it: self.feedback.append(decode(kind, it.cdr).feedback),
        )
        latched = QosProfile(durability="TRANSIENT_LOCAL", depth=1)
        node.create_subscription(f"{ARM}/status", STATUS, latched, self._take_status)
        self.logged: list[str] = []
        node.create_subscription("/rosout", LOG, QosProfile(), self._take_log)

    def _take_feedback(self, sample: Any) -> None:
        self.feedback.append(decode(f"{ACTION}_FeedbackMessage", sample.cdr).feedback)

    def _take_log(self, sample: Any) -> None:
        self.logged.append(decode(LOG, sample.cdr).msg)

    def _take_status(self, sample: Any) -> None:
        listed = decode(STATUS, sample.cdr).status_list
        self.states.append([(bytes(it.goal_info.goal_id.uuid), int(it.status)) for it in listed])

    def call(self, name: str, kind: str, values: dict[str, Any]) -> Any:
        request = bytes(encode(build(f"{kind}_Request", values)))
        for _ in range(50):  # a queryable may become known after its token
            try:
                return decode(
                    f"{kind}_Response", self.node.call_service(f"{ARM}/{name}", kind, request, 20.0)
                )
            except TransportError:
                time.sleep(0.2)
        raise AssertionError(f"{name} is not there")

    def send(
        self, *points: tuple[float, list[float]], joints: tuple[str, ...] = JOINTS, **more: Any
    ) -> tuple[bytes, bool]:
        identifier = uuid.uuid4().bytes
        listed = [
            {"positions": positions, "time_from_start": {"sec": int(at), "nanosec": int(at % 1 * 1e9)}}
            for at, positions in points
        ]
        trajectory = {"joint_names": list(joints), "points": listed}
        goal = {"goal_id": {"uuid": list(identifier)}, "goal": {"trajectory": trajectory, **more}}
        return identifier, bool(self.call("send_goal", f"{ACTION}_SendGoal", goal).accepted)

    def result(self, identifier: bytes) -> tuple[int, int, str]:
        answer = self.call("get_result", f"{ACTION}_GetResult", {"goal_id": {"uuid": list(identifier)}})
        return int(answer.status), int(answer.result.error_code), str(answer.result.error_string)

    def cancel(self, identifier: bytes = bytes(16)) -> tuple[int, int]:
        info = {"goal_info": {"goal_id": {"uuid": list(identifier)}}}
        answer = self.call("cancel_goal", CANCEL, info)
        return int(answer.return_code), len(answer.goals_canceling)


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    folder = tmp_path_factory.mktemp("action")
    Path(folder, "robot.pbtxt").write_text(ROBOT, encoding="utf-8")
    define_types()
    with reserved_domain() as domain_id:
        joshua = JoshuaProgram(folder, domain_id)
        run = joshua.start("--config", "robot.pbtxt")
        assert run.stdout is not None
        assert any(" ready after " in line for line in run.stdout)
        transport = open_transport(TransportSettings(domain_id=domain_id, listen_endpoints=(joshua.router,)))
        client = Client(transport.create_node("moveit"))
        client.port, client.domain_id = joshua.router.rpartition(":")[2], domain_id
        yield client
        transport.close()
        joshua.close()


def until(condition: Callable[[], Any]) -> Any:
    end_s = time.monotonic() + 60
    while not (value := condition()):
        assert time.monotonic() < end_s
        time.sleep(0.01)
    return value


def test_the_types_have_the_hashes_of_ros_2() -> None:
    define_types()
    # of control_msgs and test_msgs as ROS 2 Jazzy generates them
    assert type_hash(f"{ACTION}_SendGoal")[7:23] == "b13789dddc325a7a"
    assert type_hash(f"{ACTION}_GetResult")[7:23] == "e3ceb38e3e1867c8"
    assert type_hash(f"{ACTION}_Feedback")[7:23] == "3fd0aaecf7172512"
    fibonacci = "test_msgs/action/Fibonacci"
    define_action(fibonacci, "int32 order", "int32[] sequence", "int32[] sequence")
    assert type_hash(f"{fibonacci}_SendGoal")[7:23] == "d807633803e38e16"
    assert type_hash(f"{fibonacci}_FeedbackMessage")[7:23] == "37487bae8cea3583"


def test_a_goal_moves_the_arm_and_succeeds(client: Client) -> None:
    identifier, accepted = client.send((0.3, [0.1, 0.0]), (0.6, [0.2, -0.1]))
    assert accepted
    assert client.result(identifier) == (SUCCEEDED, 0, "")
    last = until(lambda: client.feedback)[-1]
    assert list(last.joint_names) == ["joint_1", "joint_2"]
    assert np.allclose(last.actual.positions, [0.2, -0.1], atol=0.1)
    assert np.allclose(last.error.positions, last.desired.positions - last.actual.positions)
    until(lambda: (identifier, SUCCEEDED) in client.states[-1])
    assert any((identifier, EXECUTING) in states for states in client.states)
    # a result can be asked for again
    assert client.result(identifier)[0] == SUCCEEDED


def test_an_independent_client_moves_the_arm(client: Client) -> None:
    program = Path(__file__).parent / "programs" / "sdk_trajectory.py"
    hashes = (type_hash(f"{ACTION}_{name}") for name in ("SendGoal", "GetResult"))
    place = (client.port, str(client.domain_id), "/arm/follow_joint_trajectory")
    done = subprocess.run(
        [sys.executable, str(program), *place, *hashes], capture_output=True, text=True, timeout=100
    )
    said = [json.loads(line) for line in done.stdout.splitlines()]
    assert said == [{"accepted": True}, {"status": SUCCEEDED, "error": 0, "text": ""}], done.stderr
    last = until(lambda: client.feedback and client.feedback[-1])
    assert list(last.joint_names) == list(JOINTS)
    assert last.desired.positions[0] == pytest.approx(0.3, abs=0.05)


def test_a_goal_is_cancelled_and_the_arm_stops(client: Client) -> None:
    identifier, accepted = client.send((20.0, [1.5, 0.0]))
    assert accepted
    until(lambda: client.states and (identifier, EXECUTING) in client.states[-1])
    assert client.cancel(identifier) == (0, 1)
    assert client.result(identifier) == (CANCELED, 0, "the joints were stopped")
    assert client.cancel(identifier) == (3, 0)
    assert client.cancel(uuid.uuid4().bytes) == (2, 0)
    assert client.cancel() == (0, 0)


def test_a_newer_goal_replaces_the_one_that_runs(client: Client) -> None:
    first, _ = client.send((20.0, [1.0, 0.0]))
    second, accepted = client.send((0.2, [0.1, 0.0]))
    assert accepted
    assert client.result(first) == (ABORTED, -1, "a newer goal replaced this one")
    assert client.result(second)[0] == SUCCEEDED


@pytest.mark.parametrize(
    ("points", "field", "tolerance", "expected"),
    [
        ([(0.1, [1.5, 0.0])], "path_tolerance", 0.01, -4),
        ([(0.1, [1.4, 0.0])], "goal_tolerance", 0.001, -5),
    ],
)
def test_a_joint_out_of_tolerance_aborts(
    client: Client, points: Any, field: str, tolerance: float, expected: int
) -> None:
    limits: Any = [{"name": "joint_1", "position": tolerance}]
    leeway: Any = {"sec": 0, "nanosec": 1000}
    identifier, accepted = client.send(*points, **{field: limits, "goal_time_tolerance": leeway})
    assert accepted
    status, code, text = client.result(identifier)
    assert (status, code) == (ABORTED, expected)
    assert text.startswith("joint_1 is ")
    assert f"the tolerance is {tolerance:g} rad" in text


def test_a_goal_that_cannot_be_carried_out_is_not_accepted(client: Client) -> None:
    assert client.send((1.0, [0.0]), joints=("elbow",))[1] is False
    assert client.send(joints=("joint_1",))[1] is False
    assert client.send((1.0, [0.0]), (0.5, [0.0]), joints=("joint_1",))[1] is False
    assert client.send((1.0, [0.0, 0.0]), joints=("joint_1",))[1] is False
    assert client.result(uuid.uuid4().bytes) == (UNKNOWN, 0, "")


@pytest.mark.parametrize("position_rad", [10.0, -1e300, 3.2])
def test_a_goal_outside_the_limits_is_not_accepted_and_keeps_the_one_that_runs(
    client: Client, position_rad: float
) -> None:
    running, accepted = client.send((20.0, [0.5, 0.0]))
    assert accepted
    assert client.send((1.0, [0.0, 0.0]), (2.0, [0.0, position_rad]))[1] is False
    reason = (
        f"a goal of FollowJointTrajectory is refused: point 1 commands joint_2 to {position_rad:.4g} rad, "
        "its limits are -3.142 to 3.14 rad. Plan within these limits"
    )
    until(lambda: reason in client.logged)
    assert client.cancel(running) == (0, 1)
    assert client.result(running)[0] == CANCELED


@pytest.mark.parametrize(("start_rad", "accepted"), [(3.2, True), (3.3, False)])
def test_a_trajectory_may_start_where_a_joint_rests_slightly_outside_its_limits(
    client: Client, start_rad: float, accepted: bool
) -> None:
    identifier, is_accepted = client.send((0.0, [start_rad]), (0.2, [0.1]), joints=("joint_1",))
    assert is_accepted is accepted
    if accepted:
        client.cancel(identifier)
        client.result(identifier)


def test_parameters_become_values_and_back() -> None:
    settings = {"a": {"b": 1.5, "c": [1, 2]}, "d": True, "e": "text", "f": [0.5, 1], "g": []}
    values = flat(settings)
    assert values == {"a.b": 1.5, "a.c": [1, 2], "d": True, "e": "text", "f": [0.5, 1]}
    back = nested({name: value_of(parameter_value(value)) for name, value in values.items()})
    assert back == {"a": {"b": 1.5, "c": [1, 2]}, "d": True, "e": "text", "f": [0.5, 1.0]}
    assert value_of(message_class("rcl_interfaces/msg/ParameterValue")()) is None
