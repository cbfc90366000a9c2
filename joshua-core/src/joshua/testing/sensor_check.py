"""The conformance check of sensors."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from joshua.devices.sensor import Reading, Sensor
from joshua.messages import encode, known_types
from joshua.messages.make import stamp_ns
from joshua.testing import lifecycle
from joshua.testing.conformance import Checklist, ViolationError, name_of, require

#: Time by which a read may exceed its time-out on a loaded machine.
SLACK_S = 0.5

#: How often in a row a read must be late: a machine stalls now and then, a driver that waits does so always.
LATE_READS = 3

SensorFactory = Callable[[], Sensor]


def check_sensor(
    factory: SensorFactory,
    *,
    unplug: Callable[[Sensor], None] | None = None,
    timeout_s: float = 10.0,
    only: Collection[str] = (),
) -> None:
    """Checks a driver against the contract of ``joshua.devices.sensor.Sensor``.

    Args:
        factory: makes a sensor that is not connected; each call a new one.
        unplug: makes an open device vanish, such as by closing the far end of its link; without it the
            clause about disconnection is left out.
        timeout_s: how long a reading or the detection of a disconnection may take.
        only: names of the clauses to check, such as ``("limits",)`` while one is mended; empty for all.

    Raises:
        ConformanceError: lists every violated clause: what was observed, why it is wrong, the likely cause.
    """
    clauses = _SensorClauses(factory, timeout_s)
    checklist = Checklist(name_of(factory, lambda device: device.disconnect()), only)
    checklist.run("constructor", lambda: lifecycle.check_constructor(factory, Sensor))
    checklist.run("description", clauses.description)
    checklist.run("order", clauses.order)
    if checklist.run("connection", lambda: lifecycle.check_connection(factory)):
        if checklist.run("reading", clauses.reading):
            checklist.run("sequence", clauses.sequence)
            checklist.run("stamps", clauses.stamps)
            checklist.run("own data", clauses.own_data)
            checklist.run("messages", clauses.messages)
        checklist.run("time-out", clauses.time_out)
        checklist.run("close", lambda: lifecycle.check_idempotent_close(factory, clauses.states))
        checklist.run("nothing left", lambda: lifecycle.check_nothing_left(factory, clauses.use))
        checklist.run("instances", clauses.instances)
        if unplug is not None:
            checklist.run(
                "disconnection",
                lambda: lifecycle.check_unplugged(factory, unplug, lambda s: s.read(0.2), timeout_s),
            )
    checklist.finish()


class _SensorClauses:
    """One method for each clause; each makes its own device."""

    def __init__(self, factory: SensorFactory, timeout_s: float) -> None:
        self._factory = factory
        self._timeout_s = timeout_s
        self.states: dict[str, Callable[[Sensor], object]] = {
            "never connected": lambda device: None,
            "connected": lambda device: device.connect(),
            "read": self._connect_and_use,
        }

    def _connect_and_use(self, device: Sensor) -> None:
        device.connect()
        self.use(device)

    def use(self, device: Sensor) -> None:
        """Uses a device as a node does."""
        self._next(device)

    def _next(self, device: Sensor) -> Reading:
        end = time.monotonic() + self._timeout_s
        while True:
            reading = device.read(0.2)
            if reading is not None:
                return reading
            require(
                time.monotonic() < end,
                f"no reading came in {self._timeout_s:g} s",
                why="a sensor that is open delivers",
                cause="the device waits for a start command, or read returns None too eagerly",
            )

    def description(self) -> None:
        """The types of its messages are known without a connection, and known to ROS 2."""
        with lifecycle.made(self._factory) as device:
            types = device.data_types
        require(
            isinstance(types, tuple) and bool(types),
            f"data_types is {types!r}",
            why="a file says which type a topic has, and is checked without the device",
            cause="data_types is a list, or is filled only by connect",
        )
        unknown = [name for name in types if name not in known_types()]
        require(
            not unknown,
            f"data_types names {unknown[0] if unknown else ''}, which is no known ROS 2 type",
            why="a topic's type is a ROS 2 type such as sensor_msgs/msg/Image",
            cause="a name without /msg/, or the enum name of the configuration file",
        )

    def order(self) -> None:
        """Before connect and after disconnect, read is refused."""
        with lifecycle.made(self._factory) as device:
            lifecycle.check_refused_when_closed({"read(0)": lambda: device.read(0.0)}, "before connect")
            device.connect()
            device.disconnect()
            lifecycle.check_refused_when_closed({"read(0)": lambda: device.read(0.0)}, "after disconnect")

    def reading(self) -> None:
        """A reading is a Reading with a running number; plausibility is a sentence."""
        with lifecycle.opened(self._factory) as device:
            reading = self._next(device)
            require(
                isinstance(reading, Reading),
                f"read returned {type(reading).__name__}",
                why="the node publishes a Reading with stamp and running number",
                cause="read returns the bare data",
            )
            require(
                isinstance(reading.sequence, int) and reading.sequence >= 0,
                f"sequence is {reading.sequence!r}",
                why="the running number counts acquisitions from 0",
                cause="a time stamp or a float is used as running number",
            )
            text = device.implausible(reading)
            require(
                text == "",
                f"implausible says {text!r} about a reading of a healthy device",
                why="MODE_TEST fails a sensor whose readings cannot be true",
                cause="a bound that is too tight, or a wrong unit in the reading",
            )

    def sequence(self) -> None:
        """No reading is delivered twice, and the running number increases."""
        with lifecycle.opened(self._factory) as device:
            last = -1
            for _ in range(10):
                reading = self._next(device)
                require(
                    reading.sequence > last,
                    f"sequence went from {last} to {reading.sequence}",
                    why="a reading that comes twice is published as new data",
                    cause="read returns the newest reading and does not wait for the next, or does not count",
                )
                last = reading.sequence

    def stamps(self) -> None:
        """Stamps are ns since the epoch, at acquisition, and increase."""
        with lifecycle.opened(self._factory) as device:
            last_ns = 0
            for _ in range(10):
                before_ns = time.time_ns()
                reading = self._next(device)
                lifecycle.check_stamp(reading.stamp_ns, before_ns, time.time_ns())
                require(
                    reading.stamp_ns > last_ns,
                    f"stamp_ns went from {last_ns} to {reading.stamp_ns}",
                    why="each reading is a new acquisition, later than the one before",
                    cause="the stamp is kept from connect, or comes from a clock that is set back",
                )
                last_ns = reading.stamp_ns

    def own_data(self) -> None:
        """The data of a reading stay as they are when the sensor goes on."""
        with lifecycle.opened(self._factory) as device:
            first = self._next(device)
            kept = copy.deepcopy(first.data)
            for _ in range(3):
                self._next(device)
            require(
                _equal(first.data, kept),
                "the data of a reading changed when later ones were read",
                why="a reading is published and recorded while the sensor goes on",
                cause="one buffer is used for all readings",
            )

    def messages(self) -> None:
        """Each offered type becomes a message that can be sent, stamped with the acquisition."""
        with lifecycle.opened(self._factory) as device:
            reading = self._next(device)
            for type_name in device.data_types:
                message = device.message(reading, type_name, "frame_of_the_test")
                made = getattr(message, "__msgtype__", type(message).__name__)
                require(
                    made == type_name,
                    f"message made {made} where {type_name} was asked for",
                    why="the topic carries the type that the file says",
                    cause="message ignores type_name",
                )
                encode(message)
                header = getattr(message, "header", None)
                if header is None:
                    continue
                require(
                    stamp_ns(header.stamp) == reading.stamp_ns,
                    f"{type_name} is stamped {stamp_ns(header.stamp)}, "
                    f"its acquisition was at {reading.stamp_ns}",
                    why="stamps are taken at acquisition, not at publication",
                    cause="message takes the time of the call",
                )
                require(
                    header.frame_id == "frame_of_the_test",
                    f"{type_name} has frame_id {header.frame_id!r}",
                    why="the file says which frame the data are in",
                    cause="message does not use its argument frame_id",
                )

    def time_out(self) -> None:
        """Read returns when its time is over."""
        with lifecycle.opened(self._factory) as device:
            for timeout_s in (0.0, 0.05):
                for _ in range(5):
                    for _ in range(LATE_READS):
                        started = time.monotonic()
                        device.read(timeout_s)
                        took_s = time.monotonic() - started
                        if took_s <= timeout_s + SLACK_S:
                            break
                    require(
                        took_s <= timeout_s + SLACK_S,
                        f"read({timeout_s:g}) returned after {took_s:.2f} s",
                        why="the node looks for the stop request between two reads",
                        cause="read waits for the device without a time-out of its own",
                    )

    def instances(self) -> None:
        """Two sensors share nothing."""
        why = "a robot has two sensors of the same kind in one process"
        cause = "state stands on the class or in the module in place of the instance"
        with lifecycle.made(self._factory) as first, lifecycle.made(self._factory) as second:
            if not lifecycle.both_open(first, second, why=why, cause=cause):
                return  # one device cannot be opened twice; separate objects are all there is to check
            self._next(first)
            second.disconnect()
            require(first.connected, "closing one closed the other", why=why, cause=cause)
            try:
                self._next(first)
            except ViolationError:
                raise
            except Exception as error:
                raise ViolationError(
                    f"closing one broke the other: {type(error).__name__}: {error}", why, cause
                ) from error


def _equal(first: Any, second: Any) -> bool:
    if isinstance(first, np.ndarray):
        return bool(np.array_equal(first, second, equal_nan=first.dtype.kind == "f"))
    return bool(first == second)
