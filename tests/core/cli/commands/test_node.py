"""``joshua node`` against a running graph."""

from __future__ import annotations

import pytest
from joshua.cli.main import main
from joshua.plan import QosProfile
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
