"""The conformance check of sensors."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from joshua.devices.sensor import Reading, Sensor
from joshua.messages.make import stamp_ns
from joshua.testing import lifecycle
from joshua.testing.conformance import Checklist, ViolationError, clause, name_of, require
from joshua.testing.values import FRAME, check_message, check_stamps, check_types

#: Time by which a read may exceed its timeout on a loaded machine.
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
    """Check a driver against the contract of ``joshua.devices.sensor.Sensor``.

    What the factory opens itself, such as an emulator, is not held against the driver.

    Args:
        factory: makes a sensor that is not connected; each call a new one.
        unplug: makes an open device vanish, such as by closing the far end of its link. Without it the
            clause about disconnection is left out.
        timeout_s: how long a reading or the detection of a disconnection may take.
        only: names of the clauses to check, such as ``("stamps",)`` while you fix one; empty for all.

    Raises:
        ConformanceError: lists every violated clause: what was observed, why it is wrong, the likely cause.
        ValueError: ``only`` names a clause that does not exist.
    """
    clauses = _Clauses(factory, timeout_s)
    checklist = Checklist(name_of(factory, lifecycle.disconnect), only)
    checklist.run("constructor", lambda: lifecycle.check_constructor(factory, Sensor))
    checklist.run_methods(clauses, "description", "order")
    if checklist.run("connection", lambda: lifecycle.check_connection(factory)):
        if checklist.run("reading", clauses.reading):
            checklist.run_methods(clauses, "sequence", "stamps", "own data", "messages")
        checklist.run("timeout", clauses.timeout)
        checklist.run("close", lambda: lifecycle.check_idempotent_close(factory, clauses.states))
        checklist.run("nothing left", lambda: lifecycle.check_nothing_left(factory, clauses.next))
        checklist.run("instances", clauses.instances)
        if unplug is not None:
            checklist.run(
                "disconnection",
                lambda: lifecycle.check_unplugged(factory, unplug, lambda s: s.read(0.2), timeout_s),
            )
    checklist.finish()


class _Clauses:
    """One method for each clause; each makes its own device."""

    def __init__(self, factory: SensorFactory, timeout_s: float) -> None:
        self._factory = factory
        self._timeout_s = timeout_s
        self.states: dict[str, Callable[[Sensor], object]] = {
            "never connected": lambda device: None,
            "connected": lambda device: device.connect(),
            "read": lambda device: (device.connect(), self.next(device)),
        }

    def next(self, device: Sensor) -> Reading:
        """Return the next reading of an open device."""
        end = time.monotonic() + self._timeout_s
        while True:
            reading = device.read(0.2)
            if reading is not None:
                return reading
            require(
                time.monotonic() < end,
                f"no reading in {self._timeout_s:g} s",
                "the device waits for a start command, or read returns None too early",
                "an open sensor delivers readings",
            )

    def description(self) -> None:
        with lifecycle.made(self._factory) as device:
            types = device.data_types
        require(
            isinstance(types, tuple) and bool(types),
            f"data_types is {types!r}",
            "data_types is a list, or is filled only by connect",
            "the configuration names the type of a topic, and is checked without the device",
        )
        check_types("data_types", types)

    def order(self) -> None:
        with lifecycle.made(self._factory) as device:
            lifecycle.check_refused_when_closed({"read(0)": lambda: device.read(0.0)}, "before connect")
            device.connect()
            device.disconnect()
            lifecycle.check_refused_when_closed({"read(0)": lambda: device.read(0.0)}, "after disconnect")

    def reading(self) -> None:
        with lifecycle.opened(self._factory) as device:
            reading = self.next(device)
            require(
                isinstance(reading, Reading),
                f"read returned {type(reading).__name__}",
                "read returns the data alone",
                "the node publishes a Reading with stamp and sequence number",
            )
            require(
                isinstance(reading.sequence, int) and reading.sequence >= 0,
                f"sequence is {reading.sequence!r}",
                "a stamp or a float is used as sequence number",
                "the sequence number counts acquisitions from 0",
            )
            text = device.implausible(reading)
            require(
                text == "",
                f"implausible returned {text!r} for a reading of a healthy device",
                "a bound is too tight, or the reading is in a wrong unit",
                "MODE_TEST fails a sensor whose readings cannot be true",
            )

    @clause("a reading that is returned twice is published as if it were measured twice")
    def sequence(self) -> None:
        with lifecycle.opened(self._factory) as device:
            last = -1
            for _ in range(10):
                reading = self.next(device)
                require(
                    reading.sequence > last,
                    f"sequence went from {last} to {reading.sequence}",
                    "read returns the latest reading instead of waiting for the next, or does not count",
                )
                last = reading.sequence

    def stamps(self) -> None:
        with lifecycle.opened(self._factory) as device:
            check_stamps(lambda: self.next(device).stamp_ns, 10)

    @clause("a reading is published and recorded while the sensor continues")
    def own_data(self) -> None:
        with lifecycle.opened(self._factory) as device:
            first = self.next(device)
            kept = copy.deepcopy(first.data)
            for _ in range(3):
                self.next(device)
            require(
                _equal(first.data, kept),
                "the data of a reading changed when later ones were read",
                "one buffer is used for all readings",
            )

    def messages(self) -> None:
        with lifecycle.opened(self._factory) as device:
            reading = self.next(device)
            for type_name in device.data_types:
                message = device.message(reading, type_name, FRAME)
                check_message(message, type_name, "message")
                header = getattr(message, "header", None)
                stamp = reading.stamp_ns if header is None else stamp_ns(header.stamp)
                require(
                    stamp == reading.stamp_ns,
                    f"{type_name} is stamped {stamp}, its acquisition was at {reading.stamp_ns}",
                    "message takes the time of the call",
                    "stamps are taken at acquisition, not at publication",
                )

    @clause("the node checks for a stop request between two reads")
    def timeout(self) -> None:
        with lifecycle.opened(self._factory) as device:
            for timeout_s in (0.0, 0.05) * 5:
                for _ in range(LATE_READS):
                    started = time.monotonic()
                    device.read(timeout_s)
                    took_s = time.monotonic() - started
                    if took_s <= timeout_s + SLACK_S:
                        break
                require(
                    took_s <= timeout_s + SLACK_S,
                    f"read({timeout_s:g}) returned after {took_s:.2f} s",
                    "read waits for the device without a timeout of its own",
                )

    @clause("a robot has two sensors of the same kind in one process")
    def instances(self) -> None:
        why = self.instances.why  # type: ignore[attr-defined]
        with lifecycle.made(self._factory) as first, lifecycle.made(self._factory) as second:
            if not lifecycle.both_open(first, second, why=why):
                return  # one device cannot be opened twice: nothing else to check
            self.next(first)
            second.disconnect()
            require(first.connected, "closing one closed the other", lifecycle.SHARED)
            try:
                self.next(first)
            except ViolationError:
                raise
            except Exception as error:
                observed = f"closing one broke the other: {type(error).__name__}: {error}"
                raise ViolationError(observed, cause=lifecycle.SHARED) from error


def _equal(first: Any, second: Any) -> bool:
    if isinstance(first, np.ndarray):
        return bool(np.array_equal(first, second, equal_nan=first.dtype.kind == "f"))
    return bool(first == second)
