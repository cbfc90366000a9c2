"""Which QoS profiles connect, and which settings act only between our own nodes.

Source: OMG DDS 1.4, section 2.2.3 (requested against offered), and ROS 2's rmw_zenoh, which carries
deadline, lifespan and liveliness in its graph but does not act on them.
"""

from __future__ import annotations

from joshua.plan import QosProfile


def incompatibilities(offered: QosProfile, requested: QosProfile) -> list[str]:
    """Why a publisher's profile does not serve a subscription's; empty if it does.

    Args:
        offered: the publisher's profile.
        requested: the subscription's profile.
    """
    found = []
    if requested.reliability == "RELIABLE" and offered.reliability == "BEST_EFFORT":
        found.append("reliability: the publisher offers BEST_EFFORT, the subscription asks for RELIABLE")
    if requested.durability == "TRANSIENT_LOCAL" and offered.durability == "VOLATILE":
        found.append("durability: the publisher offers VOLATILE, the subscription asks for TRANSIENT_LOCAL")
    if requested.liveliness == "MANUAL_BY_TOPIC" and offered.liveliness == "AUTOMATIC":
        found.append("liveliness: the publisher offers AUTOMATIC, the subscription asks for MANUAL_BY_TOPIC")
    for label, offer, request in (
        ("deadline", offered.deadline_s, requested.deadline_s),
        ("lease duration", offered.lease_duration_s, requested.lease_duration_s),
    ):
        # 0 stands for no limit, the longest there is
        if request and (not offer or offer > request):
            given = f"{offer:g} s" if offer else "none"
            found.append(f"{label}: the publisher offers {given}, the subscription asks for {request:g} s")
    return found


def effective_qos_notes(kind: str, qos: QosProfile) -> list[str]:
    """Notes for the start-up table on settings that do not act everywhere.

    Args:
        kind: ``zenoh`` or ``dds``.
        qos: the profile in force.
    """
    if kind != "zenoh":
        return []
    settings = [
        name
        for name, used in (
            ("deadline", qos.deadline_s > 0),
            ("lifespan", qos.lifespan_s > 0),
            ("lease duration", qos.lease_duration_s > 0),
            ("manual liveliness", qos.liveliness == "MANUAL_BY_TOPIC"),
        )
        if used
    ]
    if not settings:
        return []
    verb, them = ("acts", "it") if len(settings) == 1 else ("act", "them")
    return [
        f"{', '.join(settings)} {verb} between JOSHUA nodes only: "
        f"ROS 2's Zenoh middleware does not apply {them}"
    ]
