"""The laser scanner as a sensor."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from joshua.api import DeviceDisconnected, DeviceError, DiagnosticStatus, Reading, Sensor, SensorContext
from joshua.api.clocks import AwakeClock, StampClock
from joshua.messages import message_class
from joshua.messages.make import header
from joshua_serial.port import BITS_PER_BYTE, SerialPort
from joshua_serial.usb_ports import Endpoint

from joshua_lidar.arrivals import Arrivals
from joshua_lidar.assembly import Beams, Scan, TurnAssembler
from joshua_lidar.detection import detect, explain
from joshua_lidar.figures import DAMAGED_SHARE, FigureKeeper, Figures
from joshua_lidar.links import LINKS, Link, NoAnswerError
from joshua_lidar.models import MODELS, Model
from joshua_lidar.motor_watch import MotorWatch
from joshua_lidar.samples import Parser
from joshua_lidar.settings import LidarSettings
from joshua_lidar.stop_bytes import STILL_DTR, STOP_BYTES

LASER_SCAN = "sensor_msgs/msg/LaserScan"

#: Longest wait for the first scan; motors take seconds to come up to speed.
FIRST_SCAN_S = 10.0

#: Longest wait for the first packet; some scanners send none until they reach their speed.
FIRST_PACKET_S = 5.0

#: Longest time without a byte, without a valid packet, and without a complete turn; stalls of this process do
#: not count.
SILENT_S = 2.0
NO_PACKET_S = 2.5
NO_TURN_S = 3.0

_CHUNK_S = 0.01
_LARGEST_CHUNK = 255

# After a stall the reader finds many bytes, which the system delivers in chunks with short gaps.
_PIECE = 4096
_PIECE_S = 0.002
_LARGEST_BACKLOG = 1 << 17

#: More than any scanner sends in such a gap.
_MORE_COMES = 512


class SerialLidar(Sensor):
    """A laser scanner with a serial link.

    ``Reading.data`` is a ``Scan``: one turn. Its stamp is the time of its first beam.

    Args:
        settings: link, window, ranges and model.
        context: of the node that drives it.
    """

    settings: LidarSettings

    def __init__(self, settings: LidarSettings, context: SensorContext | None = None) -> None:
        super().__init__(settings, context)
        endpoint = Endpoint(settings.port, settings.serial_number, settings.vid_pid, settings.device_root)
        self._port = SerialPort(endpoint, settings.baudrate)
        self._cancelled = threading.Event()
        self._link: Link | None = None
        self._watch: MotorWatch | None = None
        self._parser: Parser | None = None
        self._assembler: TurnAssembler | None = None
        self._ready: deque[Scan] = deque()
        self._clock = StampClock()
        self._keeper = FigureKeeper()
        self._arrivals = Arrivals(settings.baudrate)
        self._sequence = 0
        self._last_stamp_ns = 0
        self._awake = AwakeClock()
        self._byte_s = self._packet_s = self._turn_s = 0.0
        self.model: Model | None = MODELS.get(settings.model)
        self.beams: Beams | None = None

    @property
    def data_types(self) -> tuple[str, ...]:
        """Message types: laser scan."""
        return (LASER_SCAN,)

    @property
    def connected(self) -> bool:
        """Whether the scanner is running."""
        return self._parser is not None

    @property
    def figures(self) -> Figures:
        """Statistics since the scanner was last opened."""
        return self._keeper.figures()

    @property
    def facts(self) -> str:
        """Description of the scanner; "" before it was opened."""
        if self._link is None:
            return ""
        return self._link.facts or self._link.model.title

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the scanner, available after it was opened."""
        return tuple(self._link.warnings) if self._link is not None else ()

    def cancel(self) -> None:
        """Abort a waiting ``connect``. Thread-safe."""
        self._cancelled.set()

    def connect(self) -> None:
        """Open the port, find the scanner, start its motor and wait for the first whole turn.

        Raises:
            DeviceError: port or scanner is missing, busy, forbidden, of another model, at another line speed,
                or does not turn. The message names port and remedy. The motor is then off.
            Cancelled: the run ends; the motor is then off.
        """
        if self.connected:
            raise DeviceError(f"{self._port} is already open: disconnect first")
        self._port.baudrate = self.settings.baudrate
        self._port.open()
        try:
            with self._port.obeying(self.context.stopping):
                self._start()
                self._await_first_scan()
        except BaseException:
            self.disconnect()
            raise

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for the next turn.

        Raises:
            DeviceDisconnected: the adapter was unplugged, the scanner sends nothing, its motor stopped, or
                its line is too noisy.
        """
        self.require_connected("read")
        deadline_s = time.monotonic() + timeout_s
        while not self._ready:
            if time.monotonic() >= deadline_s or self._cancelled.is_set():
                return None
            self._receive(deadline_s)
            self._check_alive()
        scan = self._ready.popleft()
        reading = Reading(scan.stamp_ns, self._sequence, scan)
        self._sequence += 1
        return reading

    def message(self, reading: Reading, type_name: str, frame_id: str) -> Any:
        """Return a LaserScan; beam i was measured at stamp + i * time_increment."""
        scan: Scan = reading.data
        beams = self.beams
        assert beams is not None
        return message_class(type_name)(
            header=header(frame_id, reading.stamp_ns),
            angle_min=beams.angle_min_rad,
            angle_max=beams.angle_max_rad,
            angle_increment=beams.increment_rad,
            time_increment=scan.time_increment_s,
            scan_time=scan.turn_s,
            range_min=self.settings.range_min_m,
            range_max=self.settings.range_max_m,
            ranges=scan.ranges_m,
            intensities=scan.intensities,
        )

    def implausible(self, reading: Reading) -> str:
        """Report ranges outside the limits, and scans without any measurement."""
        scan: Scan = reading.data
        measured = scan.ranges_m[np.isfinite(scan.ranges_m)]
        low, high = np.float32(self.settings.range_min_m), np.float32(self.settings.range_max_m)
        outside = int(((measured < low) | (measured > high)).sum())
        if outside:
            return f"{outside} ranges lie outside {low} m to {high} m"
        if np.isnan(scan.ranges_m).all():
            return "no beam measured anything: check whether its window is covered"
        return ""

    def diagnostics(self) -> Sequence[DiagnosticStatus]:
        """Return one diagnostics row: rotation and condition of the line."""
        link, figures = self._link, self.figures
        if link is None or not figures.turns:
            return ()
        damaged = figures.damaged > DAMAGED_SHARE * figures.packets
        message = "the line damages packets: check cable and ground" if damaged else "in order"
        values = {
            "turn_hz": f"{figures.turn_hz:.2f}",
            "points": str(figures.points),
            "beams_measured": f"{figures.coverage:.2f}",
            "packets": str(figures.packets),
            "damaged": str(figures.damaged),
        }
        return (
            DiagnosticStatus(
                DiagnosticStatus.WARN if damaged else DiagnosticStatus.OK,
                "scanner",
                message,
                self.facts,
                values,
            ),
        )

    def disconnect(self) -> None:
        """Stop the motor and close the port. Idempotent."""
        self._parser = None
        if self._link is not None and self._port.is_open:
            self._link.stop()
        self._port.close()
        if self._watch is not None:
            self._watch.close()
            self._watch = None
        self._ready.clear()

    def _start(self) -> None:
        port, settings = self._port, self.settings
        model = MODELS.get(settings.model)
        if model is None:
            found = detect(port)
            if not found:
                raise explain(port, None)
            model = MODELS[found]
        self.model = model
        self._link = LINKS[model.family](port, model)
        if STOP_BYTES[model.name]:  # before the motor runs
            still = STILL_DTR.get(model.name)
            self._watch = MotorWatch(port.entry.path, port.baudrate, STOP_BYTES[model.name], still)
        try:
            parser, rest = self._link.start(settings.scan_mode)
        except NoAnswerError:
            raise explain(port, model) from None
        beams = Beams.of(settings.angle_min_rad, settings.angle_max_rad, model.beams_in(settings.scan_mode))
        self.beams = beams
        self._assembler = TurnAssembler(
            beams, settings.range_min_m, settings.range_max_m, self._link.seam_rad
        )
        self._keeper = FigureKeeper()
        self._arrivals = Arrivals(port.baudrate)
        self._sequence = 0
        self._byte_s = self._packet_s = self._turn_s = self._awake.now_s()
        self._parser = parser
        self._take(rest, self._clock.now_ns())

    def _await_first_scan(self) -> None:
        deadline_s = self._awake.now_s() + FIRST_SCAN_S
        model = self.model
        assert model is not None
        while not self._ready:
            if self._cancelled.is_set():
                raise DeviceError(f"{self._port} was closed while opening: open it again")
            now_s = self._awake.now_s()
            heard = self._keeper.packets > 0
            if not heard and now_s - self._packet_s > FIRST_PACKET_S:
                self._stop_link()
                raise explain(self._port, model)
            if now_s > deadline_s:
                raise DeviceError(self._stalled())
            self._receive(time.monotonic() + _CHUNK_S)
        self._ready.clear()  # the motor was still speeding up

    def _stop_link(self) -> None:
        if self._link is not None:
            self._link.stop()

    def _receive(self, deadline_s: float) -> None:
        size = max(1, min(_LARGEST_CHUNK, round(self._port.baudrate / BITS_PER_BYTE * _CHUNK_S)))
        data = self._port.receive(size, min(deadline_s, time.monotonic() + 2 * _CHUNK_S))
        if not data:
            return
        if len(data) == size:
            data += self._backlog()
        self._byte_s = self._awake.now_s()
        self._take(data, self._clock.now_ns())

    def _backlog(self) -> bytes:
        """Return further bytes that arrived while this process was stalled."""
        found = piece = self._port.receive(_PIECE, time.monotonic())
        while len(piece) > _MORE_COMES and len(found) < _LARGEST_BACKLOG:
            piece = self._port.receive(_PIECE, time.monotonic() + _PIECE_S)
            found += piece
        return found

    def _take(self, data: bytes, now_ns: int) -> None:
        parser, assembler = self._parser, self._assembler
        assert parser is not None
        assert assembler is not None
        self._arrivals.add(len(data), now_ns)
        samples = parser.feed(data)
        self._keeper.packets, self._keeper.damaged = parser.packets, parser.damaged
        if not len(samples):
            return
        self._packet_s = self._awake.now_s()
        times_ns = self._arrivals.times_ns(samples.end)
        self._arrivals.forget(int(samples.end[-1]))
        for turn in assembler.add(samples, times_ns):
            self._turn_s = self._awake.now_s()
            scan = turn.not_later_than(now_ns)
            if scan is None or scan.stamp_ns <= self._last_stamp_ns:
                continue
            self._last_stamp_ns = scan.stamp_ns
            coverage = 1.0 - float(np.isnan(scan.ranges_m).mean())
            self._keeper.add(scan.turn_s, scan.points, coverage)
            self._ready.append(scan)

    def _check_alive(self) -> None:
        now_s = self._awake.now_s()
        model = self.model
        assert model is not None
        if now_s - self._byte_s > SILENT_S:
            raise DeviceDisconnected(
                f"{self._port}: the {model.title} has sent nothing for {SILENT_S:g} s: check that its rotor "
                f"turns, its cable, and its power ({model.power})"
            )
        if now_s - self._packet_s > NO_PACKET_S:
            raise DeviceDisconnected(
                f"{self._port}: no valid packet of the {model.title} for {NO_PACKET_S:g} s "
                f"({self._keeper.damaged} damaged sections): check cable and ground, keep the cable away "
                "from motors, and check its power"
            )
        if now_s - self._turn_s > NO_TURN_S:
            raise DeviceDisconnected(self._stalled())

    def _stalled(self) -> str:
        model = self.model
        assert model is not None
        return (
            f"{self._port}: the {model.title} measures, but it does not turn: free its rotor and its belt, "
            f"and check its power ({model.power})"
        )
