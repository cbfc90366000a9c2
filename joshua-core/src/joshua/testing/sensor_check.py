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
from joshua.testing.conformance import Checklist, ViolationError, must, name_of, said, violation
from joshua.testing.values import FRAME, check_message, check_stamps, check_types

#: Tolerance of a read's timeout on a loaded machine.
SLACK_S = 0.5

#: Consecutive late reads that count as a violation, because a system stall causes only single ones.
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

    Resources that the factory opens, such as an emulator, are not attributed to the driver.

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
            must("reading.none", time.monotonic() < end, self._timeout_s)

    def description(self) -> None:
        with lifecycle.made(self._factory) as device:
            types = device.data_types
        must("data_types", isinstance(types, tuple) and bool(types), types)
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
            must("reading.type", isinstance(reading, Reading), type(reading).__name__)
            number = reading.sequence
            must("sequence.type", isinstance(number, int) and number >= 0, number)
            text = device.implausible(reading)
            must("reading.implausible", text == "", text)

    def sequence(self) -> None:
        with lifecycle.opened(self._factory) as device:
            last = -1
            for _ in range(10):
                number = self.next(device).sequence
                must("sequence.order", number > last, last, number)
                last = number

    def stamps(self) -> None:
        with lifecycle.opened(self._factory) as device:
            check_stamps(lambda: self.next(device).stamp_ns, 10)

    def own_data(self) -> None:
        with lifecycle.opened(self._factory) as device:
            first = self.next(device)
            kept = copy.deepcopy(first.data)
            for _ in range(3):
                self.next(device)
            must("reading.changed", _equal(first.data, kept))

    def messages(self) -> None:
        with lifecycle.opened(self._factory) as device:
            reading = self.next(device)
            for type_name in device.data_types:
                message = device.message(reading, type_name, FRAME)
                check_message(message, type_name, "message")
                header = getattr(message, "header", None)
                stamp = reading.stamp_ns if header is None else stamp_ns(header.stamp)
                must("message.stamp", stamp == reading.stamp_ns, type_name, stamp, reading.stamp_ns)

    def timeout(self) -> None:
        with lifecycle.opened(self._factory) as device:
            for timeout_s in (0.0, 0.05) * 5:
                for _ in range(LATE_READS):
                    started = time.monotonic()
                    device.read(timeout_s)
                    took_s = time.monotonic() - started
                    if took_s <= timeout_s + SLACK_S:
                        break
                must("timeout", took_s <= timeout_s + SLACK_S, timeout_s, took_s)

    def instances(self) -> None:
        with lifecycle.made(self._factory) as first, lifecycle.made(self._factory) as second:
            if not lifecycle.both_open(first, second):
                return  # the device cannot be opened twice: nothing else to check
            self.next(first)
            second.disconnect()
            must("instances.closed", first.connected)
            try:
                self.next(first)
            except ViolationError:
                raise
            except Exception as error:
                raise violation("instances.broke", said(error)) from error


def _equal(first: Any, second: Any) -> bool:
    if isinstance(first, np.ndarray):
        return bool(np.array_equal(first, second, equal_nan=first.dtype.kind == "f"))
    return bool(first == second)
