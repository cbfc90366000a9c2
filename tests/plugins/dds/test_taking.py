"""Samples of a DDS reader: large ones are lent by the middleware and stay readable while they are held."""

from __future__ import annotations

import gc
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joshua.messages import decode, encode, make
from joshua.plan import QosProfile
from joshua_dds.taking import _LOAN_B, Taker

IMAGE = "sensor_msgs/msg/Image"


def image(width: int, value: int) -> Any:
    return encode(make.image(np.full((480, width, 3), value, np.uint8), frame_id="c"))


def test_small_samples_are_bytes_and_large_ones_read_only_views(dds_spec, opener, eventually):
    node = opener(dds_spec).create_node("one")
    got: list[Any] = []
    node.create_subscription("/image", IMAGE, QosProfile(), lambda sample: got.append(sample.cdr))
    publisher = node.create_publisher("/image", IMAGE, QosProfile())
    payloads = [image(8, 1), image(640, 2), image(641, 3), image(1, 4)]
    for payload in payloads:
        publisher.publish(payload)
    eventually(lambda: len(got) == len(payloads))
    assert [type(cdr) for cdr in got] == [bytes, memoryview, memoryview, bytes]
    for cdr, payload in zip(got, payloads, strict=True):
        assert (len(cdr) >= _LOAN_B) == isinstance(cdr, memoryview)
        assert bytes(cdr[: len(payload)]) == payload
        assert decode(IMAGE, cdr).data[0] == decode(IMAGE, payload).data[0]
    with pytest.raises(TypeError, match="cannot modify read-only memory"):
        got[1][0] = 1
    assert not decode(IMAGE, got[1]).data.flags.writeable


def test_a_lent_sample_keeps_its_bytes_while_hundreds_come_and_go(dds_spec, opener, eventually):
    node = opener(dds_spec).create_node("one")
    held: list[Any] = []
    seen = [0]

    def keep_some(sample: Any) -> None:
        seen[0] += 1
        if seen[0] % 20 == 0:
            held.append(decode(IMAGE, sample.cdr).data)

    node.create_subscription("/image", IMAGE, QosProfile(history="KEEP_ALL"), keep_some)
    publisher = node.create_publisher("/image", IMAGE, QosProfile(history="KEEP_ALL"))
    for number in range(200):
        publisher.publish(image(640, number % 251))
    eventually(lambda: seen[0] == 200)
    assert [int(data[0]) for data in held] == [(number - 1) % 251 for number in range(20, 201, 20)]
    assert all((data == data[0]).all() for data in held)


def test_a_lent_sample_outlives_its_transport(dds_spec, tmp_path: Path):
    """In a process of its own, because what could go wrong ends a process."""
    program = tmp_path / "outlive.py"
    program.write_text(f"""
import gc, time
import numpy as np
from joshua.messages import decode, encode, make
from joshua.plan import QosProfile, TransportSettings
from joshua.testing.transport import transport_settings
from joshua.transport import open_transport

held = []
for round in range(3):
    transport = open_transport(transport_settings("dds", domain_id={dds_spec.domain_id}))
    node = transport.create_node("one")
    got = []
    node.create_subscription("/image", {IMAGE!r}, QosProfile(), got.append)
    publisher = node.create_publisher("/image", {IMAGE!r}, QosProfile())
    for value in range(5):
        publisher.publish(encode(make.image(np.full((480, 640, 3), value, np.uint8))))
    while len(got) < 5:
        time.sleep(0.01)
    transport.close()
    del transport, node, publisher
    gc.collect()
    held += [decode({IMAGE!r}, sample.cdr).data for sample in got]
    del got
assert [int(data[-1]) for data in held] == [0, 1, 2, 3, 4] * 3
del held[::2]
gc.collect()
print("done")  # the others go while the interpreter ends
""")
    result = subprocess.run(
        [sys.executable, str(program)], capture_output=True, text=True, timeout=60, check=False
    )
    assert (result.returncode, result.stdout) == (0, "done\n"), result.stderr


def test_lent_memory_is_given_back(dds_spec, opener, eventually):
    node = opener(dds_spec).create_node("one")
    seen = [0]

    def count(sample: Any) -> None:
        seen[0] += 1

    node.create_subscription("/image", IMAGE, QosProfile(), count)
    publisher = node.create_publisher("/image", IMAGE, QosProfile())
    payload = image(640, 7)

    def send(times: int) -> None:
        for _ in range(times):
            before = seen[0]
            publisher.publish(payload)
            eventually(lambda before=before: seen[0] > before)

    def resident_b() -> int:
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    send(60)
    before_b = resident_b()
    send(100)
    assert resident_b() - before_b < 40 * len(payload), "of a hundred images none stays"


def test_a_reader_without_a_sample_gives_none(dds_spec, opener):
    node = opener(dds_spec).create_node("one")
    subscription = node.create_subscription("/image", IMAGE, QosProfile(), lambda sample: None)
    assert Taker(subscription.entity).take() is None
