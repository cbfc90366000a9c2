"""The values on the road from text to processes: inert, printable, JSON.

The plan itself is loaded at first use: a file is checked without it, and it needs pydantic.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from joshua.plan.diagnostic import Diagnostic, Position, Related, Severity
from joshua.plan.lazy import lazy_names
from joshua.plan.qos import QosProfile

if TYPE_CHECKING:
    from joshua.plan.facts import (
        ActuatorFacts,
        ChosenEnvironment,
        Commander,
        ModelFacts,
        NodeFacts,
        OnStale,
        RunFacts,
        SafeStop,
        SensorFacts,
        ServiceFacts,
    )
    from joshua.plan.joints import JointRange
    from joshua.plan.node_spec import NodeKind, NodeSpec, TopicSpec
    from joshua.plan.plan import Plan, TlsSpec, TransportSettings
    from joshua.plan.report import CheckResult, JointTrace, NodeReport, RunReport, TimerReport, TopicReport

__all__ = [
    "ActuatorFacts",
    "CheckResult",
    "ChosenEnvironment",
    "Commander",
    "Diagnostic",
    "JointRange",
    "JointTrace",
    "ModelFacts",
    "NodeFacts",
    "NodeKind",
    "NodeReport",
    "NodeSpec",
    "OnStale",
    "Plan",
    "Position",
    "QosProfile",
    "Related",
    "RunFacts",
    "RunReport",
    "SafeStop",
    "SensorFacts",
    "ServiceFacts",
    "Severity",
    "TimerReport",
    "TlsSpec",
    "TopicReport",
    "TopicSpec",
    "TransportSettings",
]

_LATER = {
    "joshua.plan.joints": ("JointRange",),
    "joshua.plan.facts": (
        "ActuatorFacts",
        "ChosenEnvironment",
        "Commander",
        "ModelFacts",
        "NodeFacts",
        "OnStale",
        "RunFacts",
        "SafeStop",
        "SensorFacts",
        "ServiceFacts",
    ),
    "joshua.plan.node_spec": ("NodeKind", "NodeSpec", "TopicSpec"),
    "joshua.plan.plan": ("Plan", "TlsSpec", "TransportSettings"),
    "joshua.plan.report": (
        "CheckResult",
        "JointTrace",
        "NodeReport",
        "RunReport",
        "TimerReport",
        "TopicReport",
    ),
}

__getattr__, __dir__ = lazy_names(__name__, _LATER)
