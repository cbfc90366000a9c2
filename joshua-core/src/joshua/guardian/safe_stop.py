"""The contract of a safe stop: what brings a device into its safe state without its driver.

A guardian imports this with the plugin's own module, so it stays light: no numpy, no pydantic.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, Literal

ACTIONS = ("HOLD", "RELEASE", "PARK_THEN_RELEASE")
if TYPE_CHECKING:
    from typing_extensions import Self


#: What the device has confirmed of a joint's torque.
TorqueState = Literal["held", "released", "was off", "not verified"]


@dataclass(frozen=True)
class SafeStopResult:
    """What was reached, as read back from the device.

    Attributes:
        joints: state of each joint by its name, or by what names its motor to a person.
        action: that was carried out; detail: what stood in the way, "" where nothing did.
        duration_s: from the call to the verification.
    """

    joints: Mapping[str, TorqueState]
    action: str = ""
    detail: str = ""
    duration_s: float = 0.0

    @property
    def complete(self) -> bool:
        """Whether every joint has confirmed its safe state."""
        return all(state != "not verified" for state in self.joints.values())

    def to_values(self) -> dict[str, Any]:
        """Plain values for the report of a guardian."""
        return {**asdict(self), "complete": self.complete}


@dataclass(frozen=True)
class SafeStopRequest:
    """What is to be done to a device; a plugin derives its own, with what it needs to reach that device.

    ``ActuatorSpec.safe_stop`` names the class, and ``Actuator.safe_stop_request`` makes an object of it. Its
    fields go through JSON into the process that runs it.

    Attributes:
        action: ``HOLD`` (stay where they are; joints without torque stay so), ``RELEASE``, or
            ``PARK_THEN_RELEASE``.
        timeout_s: by when the result must stand.
    """

    action: str
    timeout_s: float = field(default=2.0, kw_only=True)

    def __post_init__(self) -> None:
        if self.action not in ACTIONS:
            raise ValueError(f"unknown safe-stop action {self.action!r}; allowed: {', '.join(ACTIONS)}")

    def run(self) -> SafeStopResult:
        """Takes the device, applies the safe state and verifies it; bounded by ``timeout_s``."""
        raise NotImplementedError(f"{type(self).__name__} does nothing: override run")

    def to_values(self) -> dict[str, Any]:
        """Plain values, as JSON has them."""
        values: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        return values

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> Self:
        """Reads what ``to_values`` wrote. Raises ValueError and TypeError."""
        return cls(**values)


def perform(kind: type[SafeStopRequest], values: Mapping[str, Any]) -> dict[str, Any]:
    """Runs a request of plain values and returns its result as such. Raises what the plugin raises.

    Raises:
        TypeError: ``run`` returned anything but a SafeStopResult.
    """
    result: object = kind.from_values(values).run()
    if not isinstance(result, SafeStopResult):
        raise TypeError(f"{kind.__name__}.run returned {type(result).__name__}, not a SafeStopResult")
    return result.to_values()
