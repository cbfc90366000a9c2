"""Every type of the DataType enum goes to another process and back, on both transports."""

from __future__ import annotations

import random
import string

import numpy as np
import pytest
from joshua.messages import decode, encode
from joshua.messages.fields import PLACEHOLDER, build, fields, to_plain
from joshua.plan import QosProfile
from joshua.schema.data_types import type_names

TYPES = type_names()


def random_value(base, rng):
    if base == "string":
        return "".join(rng.choices(string.ascii_letters + "äπ🤖 ", k=rng.randrange(9)))
    if base == "bool":
        return rng.random() < 0.5
    if base.startswith("float"):
        return float(np.dtype(base).type(rng.uniform(-1e3, 1e3)))
    limits = np.iinfo({"byte": "uint8", "char": "uint8"}.get(base, base))
    return rng.randint(limits.min, limits.max)


def random_fields(type_name, rng):
    values = {}
    for field in fields(type_name):
        if field.wire_name == PLACEHOLDER:
            continue
        count = {"one": 1, "array": field.length, "sequence": rng.randrange(4)}[field.shape]
        items = [
            random_fields(field.base, rng) if field.is_message else random_value(field.base, rng)
            for _ in range(count)
        ]
        values[field.wire_name] = items[0] if field.shape == "one" else items
    return values


def plain(value):
    if isinstance(value, dict):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [plain(item) for item in value] if isinstance(value, list) else value


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
