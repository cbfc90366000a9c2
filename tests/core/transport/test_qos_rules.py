"""Which profiles connect, and what the start-up table says of settings."""

from __future__ import annotations

import pytest
from joshua.plan import QosProfile
from joshua.transport.qos_rules import effective_qos_notes, incompatibilities

NONE = QosProfile()


@pytest.mark.parametrize(
    ("offered", "requested"),
    [
        (NONE, NONE),
        (NONE, QosProfile(reliability="BEST_EFFORT")),
        (QosProfile(durability="TRANSIENT_LOCAL"), NONE),
        (QosProfile(deadline_s=0.1), QosProfile(deadline_s=0.1)),
        (QosProfile(deadline_s=0.1), NONE),
        (QosProfile(lease_duration_s=1), QosProfile(lease_duration_s=2)),
        (QosProfile(liveliness="MANUAL_BY_TOPIC"), NONE),
        (NONE, QosProfile(lifespan_s=1, history="KEEP_ALL", depth=1)),
    ],
)
def test_pairs_that_connect(offered, requested):
    assert incompatibilities(offered, requested) == []


@pytest.mark.parametrize(
    ("offered", "requested", "text"),
    [
        (QosProfile(reliability="BEST_EFFORT"), NONE, "the publisher offers BEST_EFFORT"),
        (NONE, QosProfile(durability="TRANSIENT_LOCAL"), "the publisher offers VOLATILE"),
        (NONE, QosProfile(deadline_s=0.1), "offers none, the subscription asks for 0.1 s"),
        (QosProfile(deadline_s=0.2), QosProfile(deadline_s=0.1), "offers 0.2 s"),
        (QosProfile(lease_duration_s=3), QosProfile(lease_duration_s=2), "lease duration"),
        (NONE, QosProfile(liveliness="MANUAL_BY_TOPIC"), "the publisher offers AUTOMATIC"),
    ],
)
def test_pairs_that_do_not_connect(offered, requested, text):
    reasons = incompatibilities(offered, requested)
    assert len(reasons) == 1
    assert text in reasons[0]


def test_all_reasons_are_given():
    offered = QosProfile(reliability="BEST_EFFORT")
    assert len(incompatibilities(offered, QosProfile(durability="TRANSIENT_LOCAL", deadline_s=1))) == 3


def test_notes_of_the_start_up_table():
    assert effective_qos_notes("zenoh", NONE) == []
    assert effective_qos_notes("dds", QosProfile(deadline_s=1)) == []
    assert effective_qos_notes("zenoh", QosProfile(deadline_s=1)) == [
        "deadline acts between JOSHUA nodes only: ROS 2's Zenoh middleware does not apply it"
    ]
    everything = QosProfile(lifespan_s=1, lease_duration_s=1, liveliness="MANUAL_BY_TOPIC")
    assert effective_qos_notes("zenoh", everything)[0].startswith(
        "lifespan, lease duration, manual liveliness act between"
    )
