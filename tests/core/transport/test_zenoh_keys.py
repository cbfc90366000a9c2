"""Keys, tokens and attachments byte by byte, as rmw_zenoh writes them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.messages import select_distro
from joshua.plan import QosProfile
from joshua.transport.zenoh.keys import (
    ATTACHMENT,
    NODE,
    PUBLISHER,
    Entity,
    data_key,
    gid_of,
    read_qos,
    read_token,
    write_qos,
)

HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


def test_data_keys():
    assert data_key(7, "/left/chatter", "std_msgs/msg/String") == (
        f"7/left/chatter/std_msgs::msg::dds_::String_/{HASH}"
    )
    select_distro("humble")
    assert data_key(0, "/chatter", "std_msgs/msg/String") == (
        "0/chatter/std_msgs::msg::dds_::String_/TypeHashNotSupported"
    )


def test_tokens():
    node = Entity(2, "aac3178e146ba6f1fc6e6a4085e77f21", "0", "0", NODE, "/", "/", "talker")
    assert node.token == "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/talker"
    publisher = Entity(
        2, "aac3178e146ba6f1fc6e6a4085e77f21", "0", "10", PUBLISHER, "/", "/left", "talker",
        "/left/chatter", "std_msgs::msg::dds_::String_", HASH, QosProfile(),
    )  # fmt: skip
    # the form of the example in rmw_zenoh's design document
    assert publisher.token == (
        "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MP/%/%left/talker/%left%chatter/"
        f"std_msgs::msg::dds_::String_/{HASH}/::,10:,:,:,,"
    )
    assert read_token(node.token) == node
    assert read_token(publisher.token) == publisher


def test_gids_are_the_xxh3_of_the_token_low_half_first():
    # XXH3_128bits("", 0) of the reference implementation: low 6001c324468d497f, high 99aa06d3014798d8
    assert gid_of("").hex() == "7f498d4624c30160" + "d8984701d306aa99"


def test_attachments():
    packed = ATTACHMENT.pack(1, 2, 16, bytes(range(16)))
    assert packed.hex() == "0100000000000000" + "0200000000000000" + "10" + bytes(range(16)).hex()


@pytest.mark.parametrize(
    ("profile", "text"),
    [
        (QosProfile(), "::,10:,:,:,,"),
        (QosProfile(depth=42), "::,:,:,:,,"),
        (QosProfile(reliability="BEST_EFFORT", depth=5), "2::,5:,:,:,,"),
        (QosProfile(durability="TRANSIENT_LOCAL", depth=1), ":1:,1:,:,:,,"),
        (QosProfile(history="KEEP_ALL", depth=10), "::2,10:,:,:,,"),
        (QosProfile(deadline_s=0.1), "::,10:0,100000000:,:,,"),
        (QosProfile(lifespan_s=2.5), "::,10:,:2,500000000:,,"),
        (QosProfile(liveliness="MANUAL_BY_TOPIC", lease_duration_s=1), "::,10:,:,:3,1,0"),
    ],
)
def test_qos_texts(profile, text):
    assert write_qos(profile) == text
    assert read_qos(text) == profile


def test_infinite_durations_mean_none():
    assert (
        read_qos("1:2:1,10:9223372036,854775807:9223372036,854775807:1,9223372036,854775807") == QosProfile()
    )


@pytest.mark.parametrize(
    "token",
    [
        *("", "a/b", "@ros2_lv/0/z/0/0/XX/%/%/n", "@ros2_lv/x/z/0/0/NN/%/%/n", "@ros2_lv/0/z/0/1/MP/%/%/n"),
        "@ros2_lv/0/z/0/0/NN/%/%/n\x1b[2J",
    ],
)
def test_other_keys_are_no_tokens(token):
    with pytest.raises(ValueError, match=r".+"):
        read_token(token)


@given(st.text(max_size=40))
def test_odd_qos_texts_never_crash_the_graph(text):
    token = f"@ros2_lv/0/z/0/1/MP/%/%/n/%t/a::msg::dds_::B_/{HASH}/{text}"
    try:
        entity = read_token(token)
    except ValueError:
        return
    assert entity.qos is not None
