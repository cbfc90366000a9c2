"""Which profiles connect."""

from __future__ import annotations

import pytest
from joshua.plan import QosProfile
from joshua.plan.qos import qos_clashes

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
    assert qos_clashes(offered, requested) == []


@pytest.mark.parametrize(
    ("offered", "requested", "clash"),
    [
        (QosProfile(reliability="BEST_EFFORT"), NONE, ("reliability", "BEST_EFFORT", "RELIABLE")),
        (NONE, QosProfile(durability="TRANSIENT_LOCAL"), ("durability", "VOLATILE", "TRANSIENT_LOCAL")),
        (NONE, QosProfile(deadline_s=0.1), ("deadline_s", "none", "0.1 s")),
        (QosProfile(deadline_s=0.2), QosProfile(deadline_s=0.1), ("deadline_s", "0.2 s", "0.1 s")),
        (QosProfile(lease_duration_s=3), QosProfile(lease_duration_s=2), ("lease_duration_s", "3 s", "2 s")),
        (NONE, QosProfile(liveliness="MANUAL_BY_TOPIC"), ("liveliness", "AUTOMATIC", "MANUAL_BY_TOPIC")),
    ],
)
def test_pairs_that_do_not_connect(offered, requested, clash):
    assert qos_clashes(offered, requested) == [clash]


def test_all_reasons_are_given():
    offered = QosProfile(reliability="BEST_EFFORT")
    assert len(qos_clashes(offered, QosProfile(durability="TRANSIENT_LOCAL", deadline_s=1))) == 3
