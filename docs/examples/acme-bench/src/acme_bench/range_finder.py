"""The driver of the range finder: it sends ``R 01234`` and a line feed for each distance in millimetres."""

import re
import time
from typing import Any

from joshua.api import DeviceError, Reading, Sensor, SensorContext
from joshua.messages import message_class
from joshua.messages.make import header

from acme_bench.settings import RangeSettings, port_of

RANGE = "sensor_msgs/msg/Range"
FRAME = re.compile(rb"R (\d{5})\n")
FRAME_SIZE = 8


class RangeFinder(Sensor):
    """Yields distances in metres."""

    settings: RangeSettings

    def __init__(self, settings: RangeSettings, context: SensorContext | None = None) -> None:
        super().__init__(settings, context)
        self._port = port_of(settings)
        self._received = b""
        self._sequence = 0

    @property
    def data_types(self) -> tuple[str, ...]:
        """The one type of message."""
        return (RANGE,)

    @property
    def connected(self) -> bool:
        """Whether the port is open."""
        return self._port.is_open

    def connect(self) -> None:
        """Open the port. Raises DeviceError."""
        if self.connected:
            raise DeviceError(f"{self._port} is already open: call disconnect first")
        self._port.open()
        self._port.discard_input()  # measurements from before
        self._received, self._sequence = b"", 0

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for a distance; None if none arrives in time. Raises DeviceDisconnected."""
        self.require_connected("read")
        deadline_s = time.monotonic() + timeout_s
        while True:
            self._received += self._port.receive(FRAME_SIZE - len(self._received), deadline_s)
            if len(self._received) < FRAME_SIZE:
                return None
            frame, self._received = self._received, b""
            if match := FRAME.fullmatch(frame):
                self._sequence += 1
                return Reading(self.context.clock.now_ns(), self._sequence, int(match[1]) / 1000)
            self._received = frame.partition(b"\n")[2]  # begin with the next line

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Make the message; fields that are left out are 0."""
        return message_class(type_name)(
            header=header(frame_id, reading.stamp_ns),
            min_range=0.02,
            max_range=self.settings.max_m,
            range=reading.data,
        )

    def implausible(self, reading: Reading) -> str:
        """Say what cannot be true of a distance, for MODE_TEST."""
        return "" if 0.02 <= reading.data <= self.settings.max_m else f"{reading.data:g} m is out of range"

    def disconnect(self) -> None:
        """Close the port."""
        self._port.close()
