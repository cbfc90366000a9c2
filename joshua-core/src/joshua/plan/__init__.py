"""The values on the road from text to processes: inert, printable, JSON."""

from joshua.plan.diagnostic import Diagnostic, Position, Related, Severity
from joshua.plan.node_spec import NodeKind, NodeSpec, TopicSpec
from joshua.plan.plan import Plan, TlsSpec, TransportSpec
from joshua.plan.qos import QosProfile

__all__ = [
    "Diagnostic",
    "NodeKind",
    "NodeSpec",
    "Plan",
    "Position",
    "QosProfile",
    "Related",
    "Severity",
    "TlsSpec",
    "TopicSpec",
    "TransportSpec",
]
