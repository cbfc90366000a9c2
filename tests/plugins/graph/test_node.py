"""``joshua node`` against a running graph."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.cli.main import main
from joshua.ipc.client import RunInfo, RunningSystem
from joshua.plan import QosProfile
from joshua.plan.events import RunStatus
from joshua.testing.transport import transport_settings
from joshua.transport import open_transport


@pytest.fixture
def node(joshua_domain_id):
    transport = open_transport(transport_settings("dds", domain_id=joshua_domain_id))
    made = transport.create_node("arm", "/left")
    transport.create_node("_hidden")
    made.create_publisher("/left/state", "sensor_msgs/msg/JointState", QosProfile())
    made.create_subscription("/left/command", "sensor_msgs/msg/JointState", QosProfile(), lambda sample: None)
    yield made
    transport.close()


def test_list(node, capsys):
    assert main(["node", "list", "--transport", "dds", "--wait", "60"]) == 0
    assert capsys.readouterr().out == "/left/arm\n"
    assert main(["node", "list", "--all", "--transport", "dds", "--wait", "60"]) == 0
    assert capsys.readouterr().out == "/_hidden\n/left/arm\n"


def test_a_list_of_hidden_nodes_alone_says_so(joshua_domain_id, capsys):
    transport = open_transport(transport_settings("dds", domain_id=joshua_domain_id))
    transport.create_node("_hidden")
    assert main(["node", "list", "--transport", "dds", "--wait", "60"]) == 0
    transport.close()
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "every node of the graph is hidden: its name begins with _. Show them with --all" in captured.err


def test_an_empty_list_names_what_runs_elsewhere(joshua_domain_id, capsys, monkeypatch):
    class Elsewhere(RunningSystem):
        def status(self):
            return RunStatus(self.info.source, self.info.run, "running", 1.0, 7, ())

    def run(mode, source, domain_id):
        return Elsewhere(Path("/nowhere"), RunInfo(mode, 7, source, "", domain_id, ()))

    systems = [
        run("MODE_TELEOPERATE", "a.pbtxt", joshua_domain_id + 1),
        run("MODE_CALIBRATION", "b.pbtxt", joshua_domain_id),
        run("MODE_TELEOPERATE", "c.pbtxt", joshua_domain_id),
    ]
    monkeypatch.setattr(RunningSystem, "all", lambda *_: systems)
    assert main(["node", "list", "--transport", "dds", "--wait", "0.3"]) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    for text in (
        f"no ROS 2 node was found on DDS domain {joshua_domain_id}",
        f"a.pbtxt runs in domain {joshua_domain_id + 1}: set ROS_DOMAIN_ID={joshua_domain_id + 1}.",
        "b.pbtxt is being calibrated, which needs no ROS 2 nodes.",
        "c.pbtxt runs: name it with --config.",
        "ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET",
    ):
        assert text in captured.err


def test_info(node, capsys):
    assert main(["node", "info", "/left/arm", "--transport", "dds", "--wait", "60"]) == 0
    profile = "RELIABLE, VOLATILE, KEEP_LAST 10"
    assert capsys.readouterr().out.splitlines() == [
        "/left/arm",
        "publishers: 1",
        f"  /left/state  sensor_msgs/msg/JointState  {profile}",
        "subscriptions: 1",
        f"  /left/command  sensor_msgs/msg/JointState  {profile}",
    ]


def test_an_unknown_node_names_the_nearest(node, capsys):
    assert main(["node", "info", "/left/arms", "--transport", "dds", "--wait", "1"]) == 2
    assert "no node /left/arms appeared within 1 s; the nearest are /left/arm" in capsys.readouterr().err
