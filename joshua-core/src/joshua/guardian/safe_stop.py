"""The contract of a safe stop, which brings a device into its safe state without its driver.

A guardian imports this with the plugin's module, so it stays light: no numpy, no pydantic.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, Literal

ACTIONS = ("HOLD", "RELEASE", "PARK_THEN_RELEASE")
if TYPE_CHECKING:
    from typing_extensions import Self


#: Torque of a joint, as confirmed by the device.
TorqueState = Literal["held", "released", "was off", "not verified"]


@dataclass(frozen=True)
class SafeStopResult:
    """Result of a safe stop, as read back from the device.

    Attributes:
        joints: state of each joint by its name, or by the name of its motor.
        action: that was carried out; detail: what prevented the safe state, "" for nothing.
        duration_s: from the call to the verification.
    """

    joints: Mapping[str, TorqueState]
    action: str = ""
    detail: str = ""
    duration_s: float = 0.0

    @property
    def complete(self) -> bool:
        """Whether every joint confirmed its safe state."""
        return all(state != "not verified" for state in self.joints.values())

    def to_values(self) -> dict[str, Any]:
        """Values for the report of a guardian."""
        return {**asdict(self), "complete": self.complete}


@dataclass(frozen=True)
class SafeStopRequest:
    """Request of a safe stop. A plugin derives a class with the fields that it needs to reach its device.

    ``ActuatorSpec.safe_stop`` names the class and ``Actuator.safe_stop_request`` creates the object. Its
    fields are sent as JSON to the process that runs it.

    Attributes:
        action: ``HOLD`` (joints with torque hold, the others stay off), ``RELEASE``, or
            ``PARK_THEN_RELEASE``.
        timeout_s: for the result.
    """

    action: str
    timeout_s: float = field(default=2.0, kw_only=True)

    def __post_init__(self) -> None:
        if self.action not in ACTIONS:
            raise ValueError(f"unknown safe-stop action {self.action!r}; allowed: {', '.join(ACTIONS)}")

    def run(self) -> SafeStopResult:
        """Opens the device, applies the safe state and verifies it within ``timeout_s``."""
        raise NotImplementedError(f"{type(self).__name__} does not override run")

    def read_torque(self) -> Mapping[str, bool] | None:
        """Opens the device and reads within ``timeout_s`` which joints have torque; writes nothing.

        Returns:
            Whether each joint has torque, by its name or that of its motor; None if the device cannot tell.

        Raises what the device raises.
        """
        return None

    def to_values(self) -> dict[str, Any]:
        """Values as in JSON."""
        values: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        return values

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> Self:
        """Reads the result of ``to_values``. Raises ValueError and TypeError."""
        return cls(**values)


def perform(kind: type[SafeStopRequest], values: Mapping[str, Any]) -> dict[str, Any]:
    """Runs a request and returns its result, both as plain values. Raises what the plugin raises.

    Raises:
        TypeError: ``run`` returned anything but a SafeStopResult.
    """
    result: object = kind.from_values(values).run()
    if not isinstance(result, SafeStopResult):
        raise TypeError(f"{kind.__name__}.run returned {type(result).__name__}, not a SafeStopResult")
    return result.to_values()
