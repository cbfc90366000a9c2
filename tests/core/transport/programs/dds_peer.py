"""An independent peer over DDS: cyclonedds with types written by hand, no code of JOSHUA.

It announces a ROS 2 node, publishes String on rt/from_peer, listens to JointState on rt/to_peer, and
says what it found. ``humble`` as second argument takes Humble's gids of 24 bytes and no type hashes.
``stock`` as third argument takes the settings of rmw_cyclonedds for the discovery range LOCALHOST.
"""

# mypy: ignore-errors
import json
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, bounded_str, float64, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

HUMBLE = sys.argv[2] == "humble"
GID_BYTES = 24 if HUMBLE else 16
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
CONFIG = """
<General>
  <Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast>
</General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer Address="127.0.0.1"/></Peers></Discovery>
"""


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str


@dataclass
class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    data: array[uint8, GID_BYTES]


@dataclass
class Node(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    node_namespace: bounded_str[256]
    node_name: bounded_str[256]
    reader_gid_seq: sequence[Gid]
    writer_gid_seq: sequence[Gid]


@dataclass
class Participant(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
    gid: Gid
    node_entities_info_seq: sequence[Node]


def gid(entity):
    return Gid(list(entity.guid.bytes.ljust(GID_BYTES, b"\0")))


STOCK = """
<General><AllowMulticast>false</AllowMulticast></General>
<Discovery>
  <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
  <Peers><Peer address="localhost"/></Peers>
</Discovery>
"""
domain = Domain(int(sys.argv[1]), STOCK if "stock" in sys.argv else CONFIG)
participant = DomainParticipant(int(sys.argv[1]), qos=Qos(Policy.Userdata(b"enclave=/;")))
reliable = Policy.Reliability.Reliable(100_000_000)
xcdr1 = Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False)
plain = Qos(reliable, Policy.History.KeepLast(10), xcdr1)
kept = Qos(reliable, Policy.Durability.TransientLocal, xcdr1)
hashes = Qos() if HUMBLE else Qos(Policy.Userdata(f"typehash={STRING_HASH};".encode()))
writer = DataWriter(participant, Topic(participant, "rt/from_peer", String), qos=plain + hashes)
reader = DataReader(participant, Topic(participant, "rt/to_peer", JointState), qos=plain)
info_topic = Topic(participant, "ros_discovery_info", Participant)
info_writer = DataWriter(participant, info_topic, qos=kept + Qos(Policy.History.KeepLast(1)))
info_reader = DataReader(participant, info_topic, qos=kept + Qos(Policy.History.KeepAll))
nodes = [Node("/bare", "dds_peer", [gid(reader)], [gid(writer)]), Node("/bare", "evil\x1b[2J", [], [])]
info_writer.write(Participant(gid(participant), nodes))
print("ready", flush=True)

heard, names = [], set()
end_s = time.monotonic() + 60
while time.monotonic() < end_s and not (heard and names):
    writer.write(String("hello from dds"))
    heard += [sample for sample in reader.take(10) if hasattr(sample, "header")]
    for sample in info_reader.take(10):
        names |= {
            (node.node_namespace, node.node_name) for node in getattr(sample, "node_entities_info_seq", [])
        }
    names -= {(node.node_namespace, node.node_name) for node in nodes}
    time.sleep(0.05)
talker = reader.get_matched_publication_data(reader.get_matched_publications()[0])
user_data = talker.qos[Policy.Userdata]
print(
    json.dumps(
        {
            "name": heard[0].name,
            "position": list(heard[0].position),
            "frame": heard[0].header.frame_id,
            "nodes": sorted(names),
            "type": talker.type_name,
            "user_data": bytes(talker.qos[Policy.Userdata].data).decode()
            if talker.qos[Policy.Userdata]
            else "",
        }
    ),
    flush=True,
)
while sys.stdin.readline() != "end\n":
    pass
