"""The node of a sensor: publishes its newest reading, and reopens a device that was disconnected."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence

from joshua.devices.context import SensorContext
from joshua.devices.diagnostics import DiagnosticsPublisher, DiagnosticStatus
from joshua.devices.errors import ConfigurationError, DeviceDisconnected, DeviceError
from joshua.devices.sensor import Reading, Sensor
from joshua.node.behaviour import NodeBehaviour
from joshua.node.context import NodeContext
from joshua.node.endpoints import Outputs
from joshua.node.errors import Cancelled
from joshua.node.implementation import load_implementation
from joshua.plan import SensorFacts, TopicSpec

#: Longest wait for a reading, so that a stop is noticed.
READ_TIMEOUT_S = 0.2

#: Time without a reading after which the log reports it.
SILENCE_S = 2.0

#: Time limit for reopening a device. A scanner's motor and a search at all line speeds take seconds.
CONNECT_LIMIT_S = 30.0

PICTURES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"

RECONNECT_FIRST_S = 0.25
RECONNECT_LARGEST_S = 5.0


def _camera_infos(topics: Sequence[TopicSpec], offered: Sequence[str]) -> list[TopicSpec]:
    """Return the topics of the calibration beside each picture, where ROS 2's tools expect it.

    A CAMERA_INFO topic in the file overrides them.
    """
    if CAMERA_INFO not in offered or any(topic.type_name == CAMERA_INFO for topic in topics):
        return []
    found: dict[str, TopicSpec] = {}
    for topic in topics:
        if topic.type_name in PICTURES:
            base = topic.name.removesuffix("/compressed")
            folder, _, last = base.rpartition("/")
            # two cameras may share a namespace, such as /top and /wrist
            name = f"{folder if last.startswith('image') else base}/camera_info"
            found.setdefault(name, topic.model_copy(update={"name": name, "type_name": CAMERA_INFO}))
    return list(found.values())


class SensorNode(NodeBehaviour):
    """The standard behaviour of sensors. Beside pictures it publishes ``camera_info``.

    A thread reads. Each new reading is published immediately on every topic, at most at the topic's rate. A
    reading that is not newer than the last is dropped and counted.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._sensor: Sensor | None = None
        self._outputs = Outputs(())
        self._reader_runs = False
        self._last: Reading | None = None
        self._readings = 0
        self._lost = 0
        self._repeated = 0
        self._reconnections = 0
        self._implausible: list[str] = []
        self._trouble: tuple[int, str] = (DiagnosticStatus.OK, "")
        self._diagnostics: DiagnosticsPublisher | None = None

    def configure(self) -> None:
        """Opens the device and declares topics. Raises DeviceError, TargetError."""
        spec = self.context.spec
        implementation, settings = load_implementation(spec, Sensor)
        facts = spec.facts_as(SensorFacts)
        sensor: Sensor = implementation(
            settings, SensorContext(facts, self.context.log, stopping=lambda: self.context.stopping)
        )
        for topic in spec.publishers:
            if topic.type_name not in sensor.data_types:
                raise ConfigurationError(
                    f"{spec.full_name} cannot publish {topic.type_name} on {topic.name}: "
                    f"{implementation.__name__} offers {', '.join(sensor.data_types)}"
                )
        if spec.subscriptions:
            names = ", ".join(topic.name for topic in spec.subscriptions)
            self.context.warn(f"{spec.full_name}: a sensor takes no commands, so {names} has no effect")
        self._sensor = sensor
        sensor.connect()
        topics = [*spec.publishers, *_camera_infos(spec.publishers, sensor.data_types)]
        self._outputs = Outputs(map(self.context.publisher, topics))
        self._diagnostics = DiagnosticsPublisher(self.context, self._diagnostic_rows)

    def verb_providers(self) -> tuple[object, ...]:
        """The node's own verbs, and those of its driver, which run beside the thread that reads."""
        return (self,) if self._sensor is None else (self, self._sensor)

    def activate(self) -> None:
        """Starts the reader."""
        if not self._reader_runs:
            self._reader_runs = True
            self.context.spawn_thread(self._read, name="sensor")
            if self._diagnostics is not None:
                self._diagnostics.start()

    def cleanup(self) -> None:
        """Closes the device."""
        if self._sensor is not None:
            self._sensor.disconnect()

    def observe(self, reading: Reading) -> None:
        """Called with each published reading, on the reader's thread, for displays."""

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Rates, order and plausibility of the readings."""
        rows = self._outputs.checks()
        order = f"{self._readings} new, {self._repeated} repeated or out of order, {self._lost} lost"
        rows.append(("readings in order", self._readings > 0 and not self._repeated, order))
        plausible = self._implausible[0] if self._implausible else "all"
        rows.append(("readings plausible", not self._implausible, plausible))
        if self._reconnections:
            rows.append(("connection", False, f"lost {self._reconnections} times"))
        return rows

    def _diagnostic_rows(self) -> list[DiagnosticStatus]:
        """One row of the node for the sensor, and the rows of its driver."""
        assert self._sensor is not None
        level, trouble = self._trouble
        spec = self.context.spec
        values = {
            "readings": str(self._readings),
            "lost": str(self._lost),
            "repeated": str(self._repeated),
            "reconnections": str(self._reconnections),
        }
        row = DiagnosticStatus(level, "", trouble or "in order", f"{spec.plugin} {spec.block}", values)
        return [row, *self._sensor.diagnostics()]

    def _read(self) -> None:
        """Reads until the stop."""
        sensor = self._sensor
        assert sensor is not None
        quiet_since, silent = time.monotonic(), False
        while not self.context.stopping:
            try:
                reading = sensor.read(READ_TIMEOUT_S)
            except DeviceDisconnected as error:
                self._reconnect(sensor, error)
                quiet_since = time.monotonic()
                continue
            if reading is not None:
                if silent:
                    self.context.log.info("readings resumed")
                quiet_since, silent, self._trouble = time.monotonic(), False, (DiagnosticStatus.OK, "")
                self._take(sensor, reading)
            elif not silent and time.monotonic() - quiet_since > SILENCE_S:
                silent = True
                self._trouble = (DiagnosticStatus.STALE, "no readings: check its cable and power")
                self.context.log.warning("no reading for %g s: check its cable and power", SILENCE_S)

    def _take(self, sensor: Sensor, reading: Reading) -> None:
        last, self._last = self._last, reading
        if last is not None and (reading.sequence <= last.sequence or reading.stamp_ns <= last.stamp_ns):
            self._last = last
            self._repeated += 1
            if self._repeated == 1:
                self.context.log.warning(
                    "reading %d came after reading %d and is not newer: dropped, as all such from now on",
                    reading.sequence,
                    last.sequence,
                )
            return
        self._readings += 1
        self._lost += reading.sequence - last.sequence - 1 if last is not None else 0
        frame_id = self.context.spec.frame_id
        self._outputs.publish(reading.stamp_ns, lambda name: sensor.message(reading, name, frame_id))
        self.observe(reading)
        if len(self._implausible) < 10 and (text := sensor.implausible(reading)):
            self._implausible.append(text)

    def _reconnect(self, sensor: Sensor, reason: DeviceDisconnected) -> None:
        """Closes and opens the device until that succeeds or the node stops, with increasing pauses."""
        self._reconnections += 1
        self._trouble = (DiagnosticStatus.ERROR, f"disconnected: {reason}")
        self._last = None  # the device may count from 0 again
        wait_s = RECONNECT_FIRST_S
        self.context.log.warning("disconnected: %s; reconnecting", reason)
        while not self.context.stopping:
            sensor.disconnect()
            if self._stopped_within(wait_s):
                return
            try:
                self._connect(sensor)
            except Cancelled:
                return
            except DeviceError as error:
                wait_s = min(2 * wait_s, RECONNECT_LARGEST_S)
                self.context.log.warning("still disconnected: %s; next attempt in %g s", error, wait_s)
            else:
                self._trouble = (DiagnosticStatus.OK, "")
                self.context.log.info("reconnected")
                return

    def _connect(self, sensor: Sensor) -> None:
        """Opens the device, with heartbeats meanwhile, because that exceeds the reader's hang limit."""
        errors: list[BaseException] = []

        def connect() -> None:
            try:
                sensor.connect()
            except BaseException as error:  # noqa: BLE001 (raised again on the reader's thread)
                errors.append(error)

        thread = threading.Thread(target=connect, name="sensor's connection", daemon=True)
        thread.start()
        end_s = time.monotonic() + CONNECT_LIMIT_S
        while thread.is_alive():
            if time.monotonic() < end_s:
                _ = self.context.stopping  # polling it is the heartbeat
            thread.join(0.1)
        if errors:
            raise errors[0]

    def _stopped_within(self, duration_s: float) -> bool:
        """Waits. Returns early with True if the node is asked to stop."""
        end = time.monotonic() + duration_s
        while not (stopped := self.context.stopping) and (left_s := end - time.monotonic()) > 0:
            time.sleep(min(left_s, 0.1))
        return stopped
