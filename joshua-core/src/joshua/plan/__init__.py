"""The values on the road from text to processes: inert, printable, JSON.

The plan itself is loaded at first use: a file is checked without it, and it needs pydantic.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from joshua.plan.diagnostic import Diagnostic as Diagnostic
from joshua.plan.diagnostic import Position as Position
from joshua.plan.diagnostic import Related as Related
from joshua.plan.diagnostic import Severity as Severity
from joshua.plan.lazy import lazy_names
from joshua.plan.qos import QosProfile as QosProfile

if TYPE_CHECKING:
    from joshua.plan.facts import *  # noqa: F403
    from joshua.plan.joints import JointRange as JointRange
    from joshua.plan.node_spec import *  # noqa: F403
    from joshua.plan.plan import *  # noqa: F403
    from joshua.plan.report import *  # noqa: F403

_LATER = {
    "joshua.plan.joints": ("JointRange",),
    "joshua.plan.facts": (
        *("ActuatorFacts", "ModelFacts", "NodeFacts", "RunFacts", "SensorFacts", "ServiceFacts"),
        *("ChosenEnvironment", "Commander", "OnStale", "SafeStop"),
    ),
    "joshua.plan.node_spec": ("NodeKind", "NodeSpec", "TopicSpec"),
    "joshua.plan.plan": ("Plan", "TlsSpec", "TransportSettings"),
    "joshua.plan.report": (
        *("CheckResult", "JointTrace", "NodeReport", "RunReport", "TimerReport", "TopicReport"),
    ),
}

__getattr__, __dir__ = lazy_names(__name__, _LATER)
