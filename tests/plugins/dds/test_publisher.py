"""What a publisher does when a reliable subscription does not keep up."""

from __future__ import annotations

import logging
import os
import signal

import numpy as np
import pytest
from cyclonedds.core import Policy
from joshua.messages import encode, make
from joshua.plan import QosProfile
from joshua_dds.qos import endpoint_qos

IMAGE, STATE = "sensor_msgs/msg/Image", "sensor_msgs/msg/JointState"


@pytest.mark.parametrize(
    ("type_name", "reliability", "is_writer", "kept"),
    [
        (IMAGE, "RELIABLE", True, True),
        ("sensor_msgs/msg/PointCloud2", "RELIABLE", True, True),
        (IMAGE, "BEST_EFFORT", True, False),
        (IMAGE, "RELIABLE", False, False),
        (STATE, "RELIABLE", True, False),
    ],
)
def test_writers_of_large_reliable_messages_replace_none(type_name, reliability, is_writer, kept):
    profile = QosProfile(reliability=reliability, depth=3, durability="TRANSIENT_LOCAL")
    policies = endpoint_qos(profile, type_name, is_writer=is_writer)
    assert (policies[Policy.History] == Policy.History.KeepAll) is kept
    if is_writer:  # what late subscriptions get keeps its depth
        assert policies[Policy.DurabilityService].history == Policy.History.KeepLast(3)


def test_images_that_a_stopped_reader_cannot_take_are_dropped_at_once(
    dds_spec, opener, program, eventually, caplog
):
    node, back = opener(dds_spec).create_node("camera"), []
    node.create_subscription("/pong/t0", IMAGE, QosProfile(), lambda sample: back.append(len(sample.cdr)))
    publisher = node.create_publisher("/ping/t0", IMAGE, QosProfile())
    reader = program("echo_types.py", dds_spec.model_dump_json(), IMAGE)
    assert reader.stdout.readline() == "ready\n"
    eventually(lambda: publisher.subscription_count)
    payload = encode(make.image(np.zeros((1080, 1920, 3), np.uint8)))

    def image_came_back():
        publisher.publish(payload)
        return back

    eventually(image_came_back)
    os.kill(reader.pid, signal.SIGSTOP)
    with caplog.at_level(logging.WARNING, "joshua.transport"):
        for _ in range(30):
            publisher.publish(payload)
    os.kill(reader.pid, signal.SIGCONT)
    reason = "were not sent, because a reliable subscription does not keep up"
    assert f"/ping/t0: 1 messages {reason}" in [record.message for record in caplog.records]
    before = len(back)
    eventually(lambda: image_came_back() and len(back) > before)
