"""Resolved names, and the profile that a subscription without one adopts."""

from __future__ import annotations

from google.protobuf import text_format
from joshua.config.graph import build_graph, common_profile, resolve_topic
from joshua.plan import QosProfile
from joshua.plan.qos import qos_clashes as clashes
from joshua.schema import config_pb2 as pb


def test_names_resolve_as_in_ros_2() -> None:
    assert resolve_topic("/a/b", "/ns", "node") == "/a/b"
    assert resolve_topic("b", "/", "node") == "/b"
    assert resolve_topic("b", "/ns", "node") == "/ns/b"
    assert resolve_topic("~/b", "/", "node") == "/node/b"
    assert resolve_topic("~/b", "/ns", "node") == "/ns/node/b"
    assert resolve_topic("~", "/ns", "node") == "/ns/node"


LATCHED = QosProfile(durability="TRANSIENT_LOCAL", depth=1, deadline_s=0.5)
LOSSY = QosProfile(reliability="BEST_EFFORT", liveliness="MANUAL_BY_TOPIC", depth=20, lease_duration_s=2.0)


def test_what_two_publishers_have_in_common_connects_to_both() -> None:
    common = common_profile(LATCHED, LOSSY)
    assert common == common_profile(LOSSY, LATCHED)
    assert common == QosProfile(reliability="BEST_EFFORT", depth=20)
    assert clashes(LATCHED, common) == clashes(LOSSY, common) == []


def test_common_durations_are_the_longer_ones() -> None:
    one, other = QosProfile(deadline_s=0.5, lease_duration_s=1.0), QosProfile(deadline_s=2.0)
    common = common_profile(one, other)
    assert (common.deadline_s, common.lease_duration_s) == (2.0, 0.0)
    assert common_profile(one, one) is one


def test_a_subscription_adopts_what_all_its_publishers_offer() -> None:
    config = text_format.Parse(
        """
        robot {
          perceptions { node { node_name: "a"
            publishers { topic_name: "/x" qos { durability: TRANSIENT_LOCAL } }
            publishers { topic_name: "/x" qos { reliability: BEST_EFFORT durability: TRANSIENT_LOCAL } } } }
          perceptions { node { node_name: "b" subscriptions { topic_name: "/x" } } }
          perceptions { node { node_name: "c" qos { depth: 3 } subscriptions { topic_name: "/x" } } }
        }
        """,
        pb.Config(),
    )
    adopting, stating = [item for item in build_graph(config).endpoints if not item.is_publisher]
    assert (adopting.qos.reliability, adopting.qos.durability) == ("BEST_EFFORT", "TRANSIENT_LOCAL")
    assert adopting.qos_path == ""
    assert (stating.qos.reliability, stating.qos.depth) == ("RELIABLE", 3)
    assert stating.qos_path == "robot.perceptions[2].node.qos"
