"""What each QoS setting does, on both transports."""

from __future__ import annotations

import json
import threading
import time
from dataclasses import asdict, replace

import pytest
from joshua.messages import decode, encode, message_class
from joshua.plan import QosProfile
from joshua.plan.qos import qos_clashes

UINT32 = "std_msgs/msg/UInt32"


def number(value):
    return encode(message_class(UINT32)(value))


def values(samples):
    return [decode(UINT32, sample.cdr).data for sample in samples]


@pytest.fixture
def pair(spec, opener, eventually):
    """Opens two sessions, one for each side, and connects publishers and subscriptions of a topic."""
    near, far = opener(spec), opener(spec) if spec.kind == "zenoh" else None
    talker = near.create_node("talker")
    listener = (far or near).create_node("listener")
    publishers, subscriptions = {}, {}

    def connect(offered, requested, callback, *, topic="/topic", wait=True, pub_event=None, sub_event=None):
        publisher = talker.create_publisher(topic, UINT32, offered, on_event=pub_event)
        subscription = listener.create_subscription(topic, UINT32, requested, callback, on_event=sub_event)
        publishers[publisher], subscriptions[subscription] = (topic, offered), (topic, requested)
        if wait:
            eventually(all_connected, what="the connection of all that fit")
        return publisher, subscription

    def all_connected():
        """Each publisher with each subscription: one that is connected may be so with another end."""
        return all(
            publisher.subscription_count == sum(fits(offer, wish) for wish in subscriptions.values())
            for publisher, offer in publishers.items()
        ) and all(
            subscription.publisher_count == sum(fits(offer, wish) for offer in publishers.values())
            for subscription, wish in subscriptions.items()
        )

    def fits(offer, wish):
        return offer[0] == wish[0] and not qos_clashes(offer[1], wish[1])

    return connect


@pytest.mark.parametrize("reliability", ["RELIABLE", "BEST_EFFORT"])
@pytest.mark.parametrize("history", ["KEEP_LAST", "KEEP_ALL"])
def test_every_message_arrives_in_order_when_there_is_time(pair, eventually, reliability, history):
    got = []
    profile = QosProfile(reliability=reliability, history=history, depth=50)
    publisher, _ = pair(profile, profile, got.append)
    for value in range(50):
        publisher.publish(number(value))
    eventually(lambda: len(got) == 50)
    assert values(got) == list(range(50))


def test_a_reliable_publisher_serves_a_best_effort_subscription(pair, eventually):
    got = []
    publisher, _ = pair(QosProfile(), QosProfile(reliability="BEST_EFFORT"), got.append)
    publisher.publish(number(7))
    eventually(lambda: values(got) == [7])


def slow_reader():
    """A callback that holds the first message until it is let go."""
    got, entered, go = [], threading.Event(), threading.Event()

    def callback(sample):
        got.append(sample)
        entered.set()
        assert go.wait(60)

    return got, entered, go, callback


def test_keep_last_keeps_the_newest_for_a_slow_callback(pair, eventually):
    got, entered, go, callback = slow_reader()
    publisher, _ = pair(QosProfile(depth=50), QosProfile(depth=3), callback)
    publisher.publish(number(0))
    assert entered.wait(30)
    # what is published afterwards comes over afterwards
    fence = []
    last, _ = pair(QosProfile(), QosProfile(), fence.append, topic="/fence")
    for value in range(1, 21):
        publisher.publish(number(value))
    last.publish(number(21))
    eventually(lambda: fence)
    go.set()
    eventually(lambda: values(got)[-1] == 20)
    assert values(got) == [0, 18, 19, 20]


def test_keep_all_drops_nothing_for_a_slow_callback(pair, eventually):
    got, entered, go, callback = slow_reader()
    profile = QosProfile(history="KEEP_ALL", depth=1)
    publisher, _ = pair(profile, profile, callback)
    publisher.publish(number(0))
    assert entered.wait(30)
    for value in range(1, 501):
        publisher.publish(number(value))
    go.set()
    eventually(lambda: len(got) == 501)
    assert values(got) == list(range(501))


def test_a_late_subscription_gets_the_kept_messages(pair, eventually):
    kept = QosProfile(durability="TRANSIENT_LOCAL", depth=3)
    early: list = []
    publisher, first = pair(kept, QosProfile(), early.append)
    for value in range(5):
        publisher.publish(number(value))
    # what is still on its way would reach a new subscription as live data
    eventually(lambda: values(early)[-1:] == [4])
    late, volatile = [], []
    _, a = pair(replace(kept, depth=1), kept, late.append)
    _, b = pair(replace(kept, depth=1), QosProfile(), volatile.append)
    eventually(lambda: len(late) == 3)
    publisher.publish(number(5))
    eventually(lambda: values(late) == [2, 3, 4, 5])
    eventually(lambda: values(volatile) == [5])
    for subscription in (first, a, b):
        subscription.close()


def test_a_late_process_gets_the_kept_messages(spec, opener, program, eventually):
    kept = QosProfile(durability="TRANSIENT_LOCAL", depth=3)
    far = program("latched.py", spec.model_dump_json(), json.dumps(asdict(kept)))
    assert far.stdout.readline() == "ready\n"
    late = []
    node = opener(spec).create_node("late")
    node.create_subscription("/topic", UINT32, kept, late.append)
    eventually(lambda: len(late) == 3)
    far.stdin.write("more\n")
    far.stdin.flush()
    eventually(lambda: values(late) == [2, 3, 4, 5])


@pytest.mark.parametrize(
    ("offered", "requested", "word"),
    [
        (QosProfile(reliability="BEST_EFFORT"), QosProfile(), "reliability"),
        (QosProfile(), QosProfile(durability="TRANSIENT_LOCAL"), "durability"),
        (QosProfile(), QosProfile(deadline_s=0.5), "deadline"),
        (QosProfile(), QosProfile(liveliness="MANUAL_BY_TOPIC"), "liveliness"),
    ],
)
def test_profiles_that_do_not_fit_do_not_connect_and_both_sides_hear_of_it(
    pair, eventually, offered, requested, word
):
    got, events = [], {"publisher": [], "subscription": []}
    publisher, subscription = pair(
        offered,
        requested,
        got.append,
        wait=False,
        pub_event=lambda event, detail: events["publisher"].append((event, detail)),
        sub_event=lambda event, detail: events["subscription"].append((event, detail)),
    )
    eventually(lambda: events["publisher"] and events["subscription"], what="the events of both sides")
    for side in events.values():
        assert side[0][0] == "incompatible-qos"
        assert word in side[0][1]
        assert "/topic" in side[0][1]
    assert publisher.subscription_count == 0
    assert subscription.publisher_count == 0
    # the pair that fits, beside it, shows that the message was really on its way
    witness = []
    _, other = pair(QosProfile(), replace(offered, deadline_s=0), witness.append)
    publisher.publish(number(1))
    eventually(lambda: values(witness) == [1])
    assert not got
    other.close()


def test_a_missed_deadline_is_reported_to_both_sides(pair, eventually):
    profile = QosProfile(deadline_s=0.2)
    events = {"publisher": [], "subscription": []}
    publisher, _ = pair(
        profile,
        profile,
        lambda sample: None,
        pub_event=lambda event, detail: events["publisher"].append((event, detail)),
        sub_event=lambda event, detail: events["subscription"].append((event, detail)),
    )
    publisher.publish(number(1))
    eventually(lambda: events["publisher"] and events["subscription"])
    assert events["publisher"][0] == ("deadline-missed", "no message was published on /topic within 0.2 s")
    assert events["subscription"][0] == ("deadline-missed", "no message received on /topic within 0.2 s")


def test_old_messages_are_not_delivered(pair, eventually):
    kept = QosProfile(durability="TRANSIENT_LOCAL", depth=5, lifespan_s=0.3)
    publisher, first = pair(kept, QosProfile(), lambda sample: None)
    publisher.publish(number(1))
    published_s = time.monotonic()
    eventually(lambda: time.monotonic() > published_s + 0.5, what="the end of the life span")
    late = []
    _, second = pair(replace(kept, depth=1), kept, late.append)

    def something_fresh_arrives():
        publisher.publish(number(2))  # again and again: one that is held up for long is old, too
        return late

    eventually(something_fresh_arrives)
    assert set(values(late)) == {2}
    for subscription in (first, second):
        subscription.close()


def test_liveliness_that_is_not_asserted_is_reported_to_both_sides(pair, eventually):
    profile = QosProfile(liveliness="MANUAL_BY_TOPIC", lease_duration_s=0.4)
    events = {"publisher": [], "subscription": []}
    publisher, _ = pair(
        profile,
        profile,
        lambda sample: None,
        pub_event=lambda event, detail: events["publisher"].append((event, detail)),
        sub_event=lambda event, detail: events["subscription"].append((event, detail)),
    )

    def two_leases_without_a_loss():
        """Tries anew where the machine held a thread for longer than the lease."""
        publisher.publish(number(1))  # counts from here, also after a loss
        before = {side: len(seen) for side, seen in events.items()}
        end_s = time.monotonic() + 0.9
        while time.monotonic() < end_s:
            publisher.assert_liveliness()
            time.sleep(0.02)
        return before == {side: len(seen) for side, seen in events.items()}

    eventually(two_leases_without_a_loss, what="asserting that keeps the publisher alive")
    before = {side: len(seen) for side, seen in events.items()}
    eventually(lambda: all(len(seen) > before[side] for side, seen in events.items()), what="the loss")
    assert {event for side in events.values() for event, _ in side} == {"liveliness-lost"}
