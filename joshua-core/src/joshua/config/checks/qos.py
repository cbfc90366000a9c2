"""Quality of service: compatible pairs, and settings with an effect.

Rules of the ROS 2 documentation, "Quality of Service settings", section "QoS compatibilities": a publisher
must offer at least what a subscription requests.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from joshua.config.checks.context import Context
from joshua.config.checks.identity import title
from joshua.plan import Diagnostic, Related
from joshua.plan.graph import Endpoint
from joshua.plan.qos import QosClash, qos_clashes
from joshua.textproto.field_facts import number_text

_MOST_PROFILES = 20


def check(context: Context) -> Iterator[Diagnostic]:
    """Compare the offers of each topic's publishers with the requests of its subscriptions."""
    for group in context.graph.by_topic.values():
        publishers = _different(item for item in group if item.is_publisher)
        for item in group:
            if not item.is_publisher:
                yield from _subscription(context, item, publishers)
    yield from _deadline(context)


def _remedy(clash: QosClash) -> str:
    field, offered, requested = clash
    if field.endswith("_s"):
        limit = requested.removesuffix(" s")
        return f"Set {field} in the publisher's qos to {limit} or less, or raise the subscription's"
    return f"Set {field}: {offered} in the subscription's qos, or {requested} in the publisher's"


def _different(publishers: Iterable[Endpoint]) -> list[Endpoint]:
    """One publisher per profile, up to a bound that no real topic reaches."""
    found: dict[tuple[object, ...], Endpoint] = {}
    for item in publishers:
        qos = item.qos
        key = (qos.reliability, qos.durability, qos.liveliness, qos.deadline_s, qos.lease_duration_s)
        found.setdefault(key, item)
        if len(found) >= _MOST_PROFILES:
            break
    return list(found.values())


def _subscription(context: Context, item: Endpoint, publishers: list[Endpoint]) -> Iterator[Diagnostic]:
    if not item.qos_path:
        return  # it adopts its publisher's profile
    reported = set()
    for publisher in publishers:
        for clash in qos_clashes(publisher.qos, item.qos):
            if clash.field in reported:
                continue
            reported.add(clash.field)
            path = f"{item.qos_path}.{clash.field}"
            yield context.error(
                "qos-incompatible",
                f"{title(publisher.entry)} offers {clash.field}: {clash.offered} on {item.topic} and "
                f"{title(item.entry)} requests {clash.requested}; ROS 2 does not connect such a pair",
                path,
                found=f"offered {clash.offered}, requested {clash.requested}",
                remedy=_remedy(clash),
                related=(*_offer(context, publisher, clash.field), *_request(context, item)),
            )


def _offer(context: Context, publisher: Endpoint, field: str) -> tuple[Related, ...]:
    if publisher.qos_path:
        return context.see(f"{publisher.qos_path}.{field}", "offered here")
    return context.see(f"{publisher.path}.topic_name", "offered here, by default")


def _request(context: Context, item: Endpoint) -> tuple[Related, ...]:
    """The subscription itself, if its node's profile applies to it."""
    if item.qos_path.startswith(item.path):
        return ()
    return context.see(f"{item.path}.topic_name", "subscription with this profile")


def _deadline(context: Context) -> Iterator[Diagnostic]:
    """Find deadlines shorter than the publisher's period, which every message misses."""
    said: set[tuple[str, str]] = set()  # a topic that a node publishes twice, which is a separate error
    for item in context.graph.endpoints:
        if not item.is_publisher:
            continue
        rate, deadline = item.block.publish_rate_hz, item.qos.deadline_s
        if not (rate > 0 and deadline > 0 and deadline * rate < 1):
            continue
        path = f"{item.qos_path}.deadline_s"
        if (path, item.topic) in said:
            continue
        said.add((path, item.topic))
        yield context.warning(
            "deadline-below-period",
            f"{title(item.entry)} publishes {item.topic} every {number_text(1 / rate)} s, "
            "so each message misses this deadline",
            path,
            allowed=(f"above {number_text(1 / rate)} s", "0 for none"),
            related=context.see(f"{item.path}.publish_rate_hz", "publish rate"),
        )
