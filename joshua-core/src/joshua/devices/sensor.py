"""The base class of sensors: devices with stamped readings."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from joshua.devices.context import Device, SensorContext
from joshua.devices.diagnostics import DiagnosticStatus
from joshua.plan.facts import SensorFacts


@dataclass(frozen=True)
class Reading:
    """One acquisition of a sensor.

    Attributes:
        stamp_ns: acquisition time, ns since the epoch.
        sequence: number of the acquisition, from 0. Gaps are frames that the device dropped.
        data: the acquired data. The sensor's documentation states shape and unit.
    """

    stamp_ns: int
    sequence: int
    data: Any


class Sensor(Device):
    """A device that provides readings.

    Order: constructor (no I/O) → ``connect`` → ``read``… → ``disconnect`` (idempotent; leaves no
    thread and no file handle).

    Args:
        settings: the model that its ``SensorSpec`` names.
        context: of the node that drives it; None for a driver outside a run.
    """

    def __init__(self, settings: Any, context: SensorContext | None = None) -> None:
        self.settings = settings
        self.context = context or SensorContext(SensorFacts())

    @property
    @abstractmethod
    def data_types(self) -> tuple[str, ...]:
        """ROS 2 types that ``message`` can make, such as ``sensor_msgs/msg/Image``."""

    @abstractmethod
    def read(self, timeout_s: float) -> Reading | None:
        """Waits for the next reading, never the same one twice; None if none arrives in time.

        Raises DeviceDisconnected.
        """

    @abstractmethod
    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Makes the ROS 2 message of a reading, stamped with its acquisition time."""

    def implausible(self, reading: Reading) -> str:
        """Why a reading is implausible, one sentence for MODE_TEST; "" if it is plausible."""
        del reading
        return ""

    def diagnostics(self) -> Sequence[DiagnosticStatus]:
        """Rows for ``/diagnostics`` in addition to the node's own. Called while ``read`` runs.

        Do no input or output here.
        """
        return ()
