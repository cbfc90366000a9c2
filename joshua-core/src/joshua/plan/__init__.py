"""The values on the road from text to processes: inert, printable, JSON."""

from joshua.plan.diagnostic import Diagnostic, Position, Related, Severity
from joshua.plan.node_spec import NodeKind, NodeSpec, TopicSpec
from joshua.plan.plan import Plan, TlsSpec, TransportSpec
from joshua.plan.qos import QosProfile
from joshua.plan.report import CheckResult, NodeReport, RunReport, TimerReport, TopicReport

__all__ = [
    "CheckResult",
    "Diagnostic",
    "NodeKind",
    "NodeReport",
    "NodeSpec",
    "Plan",
    "Position",
    "QosProfile",
    "Related",
    "RunReport",
    "Severity",
    "TimerReport",
    "TlsSpec",
    "TopicReport",
    "TopicSpec",
    "TransportSpec",
]
