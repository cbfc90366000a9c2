"""The common base of actuators and sensors, and the context of a driver beside its settings."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from joshua.devices.errors import DeviceError
from joshua.devices.stamps import StampClock
from joshua.node.errors import Cancelled
from joshua.plan.facts import ActuatorFacts, NodeFacts, SensorFacts

if TYPE_CHECKING:
    from joshua.devices.actuator import Actuator
    from joshua.plan import NodeSpec

FactsT = TypeVar("FactsT", bound=NodeFacts)


def _never() -> bool:
    return False


def _nothing() -> None:
    return None


@dataclass(frozen=True)
class DeviceContext(Generic[FactsT]):
    """The context of a driver. The defaults are those of a driver outside a run.

    Attributes:
        facts: the facts of the device from the plan.
        log: the node's logger.
        clock: acquisition stamps, in simulated time if the node follows it.
        stopping: whether the run is ending. A long ``connect`` polls it and raises ``Cancelled``.
        before_torque_off: called before a protection switches the torque off, which may take several cycles.
        remembered: the safe-stop request of the previous driver in the same run; empty if there was none.
    """

    facts: FactsT
    log: logging.Logger = field(default_factory=lambda: logging.getLogger("joshua.device"))
    clock: StampClock = field(default_factory=StampClock)
    stopping: Callable[[], bool] = _never
    before_torque_off: Callable[[], None] = _nothing
    remembered: Mapping[str, Any] = field(default_factory=dict)

    def raise_if_stopping(self) -> None:
        """Raises Cancelled if the run is ending."""
        if self.stopping():
            raise Cancelled("asked to stop")


ActuatorContext = DeviceContext[ActuatorFacts]
SensorContext = DeviceContext[SensorFacts]


def open_driver(spec: NodeSpec) -> Actuator:
    """Create the driver of an actuator in a plan, without connecting it.

    Raises:
        TargetError: its plugin does not provide what it declares.
    """
    from joshua.devices.actuator import Actuator
    from joshua.node.implementation import load_implementation

    implementation, settings = load_implementation(spec, Actuator)
    driver: Actuator = implementation(settings, ActuatorContext(spec.facts_as(ActuatorFacts)))
    return driver


class Device(ABC):
    """A device that is open between ``connect`` and ``disconnect``."""

    @property
    @abstractmethod
    def connected(self) -> bool:
        """Whether the device is open."""

    @abstractmethod
    def connect(self) -> None:
        """Opens and checks the device without changing the torque of joints. Raises DeviceError."""

    @abstractmethod
    def disconnect(self) -> None:
        """Closes the device. Idempotent."""

    def require_connected(self, verb: str) -> None:
        """Refuses a call that needs an open device, such as ``read``. Raises DeviceError."""
        if not self.connected:
            raise DeviceError(f"{type(self).__name__}.{verb}: the device is not open: call connect first")
