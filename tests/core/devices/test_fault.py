"""An actuator's node in fault: after a trip, after an e-stop, and what ends it.

Why one file: its tests share one node and its latches.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joshua.devices.actuator_node import ActuatorNode
from joshua.devices.errors import DeviceDisconnected, DeviceError, DeviceSilent, SafetyTripped
from joshua.guardian.latch import EstopFiles, EstopOrder, LatchFolder, new_latch
from joshua.guardian.silence import Patience
from joshua.messages.make import joint_state
from joshua.node.verbs import RefusedError
from joshua.plan import ActuatorFacts, NodeKind, NodeSpec, RunFacts, TopicSpec
from joshua.schema import config_pb2
from joshua.testing.recording_context import RecordingContext
from joshua_mock.actuator import MockActuator
from joshua_mock.settings import MockMotorSettings

STATE = TopicSpec(name="/arm/state", type_name="sensor_msgs/msg/JointState", rate_hz=200.0)
COMMAND = TopicSpec(name="/arm/command", type_name="sensor_msgs/msg/JointState")


class Node:
    """A follower of two mock joints, configured and activated."""

    def __init__(self, folder: Path, role: str = "ACTION_FOLLOWER", **facts: Any) -> None:
        settings = MockMotorSettings.from_block(config_pb2.MockMotorConfig(num_motors=2, position_max=4095))
        self.latches = LatchFolder(folder / "estop")
        self.files = EstopFiles(str(folder / "files"))
        spec = NodeSpec(
            name="arm",
            kind=NodeKind.ACTUATOR,
            role=role,
            behaviour="",
            implementation="joshua_mock.actuator:MockActuator",
            settings_type="joshua_mock.settings:MockMotorSettings",
            settings=settings.model_dump(mode="json"),
            facts=ActuatorFacts(
                joints=settings.joints(),
                external=(COMMAND.name,),
                run=RunFacts(
                    robot="desk",
                    domain_id=7,
                    latch_folder=str(self.latches.path),
                    estop_files=str(folder / "files"),
                ),
                **facts,
            ),
            publishers=(STATE,),
            subscriptions=(COMMAND,) if role == "ACTION_FOLLOWER" else (),
        )
        self.context = RecordingContext(spec)
        self.node = ActuatorNode(self.context)
        self.node.configure()
        self.node.activate()

    @property
    def arm(self) -> MockActuator:
        assert isinstance(self.node._actuator, MockActuator)
        return self.node._actuator

    @property
    def has_torque(self) -> bool:
        return set(self.arm.read_torque().values()) == {True}

    def cycle(self) -> None:
        self.context.receive("/arm/command", joint_state(["joint_1"], [0.2]))
        self.context.tick("control")

    def stop(self) -> str:
        latch = self.latches.set("desk", "/desk.pbtxt", 7, ["/arm"])
        self.context.tick("safety")
        return latch.identifier


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Any]:
    started: list[Node] = []

    def make(*args: Any, **context: Any) -> Node:
        started.append(Node(tmp_path, *args, **context))
        return started[-1]

    yield make
    for node in started:
        node.node.deactivate()
        node.context.stop()
        node.node.cleanup()


def trip(node: Node, monkeypatch: pytest.MonkeyPatch, **options: Any) -> None:
    read = node.arm.read

    def tripped() -> Any:
        monkeypatch.setattr(node.arm, "read", read)
        if options.get("released", True):
            node.arm.release()
        raise SafetyTripped("joint_1: 81 °C, at most 70 °C", **options)

    monkeypatch.setattr(node.arm, "read", tripped)
    node.context.tick("control")


def test_a_trip_leaves_the_node_running_without_torque(start: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node = start()
    node.cycle()
    trip(node, monkeypatch)
    assert not node.has_torque
    assert node.context.faults == [
        "joint_1: 81 °C, at most 70 °C. Run `joshua resume arm` to re-enable torque"
    ]
    before = len(node.context.publishers["/arm/state"].messages)
    written = len(node.context.publishers["~/applied_command"].messages)
    for _ in range(3):
        node.cycle()
    assert len(node.context.publishers["/arm/state"].messages) == before + 3, "the state goes on"
    assert len(node.context.publishers["~/applied_command"].messages) == written, "nothing is written"
    node.context.tick("diagnostics")
    status = node.context.publishers["/diagnostics"].messages[-1].status[0]
    assert (status.level, status.message) == (2, node.context.faults[0])
    assert ("torque", False, node.context.faults[0]) in node.node.test_results()
    assert node.node.resume() == "/arm: torque is on again; the joints approach the next command slowly"
    assert node.has_torque
    assert node.context.faults[-1] == ""
    node.cycle()
    assert len(node.context.publishers["~/applied_command"].messages) == written + 1


def test_commands_to_an_arm_in_fault_are_named_with_the_remedy(
    start: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    node = start()
    trip(node, monkeypatch)
    for _ in range(3):
        node.context.receive("/arm/command", joint_state(["joint_1"], [0.2]), "/leader")
    said = (
        "/arm/command: commands from /leader have no effect: joint_1: 81 °C, at most 70 °C. "
        "Run `joshua resume arm` to re-enable torque"
    )
    assert caplog.messages.count(said) == 1
    node.context.tick("diagnostics")
    assert node.context.shown == "3 commands without effect from /leader"
    values = {
        item.key: item.value for item in node.context.publishers["/diagnostics"].messages[-1].status[0].values
    }
    assert values["commands_without_effect"] == "3"
    assert values["publishers_without_effect"] == "/leader"
    node.node.resume()
    node.context.tick("diagnostics")
    assert node.context.shown == ""
    trip(node, monkeypatch)
    node.context.receive("/arm/command", joint_state(["joint_1"], [0.2]), "/leader")
    assert caplog.messages.count(said) == 2, "once in each fault"


def test_after_the_e_stop_the_remedy_changes(start: Any, caplog: pytest.LogCaptureFixture) -> None:
    node = start()
    node.stop()
    node.cycle()
    assert "have no effect: torque off" in caplog.messages[-1]
    assert caplog.messages[-1].endswith("look at the robot, then joshua estop --release")
    node.latches.clear(node.latches.all()[0])
    node.context.tick("safety")
    node.cycle()
    assert caplog.messages[-1].endswith(
        "have no effect: the e-stop is released, but torque is still off. "
        "Run `joshua resume arm` to re-enable torque"
    )


def test_a_trip_that_the_device_does_not_confirm_fails_the_node(
    start: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = start()
    with pytest.raises(SafetyTripped):
        trip(node, monkeypatch, released=False)
    assert node.context.faults == []


def test_resume_is_refused_while_the_fault_persists(start: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node = start(restarted=True)

    def enable() -> None:
        raise SafetyTripped("torque stays off: joint_1: 81 °C, at most 70 °C")

    monkeypatch.setattr(node.arm, "enable", enable)
    with pytest.raises(RefusedError, match="the fault is still there: torque stays off: joint_1: 81 °C"):
        node.node.resume()
    assert not node.has_torque
    node.cycle()
    assert node.context.publishers["~/applied_command"].messages == []
    monkeypatch.undo()
    node.node.resume()
    assert node.has_torque


def test_resume_is_refused_while_the_device_check_fails(start: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node = start(restarted=True)

    def check() -> None:
        raise DeviceError("missing ids: 2")

    monkeypatch.setattr(node.arm, "check", check)
    with pytest.raises(RefusedError, match="the check of the device failed: missing ids: 2"):
        node.node.resume()
    assert not node.has_torque


def test_resume_of_a_healthy_actuator_changes_nothing(start: Any) -> None:
    node = start()
    assert "there is nothing to resume" in node.node.resume()
    assert node.has_torque


def test_a_leader_is_never_resumed(start: Any) -> None:
    node = start("ACTION_LEADER")
    with pytest.raises(RefusedError, match="/arm never gets torque"):
        node.node.resume()


def test_an_estop_takes_the_torque_reads_it_back_and_reports(start: Any) -> None:
    node = start()
    node.cycle()
    assert node.has_torque
    identifier = node.stop()
    assert not node.has_torque
    report = node.files.read_report("/arm", identifier)
    assert report is not None
    assert (report.by, report.complete, report.verified) == ("driver", True, True)
    assert report.joints == {"joint_1": "released", "joint_2": "released"}
    node.cycle()
    assert not node.has_torque
    with pytest.raises(RefusedError, match=r"the e-stop of desk is latched since .*estop --release"):
        node.node.resume()
    (latch,) = node.latches.all()
    node.latches.clear(latch)
    node.context.tick("safety")
    assert not node.has_torque, "releasing the latch moves nothing"
    assert node.context.faults[-1] == (
        "the e-stop is released, but torque is still off. Run `joshua resume arm` to re-enable torque"
    )
    node.node.resume()
    assert node.has_torque


def test_a_resume_before_the_release_was_noticed_stands(start: Any) -> None:
    node = start()
    node.stop()
    node.latches.clear(node.latches.all()[0])
    node.node.resume()
    node.context.tick("safety")
    assert node.has_torque
    assert node.context.faults[-1] == ""


def test_an_estop_that_is_no_file_is_remembered_until_its_release(start: Any) -> None:
    node = start()
    latch = new_latch("desk", "/desk.pbtxt", 7, ["/arm"])
    node.context.take_estop(latch, stored=False)
    node.node.estop()
    assert not node.has_torque
    assert [(report.latch, report.complete) for report in node.context.estops] == [(latch.identifier, True)]
    with pytest.raises(RefusedError, match="the e-stop of desk is latched since"):
        node.node.resume()
    node.context.take_estop(None, stored=True)
    node.node.estop()
    assert not node.has_torque, "releasing it moves nothing"
    node.node.resume()
    assert node.has_torque


def test_a_node_that_is_told_of_a_latch_obeys_at_once_and_only_while_it_stands(start: Any) -> None:
    node = start()
    latch = node.latches.set("desk", "/desk.pbtxt", 7, ["/arm"])
    node.context.take_estop(latch, stored=True)
    node.node.estop()
    assert not node.has_torque
    node.context.tick("safety")
    assert len(node.context.estops) == 1
    node.latches.clear(latch)
    node.node.resume()
    assert node.has_torque


def test_no_torque_if_an_estop_might_not_be_possible(start: Any) -> None:
    node = start()
    node.stop()
    node.latches.clear(node.latches.all()[0])
    node.context.tick("safety")
    shutil.rmtree(node.latches.path)
    node.latches.path.write_text("in the way")
    with pytest.raises(RefusedError, match=r"an e-stop might not be possible: .*estop.*Free space there"):
        node.node.resume()
    assert not node.has_torque
    node.latches.path.unlink()
    node.node.resume()
    assert node.has_torque


def test_a_spare_file_that_vanishes_is_created_again(start: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("joshua.devices.actuator_safety.FILES_PERIOD_S", 0.0)
    node = start()
    spare = node.latches.path / "spare"
    assert spare.exists()
    shutil.rmtree(node.latches.path)
    node.context.tick("safety")
    assert spare.exists()


def test_a_second_estop_is_verified_again(start: Any) -> None:
    node = start()
    first, second = node.stop(), node.stop()
    assert first != second
    assert [latch.identifier for latch in node.latches.all()] == [second]
    assert node.files.read_report("/arm", second) is not None
    assert node.files.read_report("/arm", first) is None


def test_a_node_that_starts_while_the_latch_stands_gets_no_torque(start: Any, tmp_path: Path) -> None:
    LatchFolder(tmp_path / "estop").set("desk", "/other.pbtxt", 3, [])
    node = start()
    assert not node.has_torque
    assert "the e-stop of desk is latched" in node.context.faults[0]
    for _ in range(3):
        node.context.tick("safety")
        node.cycle()
    assert not node.has_torque
    assert len(node.context.faults) == 1


def test_the_estop_of_another_robot_changes_nothing(start: Any) -> None:
    node = start()
    node.latches.set("shelf", "/shelf.pbtxt", 3, ["/arm"])
    node.context.tick("safety")
    assert node.has_torque


def test_a_leader_is_read_back_too_and_recovers_by_itself(start: Any) -> None:
    node = start("ACTION_LEADER")
    identifier = node.stop()
    report = node.files.read_report("/arm", identifier)
    assert report is not None
    assert report.complete
    (latch,) = node.latches.all()
    node.latches.clear(latch)
    node.context.tick("safety")
    assert node.context.faults[-1] == ""


def test_a_device_that_does_not_confirm_is_reported(start: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node = start()

    def release() -> None:
        raise DeviceDisconnected("no servo answers any more")

    monkeypatch.setattr(node.arm, "release", release)
    with pytest.raises(DeviceDisconnected):
        node.stop()
    (latch,) = node.latches.all()
    report = node.files.read_report("/arm", latch.identifier)
    assert report is not None
    assert (report.complete, report.detail) == (False, "no servo answers any more")


def test_torque_that_is_read_back_as_on_is_no_success(start: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node = start()
    monkeypatch.setattr(node.arm, "read_torque", lambda: {"joint_1": False, "joint_2": True})
    with pytest.raises(DeviceError, match="torque of joint_2 is still on: disconnect the power supply"):
        node.stop()


def test_a_device_that_cannot_say_is_not_called_verified(start: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node = start()
    monkeypatch.setattr(node.arm, "read_torque", lambda: None)
    report = node.files.read_report("/arm", node.stop())
    assert report is not None
    assert (report.complete, report.verified) == (True, False)


def test_a_goal_is_not_written_between_latch_and_watch(start: Any) -> None:
    """The node looks every 50 ms; whatever a cycle writes before that, the release comes after it."""
    node = start()
    node.latches.set("desk", "/desk.pbtxt", 7, ["/arm"])
    node.cycle()
    node.context.tick("safety")
    assert not node.has_torque
    with pytest.raises(DeviceError, match="torque is off"):
        node.arm.write(np.zeros(2))


@pytest.mark.parametrize("state", ["RELEASE", "PARK_THEN_RELEASE"])
def test_a_release_that_did_not_reach_the_device_is_made_up_for(
    start: Any, monkeypatch: pytest.MonkeyPatch, state: str
) -> None:
    released: list[MockActuator] = []
    monkeypatch.setattr(MockActuator, "release", lambda arm: released.append(arm))
    start(restarted=True, safe_state="HOLD")
    assert released == []
    node = start(restarted=True, safe_state=state)
    assert released == [node.arm]


def test_a_device_that_is_silent_for_a_moment_is_waited_for(
    start: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = start()
    node.cycle()
    read, states = node.arm.read, node.context.publishers["/arm/state"].messages
    written = node.context.publishers["~/applied_command"].messages

    def silent() -> Any:
        time.sleep(0.01)
        raise DeviceSilent("no servo answers any more")

    monkeypatch.setattr(node.arm, "read", silent)
    before = len(states), len(written)
    for _ in range(3):
        node.cycle()
    assert (len(states), len(written)) == before, "nothing is made up, and nothing is written"
    node.context.tick("diagnostics")
    (summary, *_) = node.context.publishers["/diagnostics"].messages[-1].status
    assert (summary.level, summary.values[0].value) == (1, "3")
    assert summary.message == "following; 3 readings failed since the last report"
    monkeypatch.setattr(node.arm, "read", read)
    node.cycle()
    assert (len(states), len(written)) == (before[0] + 1, before[1] + 1)
    node.context.tick("diagnostics")
    (summary, *_) = node.context.publishers["/diagnostics"].messages[-1].status
    assert (summary.level, summary.message) == (0, "in order: following")
    assert float(summary.values[1].value) > 0


def test_a_device_that_stays_silent_fails_the_node(start: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node = start()

    def silent() -> Any:
        time.sleep(0.05)
        raise DeviceSilent("no servo answers any more")

    monkeypatch.setattr(node.arm, "read", silent)
    monkeypatch.setattr(node.node._status, "_patience", Patience(waited=lambda: 0.0))
    with pytest.raises(DeviceSilent, match="no servo answers"):  # noqa: PT012
        for _ in range(40):
            node.cycle()
    assert node.node._status.missed >= 5


def test_a_device_that_is_gone_is_not_waited_for(start: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node = start()

    def gone() -> Any:
        raise DeviceDisconnected("the adapter is gone")

    monkeypatch.setattr(node.arm, "read", gone)
    with pytest.raises(DeviceDisconnected):
        node.cycle()


def test_a_driver_that_is_started_again_is_told_how_the_device_was_reached(
    start: Any, tmp_path: Path
) -> None:
    EstopFiles(str(tmp_path / "files")).leave_order(
        "/arm", EstopOrder("module:stop", {"serial_number": "A1"})
    )
    assert start().arm.context.remembered == {}
    assert start(restarted=True).arm.context.remembered == {"serial_number": "A1"}


@pytest.mark.parametrize(
    ("safe_state", "torque", "said"),
    [
        ("RELEASE", {"joint_1": False, "joint_2": False}, "with torque off"),
        ("HOLD", {"joint_1": True, "joint_2": True}, "holding its position"),
        ("HOLD", {"joint_1": True, "joint_2": False}, "with torque on at joint_1 only"),
        ("HOLD", {"joint_1": False, "joint_2": False}, "with torque off"),
        ("HOLD", None, "in the safe state HOLD"),
    ],
)
def test_a_restarted_arm_says_which_joints_have_torque(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    safe_state: str,
    torque: dict[str, bool] | None,
    said: str,
) -> None:
    monkeypatch.setattr(MockActuator, "read_torque", lambda _: torque)
    node = Node(tmp_path, restarted=True, safe_state=safe_state)
    (fault,) = node.context.faults
    assert fault.startswith(f"restarted after a failure, {said}. Check the arm. Run `joshua resume arm`")
