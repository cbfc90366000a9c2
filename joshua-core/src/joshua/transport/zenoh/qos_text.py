"""QoS profiles as rmw_zenoh writes them into liveliness tokens.

Format: ``reliability:durability:history,depth:deadline s,ns:lifespan s,ns:liveliness,lease s,ns``, with
the numbers of rmw/types.h; a field that equals the middleware's default is empty.
Source: ros2/rmw_zenoh, liveliness_utils.cpp (qos_to_keyexpr) and qos.cpp.
"""

from __future__ import annotations

from joshua.plan import QosProfile

_NS_PER_S = 1_000_000_000
_DEFAULT_DEPTH = 42  # of the middleware; a depth of 42 is written as an empty field
_INFINITE_S = 9_223_372_036


def write_qos(qos: QosProfile) -> str:
    """The text of a profile."""
    reliability = "2" if qos.reliability == "BEST_EFFORT" else ""
    durability = "1" if qos.durability == "TRANSIENT_LOCAL" else ""
    history = "2" if qos.history == "KEEP_ALL" else ""
    depth = "" if qos.depth == _DEFAULT_DEPTH else str(qos.depth)
    liveliness = "3" if qos.liveliness == "MANUAL_BY_TOPIC" else ""
    return ":".join(
        (
            reliability,
            durability,
            f"{history},{depth}",
            _write_duration(qos.deadline_s),
            _write_duration(qos.lifespan_s),
            f"{liveliness},{_write_duration(qos.lease_duration_s)}",
        )
    )


def read_qos(text: str) -> QosProfile:
    """The profile of a text; what our profiles cannot say takes the nearest meaning.

    Raises:
        ValueError: the text does not have the format.
    """
    parts = text.split(":")
    if len(parts) < 6:
        raise ValueError(f"a QoS text has six parts, not {len(parts)}: {text!r}")
    history, depth = parts[2].split(",")[:2]
    liveliness, lease_s, lease_ns = parts[5].split(",")[:3]
    return QosProfile(
        reliability="BEST_EFFORT" if parts[0] == "2" else "RELIABLE",
        durability="TRANSIENT_LOCAL" if parts[1] == "1" else "VOLATILE",
        history="KEEP_ALL" if history == "2" else "KEEP_LAST",
        depth=int(depth) if depth else _DEFAULT_DEPTH,
        deadline_s=_read_duration(*parts[3].split(",")[:2]),
        lifespan_s=_read_duration(*parts[4].split(",")[:2]),
        liveliness="MANUAL_BY_TOPIC" if liveliness == "3" else "AUTOMATIC",
        lease_duration_s=_read_duration(lease_s, lease_ns),
    )


def _write_duration(duration_s: float) -> str:
    if duration_s <= 0:
        return ","
    seconds, nanoseconds = divmod(round(duration_s * _NS_PER_S), _NS_PER_S)
    return f"{seconds},{nanoseconds}"


def _read_duration(seconds: str, nanoseconds: str) -> float:
    whole = int(seconds) if seconds else _INFINITE_S
    if whole >= _INFINITE_S:
        return 0.0
    return whole + int(nanoseconds or 0) / _NS_PER_S
