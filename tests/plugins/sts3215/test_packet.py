from hypothesis import given
from hypothesis import strategies as st
from joshua_emulator.feetech.packets import status_packet
from joshua_servo.reply import Reply
from joshua_sts3215.packet import PING, READ, Search, request

replies = st.builds(Reply, st.integers(0, 253), st.integers(0, 255), st.binary(max_size=20))


def test_the_vendors_example_packets() -> None:
    assert request(1, PING) == bytes.fromhex("ffff010201fb")
    assert request(1, READ, b"\x38\x02") == bytes.fromhex("ffff0104023802be")


@given(st.lists(replies, max_size=5), st.integers(1, 30))
def test_replies_are_found_in_pieces(expected: list[Reply], size: int) -> None:
    stream = b"".join(status_packet(*reply) for reply in expected)
    search = Search()
    found = [r for at in range(0, len(stream), size) for r in search.feed(stream[at : at + size])]
    assert found == expected
    assert search.broken == 0


@given(replies, st.data())
def test_a_flipped_bit_is_never_taken_for_a_reply(reply: Reply, data: st.DataObject) -> None:
    packet = bytearray(status_packet(*reply))
    bit = data.draw(st.integers(0, len(packet) * 8 - 1))
    packet[bit // 8] ^= 1 << bit % 8
    assert list(Search().feed(bytes(packet))) in (
        [],
        [reply],
    )  # a flip in the header's first byte may be mended


def test_noise_and_a_broken_packet_before_a_good_one() -> None:
    good = status_packet(2, 0, b"\x01\x02")
    broken = bytearray(status_packet(1, 0, b"\x05\x06"))
    broken[-1] ^= 0x40
    search = Search()
    assert list(search.feed(b"\x00\xff\x13" + bytes(broken) + good)) == [Reply(2, 0, b"\x01\x02")]
    assert search.broken >= 1


@given(st.lists(st.binary(max_size=30), max_size=10))
def test_any_bytes_are_survived_and_every_reply_is_whole(chunks: list[bytes]) -> None:
    search = Search()
    found = [reply for chunk in chunks for reply in search.feed(chunk)]
    stream = b"".join(chunks)
    for reply in found:
        assert status_packet(*reply) in stream
    assert len(search.rest) <= 259
