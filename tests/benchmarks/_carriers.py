"""What a benchmark sends over: our own transports, and bare ones as references."""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import shutil
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from _harness import NULL
from joshua.messages import decode, encode
from joshua.plan import QosProfile, TransportSettings
from joshua.testing.transport import transport_settings

Place = dict[str, Any]
Callback = Callable[[Any], None]
Send = Callable[[Any], None]
Close = Callable[[], None]

_HEAD = struct.Struct("<I")
_RING_SLOTS = 8
_RING_SLOT_B = 1 << 20


@contextlib.contextmanager
def coordinator(carrier: str, place: Place) -> Iterator[None]:
    """What both sides need while they run: the Zenoh router, or a shared memory."""
    if "zenoh" in carrier:
        from joshua.transport import prepare_transport

        os.mkdir(_links(place), 0o700)
        handle = prepare_transport(_spec("zenoh", place))
        yield
        assert handle is not None
        handle.close()
        shutil.rmtree(_links(place))
    elif carrier == "shared-memory ring":
        ring = _ring_file(place)
        with open(ring, "wb") as file:
            file.truncate(_RING_SLOTS * _RING_SLOT_B)
        yield
        os.unlink(ring)
    else:
        yield


def sender(carrier: str, type_name: str, place: Place) -> tuple[Send, Close]:
    """Opens the sending side; returns how to send a message and how to close."""
    if carrier == NULL:
        return (lambda message: None), (lambda: None)
    opened: tuple[Send, Close] = _SENDERS[carrier](type_name, place)
    return opened


def receiver(carrier: str, type_name: str, place: Place, got: Callback) -> Close:
    """Opens the receiving side, which calls ``got`` with each decoded message; returns how to close."""
    opened: Close = _RECEIVERS[carrier](type_name, place, got)
    return opened


def _spec(kind: Any, place: Place) -> TransportSettings:
    endpoint = f"tcp/localhost:{place['port']}"
    settings = transport_settings(kind, domain_id=place["domain"], listen_endpoints=(endpoint,))
    return settings.model_copy(update={"link_folder": _links(place)}) if kind == "zenoh" else settings


def _links(place: Place) -> str:
    """Folder for the sockets between the two nodes, as a run has one."""
    return f"{place['path']}.links"


def _wait(condition: Callable[[], Any]) -> None:
    end_s = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end_s, "the other side did not come"
        time.sleep(0.005)


# --- ours -------------------------------------------------------------------------------------------


def _our_sender(kind: str) -> Callable[[str, Place], tuple[Send, Close]]:
    def open_one(type_name: str, place: Place) -> tuple[Send, Close]:
        from joshua.transport import open_transport

        transport = open_transport(_spec(kind, place))
        publisher = transport.create_node("sender").create_publisher("/bench", type_name, QosProfile())
        _wait(lambda: publisher.subscription_count)
        return (lambda message: publisher.publish(encode(message))), transport.close

    return open_one


def _our_receiver(kind: str) -> Callable[[str, Place, Callback], Close]:
    def open_one(type_name: str, place: Place, got: Callback) -> Close:
        from joshua.transport import open_transport

        transport = open_transport(_spec(kind, place))
        node = transport.create_node("receiver")
        node.create_subscription(
            "/bench", type_name, QosProfile(), lambda sample: got(decode(type_name, sample.cdr))
        )
        return transport.close

    return open_one


# --- UNIX socket ------------------------------------------------------------------------------------


def _socket_sender(type_name: str, place: Place) -> tuple[Send, Close]:
    link = socket.socket(socket.AF_UNIX)
    _wait(lambda: os.path.exists(place["path"]))
    link.connect(place["path"])

    def send(message: Any) -> None:
        cdr = encode(message)
        link.sendall(_HEAD.pack(len(cdr)))
        link.sendall(cdr)

    return send, link.close


def _socket_receiver(type_name: str, place: Place, got: Callback) -> Close:
    server = socket.socket(socket.AF_UNIX)
    server.bind(place["path"])
    server.listen()

    def serve() -> None:
        link, _ = server.accept()
        with link:
            while head := link.recv(_HEAD.size, socket.MSG_WAITALL):
                size = _HEAD.unpack(head)[0]
                buffer = bytearray(size)
                link.recv_into(buffer, size, socket.MSG_WAITALL)
                got(decode(type_name, buffer))

    threading.Thread(target=serve, daemon=True).start()

    def close() -> None:
        server.close()
        os.unlink(place["path"])

    return close


# --- shared memory, with a socket for the wake-up -----------------------------------------------------


def _ring_file(place: Place) -> str:
    folder = "/dev/shm" if os.path.isdir("/dev/shm") else "/tmp"
    return f"{folder}/{os.path.basename(place['path'])}"


def _ring_memory(place: Place) -> memoryview:
    with open(_ring_file(place), "r+b") as file:
        return memoryview(mmap.mmap(file.fileno(), 0))


def _ring_sender(type_name: str, place: Place) -> tuple[Send, Close]:
    bell = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    _wait(lambda: os.path.exists(place["path"]))
    bell.connect(place["path"])
    view, slot = _ring_memory(place), 0

    def send(message: Any) -> None:
        nonlocal slot
        cdr = encode(message)
        start = slot * _RING_SLOT_B
        view[start : start + len(cdr)] = cdr
        bell.send(struct.pack("<II", slot, len(cdr)))
        slot = (slot + 1) % _RING_SLOTS

    return send, bell.close


def _ring_receiver(type_name: str, place: Place, got: Callback) -> Close:
    memory = _ring_memory(place)
    bell = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    bell.bind(place["path"])

    def serve() -> None:
        while note := bell.recv(8):
            slot, size = struct.unpack("<II", note)
            start = slot * _RING_SLOT_B
            got(decode(type_name, bytes(memory[start : start + size])))

    threading.Thread(target=serve, daemon=True).start()
    return lambda: os.unlink(place["path"])


# --- the bare middlewares -----------------------------------------------------------------------------


def _zenoh_session(place: Place) -> Any:
    import zenoh

    config = zenoh.Config()
    for key, value in (
        ("mode", "peer"),
        ("scouting/multicast/enabled", False),
        ("scouting/delay", 200),
        ("listen/endpoints", ["tcp/localhost:0"]),
        ("connect/endpoints", [f"tcp/localhost:{place['port']}"]),
    ):
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def _zenoh_sender(type_name: str, place: Place) -> tuple[Send, Close]:
    session = _zenoh_session(place)
    publisher = session.declare_publisher("bench")
    _wait(lambda: publisher.matching_status.matching)
    return (lambda message: publisher.put(encode(message))), session.close


def _zenoh_receiver(type_name: str, place: Place, got: Callback) -> Close:
    import zenoh

    session = _zenoh_session(place)
    handler: Any = zenoh.handlers.Callback(
        lambda sample: got(decode(type_name, sample.payload.to_bytes())), indirect=False
    )
    session.declare_subscriber("bench", handler)
    close: Close = session.close
    return close


def _dds_parts(type_name: str, place: Place) -> tuple[Any, Any, Any, Any]:
    from cyclonedds.core import Policy, Qos
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.topic import Topic
    from joshua_dds.types import idl_type

    domain = Domain(
        place["domain"],
        '<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>'
        "<AllowMulticast>false</AllowMulticast><MaxMessageSize>65500B</MaxMessageSize>"
        "<FragmentSize>65000B</FragmentSize></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
        '<Peers><Peer Address="127.0.0.1"/></Peers></Discovery>',
    )
    participant = DomainParticipant(place["domain"])
    topic: Any = Topic(participant, "bench", idl_type(type_name))
    qos = Qos(
        Policy.Reliability.Reliable(1_000_000_000),
        Policy.History.KeepAll,
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
    )
    return domain, participant, topic, qos


def _dds_sender(type_name: str, place: Place) -> tuple[Send, Close]:
    from cyclonedds._clayer import ddspy_write
    from cyclonedds.pub import DataWriter

    _domain, participant, topic, qos = _dds_parts(type_name, place)
    writer: Any = DataWriter(participant, topic, qos=qos)
    _wait(writer.get_matched_subscriptions)

    def send(message: Any, keep: Any = (_domain, participant)) -> None:
        cdr = encode(message)
        ddspy_write(writer._ref, cdr + bytes(-len(cdr) % 4))

    return send, lambda: None


def _dds_receiver(type_name: str, place: Place, got: Callback) -> Close:
    from cyclonedds._clayer import ddspy_take
    from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
    from cyclonedds.internal import dds_infinity
    from cyclonedds.sub import DataReader

    domain, participant, topic, qos = _dds_parts(type_name, place)
    reader: Any = DataReader(participant, topic, qos=qos)
    mask = SampleState.Any | ViewState.Any | InstanceState.Any
    condition = ReadCondition(reader, mask)
    waitset: Any = WaitSet(participant)
    waitset.attach(condition)

    def serve(keep: Any = (domain, participant)) -> None:
        while True:
            waitset.wait(dds_infinity)
            for cdr, info in ddspy_take(reader._ref, mask, 10):
                if info.valid_data:
                    got(decode(type_name, cdr))

    threading.Thread(target=serve, daemon=True).start()
    return lambda: None


_SENDERS: dict[str, Any] = {
    "joshua-zenoh": _our_sender("zenoh"),
    "joshua-dds": _our_sender("dds"),
    "UNIX socket": _socket_sender,
    "shared-memory ring": _ring_sender,
    "plain zenoh": _zenoh_sender,
    "plain cyclonedds": _dds_sender,
}
_RECEIVERS: dict[str, Any] = {
    "joshua-zenoh": _our_receiver("zenoh"),
    "joshua-dds": _our_receiver("dds"),
    "UNIX socket": _socket_receiver,
    "shared-memory ring": _ring_receiver,
    "plain zenoh": _zenoh_receiver,
    "plain cyclonedds": _dds_receiver,
}
CARRIERS = tuple(_SENDERS)
