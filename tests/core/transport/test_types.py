"""Every type of the DataType enum goes to another process and back, on both transports."""

from __future__ import annotations

import random

import pytest
from joshua.messages import decode, encode
from joshua.messages.fields import build, to_plain
from joshua.plan import QosProfile
from joshua.schema.data_types import type_names
from random_messages import plain, random_fields

TYPES = type_names()


def test_the_enum_has_all_types():
    assert len(TYPES) == 106


@pytest.mark.parametrize("type_name", TYPES)
def test_random_messages_survive_the_codec(type_name):
    rng = random.Random(type_name)
    for _ in range(5):
        values = random_fields(type_name, rng)
        assert plain(to_plain(decode(type_name, encode(build(type_name, values))))) == values


def test_every_type_travels_to_another_process_and_back(spec, opener, program, eventually):
    far = program("echo_types.py", spec.model_dump_json(), ",".join(TYPES))
    node = opener(spec).create_node("near")
    got = {}
    ends = []
    for number, type_name in enumerate(TYPES):
        publisher = node.create_publisher(f"/ping/t{number}", type_name, QosProfile())
        subscription = node.create_subscription(
            f"/pong/t{number}",
            type_name,
            QosProfile(),
            lambda sample, number=number: got.setdefault(number, sample),
        )
        ends.append((publisher, subscription))
    assert far.stdout.readline() == "ready\n"
    eventually(
        lambda: all(p.subscription_count == 1 and s.publisher_count == 1 for p, s in ends),
        timeout_s=60,
        what="the match of all types",
    )
    rng = random.Random(7)
    sent = {}
    for number, (type_name, (publisher, _)) in enumerate(zip(TYPES, ends, strict=True)):
        sent[number] = random_fields(type_name, rng)
        publisher.publish(encode(build(type_name, sent[number])))
    eventually(lambda: len(got) == len(TYPES), timeout_s=60, what="the echo of all types")
    for number, type_name in enumerate(TYPES):
        assert plain(to_plain(decode(type_name, got[number].cdr))) == sent[number], type_name
