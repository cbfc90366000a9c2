"""Rotary encoders as a sensor: the joints of one serial link."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from joshua.api import DeviceError, DiagnosticStatus, Reading, Sensor, SensorContext
from joshua.messages.make import joint_state
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint

from joshua_encoder.settings import AMT21, LINE, EncoderSettings
from joshua_encoder.sources import Amt21Source, Counts, LineSource, Source
from joshua_encoder.tracker import Tracker

JOINT_STATE = "sensor_msgs/msg/JointState"

#: Share of damaged lines or replies above which a link is reported as faulty.
DAMAGED_SHARE = 0.01

#: Counts that may wait for a reader; older ones are dropped, the position stays correct.
_WAITING = 64


@dataclass(frozen=True)
class EncoderReading:
    """State of all encoders of a link, in the order of the settings.

    Attributes:
        ticks: multi-turn counts; position_rad, velocity_rad_s: of the shafts.
    """

    ticks: tuple[int, ...]
    position_rad: tuple[float, ...]
    velocity_rad_s: tuple[float, ...]


class SerialEncoder(Sensor):
    """Rotary encoders with a serial link; ``Reading.data`` is an ``EncoderReading``.

    Args:
        settings: link, protocol, resolution, names.
        context: of the node that drives it.
    """

    settings: EncoderSettings

    def __init__(self, settings: EncoderSettings, context: SensorContext | None = None) -> None:
        super().__init__(settings, context)
        endpoint = Endpoint(settings.port, settings.serial_number, settings.vid_pid, settings.device_root)
        self._port = SerialPort(endpoint, settings.baudrate)
        self._source: Source | None = None
        self._trackers: list[Tracker] = []
        self._ready: deque[Reading] = deque(maxlen=_WAITING)
        self._sequence = 0
        self._last_stamp_ns = 0

    @property
    def data_types(self) -> tuple[str, ...]:
        """Message types: joint state."""
        return (JOINT_STATE,)

    @property
    def connected(self) -> bool:
        """Whether the encoders are being read."""
        return self._source is not None

    @property
    def damaged(self) -> int:
        """Number of unusable lines or replies since the encoders were opened."""
        return self._source.damaged if self._source is not None else 0

    @property
    def counts(self) -> int:
        """Number of counts accepted since the encoders were opened."""
        return self._sequence

    def joints(self) -> list[tuple[str, str]]:
        """Return name and last state of each joint as text."""
        return [
            (name, f"{tracker.position_rad:+.3f} rad, {tracker.velocity_rad_s:+.2f} rad/s")
            for name, tracker in zip(self.settings.joint_names, self._trackers, strict=False)
        ]

    def connect(self) -> None:
        """Open the port and wait for the encoders.

        Raises:
            DeviceError: port or encoder is missing, busy, forbidden, silent, at another line speed or
                address, or uses another protocol. The message names port and remedy.
            Cancelled: the run ends.
        """
        if self.connected:
            raise DeviceError(f"{self._port} is already open: disconnect first")
        settings = self.settings
        self._port.baudrate = settings.baudrate
        self._port.open()
        try:
            kind = Amt21Source if settings.protocol == AMT21 else LineSource
            source = kind(self._port, settings)
            with self._port.obeying(self.context.stopping):
                source.start()
        except BaseException:
            self._port.close()
            raise
        self._trackers = self._trackers_from_now_on()
        self._sequence = 0
        self._ready.clear()
        self._source = source

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for the next counts.

        Raises:
            DeviceDisconnected: the adapter was unplugged, or the encoder delivers no usable data.
        """
        self.require_connected("read")
        source = self._source
        assert source is not None
        deadline_s = time.monotonic() + timeout_s
        while not self._ready:
            for counts in source.read(deadline_s):
                self._follow(counts)
            if time.monotonic() >= deadline_s:
                break
        return self._ready.popleft() if self._ready else None

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Return a JointState of all encoders of the link."""
        del type_name  # the only message type
        data: EncoderReading = reading.data
        return joint_state(
            self.settings.joint_names,
            data.position_rad,
            data.velocity_rad_s,
            frame_id=frame_id,
            at_ns=reading.stamp_ns,
        )

    def diagnostics(self) -> Sequence[DiagnosticStatus]:
        """Return one diagnostics row for the link, and one for each encoder as last read."""
        source = self._source
        if source is None or not self._sequence:
            return ()
        poor = source.damaged > DAMAGED_SHARE * self._sequence
        message = "the line damages data: check cable and ground" if poor else "in order"
        protocol = self.settings.protocol
        values = {"counts": str(self._sequence), "damaged": str(source.damaged)}
        joints = [
            DiagnosticStatus(
                DiagnosticStatus.OK,
                name,
                "in order",
                protocol,
                {
                    "position_rad": f"{tracker.position_rad:+.4f}",
                    "velocity_rad_s": f"{tracker.velocity_rad_s:+.3f}",
                    "ticks": str(tracker.ticks),
                },
            )
            for name, tracker in zip(self.settings.joint_names, self._trackers, strict=True)
        ]
        return (
            DiagnosticStatus(
                DiagnosticStatus.WARN if poor else DiagnosticStatus.OK, "link", message, protocol, values
            ),
            *joints,
        )

    def disconnect(self) -> None:
        """Close the port. Idempotent."""
        self._source = None
        self._port.close()
        self._ready.clear()

    def _trackers_from_now_on(self) -> list[Tracker]:
        """Keep the trackers of absolute encoders; a microcontroller may restart at 0."""
        settings = self.settings
        counts_turns_itself = settings.protocol == LINE
        if self._trackers and not counts_turns_itself:
            for tracker in self._trackers:
                tracker.resume()
            return self._trackers
        modulus = settings.counter_range if counts_turns_itself else settings.resolution
        return [
            Tracker(settings.resolution, modulus, inverted=settings.inverted) for _ in settings.joint_names
        ]

    def _follow(self, counts: Counts) -> None:
        for tracker, count in zip(self._trackers, counts.counts, strict=True):
            tracker.add(count, counts.time_ns)
        self._last_stamp_ns = max(counts.stamp_ns, self._last_stamp_ns + 1)
        data = EncoderReading(
            tuple(tracker.ticks for tracker in self._trackers),
            tuple(tracker.position_rad for tracker in self._trackers),
            tuple(tracker.velocity_rad_s for tracker in self._trackers),
        )
        self._ready.append(Reading(self._last_stamp_ns, self._sequence, data))
        self._sequence += 1
