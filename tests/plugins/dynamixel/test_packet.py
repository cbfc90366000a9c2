import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua_dynamixel.packet import PING, READ, Search, request
from joshua_emulator.dynamixel.packets import packet, status_packet
from joshua_servo.reply import Reply

# Bytes that make headers, so that stuffing is met often.
AWKWARD = st.lists(st.sampled_from((0xFF, 0xFD, 0x00, 0x55)), max_size=24).map(bytes)
REPLIES = st.builds(Reply, st.integers(0, 252), st.sampled_from((0, 0x80, 7)), AWKWARD)


def test_the_vendors_example_packets() -> None:
    assert request(1, PING) == bytes.fromhex("FFFFFD0001030001194E")
    assert request(1, READ, bytes.fromhex("84000400")) == bytes.fromhex("FFFFFD00010700028400 04001D15")


@given(st.integers(0, 254), AWKWARD)
def test_requests_are_those_of_the_emulator_which_shares_no_code(servo_id: int, parameters: bytes) -> None:
    assert request(servo_id, READ, parameters) == packet(servo_id, READ, parameters)


@given(st.lists(REPLIES, max_size=4), st.lists(st.integers(1, 30), min_size=1))
def test_replies_are_found_however_they_are_cut(replies: list[Reply], cuts: list[int]) -> None:
    stream = b"".join(status_packet(*reply) for reply in replies)
    search, found = Search(), []
    at = index = 0
    while at < len(stream):
        step = cuts[index % len(cuts)]
        found += list(search.feed(stream[at : at + step]))
        at, index = at + step, index + 1
    assert (found, search.broken) == (replies, 0)


@given(st.binary(max_size=40))
def test_any_bytes_before_a_reply_do_no_harm(noise: bytes) -> None:
    search = Search()
    found = list(search.feed(noise + status_packet(3, 0, b"\x01\x02") + bytes(1100)))
    assert Reply(3, 0, b"\x01\x02") in found


@pytest.mark.parametrize("index", [4, 5, 8, 9, 11, 12])
def test_a_broken_reply_is_counted_and_not_believed(index: int) -> None:
    broken = bytearray(status_packet(3, 0, b"\x01\x02"))
    broken[index] ^= 4
    search = Search()
    assert list(search.feed(bytes(broken) + status_packet(4, 0) + bytes(1100)))[-1:] == [Reply(4, 0, b"")]
    assert search.broken == 1


def test_an_echoed_request_is_no_reply() -> None:
    search = Search()
    assert list(search.feed(request(3, PING) + status_packet(3, 0))) == [Reply(3, 0, b"")]
    assert search.broken == 0
