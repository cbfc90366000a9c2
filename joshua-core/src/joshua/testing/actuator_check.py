"""The conformance check of actuators.

Why one file: the clauses of one contract, in the order in which they run, with their shared motions.
"""

from __future__ import annotations

import functools
import time
import warnings
from collections.abc import Callable, Collection, Mapping

import numpy as np

from joshua.devices.actuator import Actuator, DeviceError, FloatArray, JointLimits, JointReading
from joshua.guardian.safe_stop import SafeStopRequest, SafeStopResult
from joshua.plugins import ActuatorSpec, load_registry
from joshua.testing import lifecycle, resources
from joshua.testing.conformance import Checklist, must, must_refuse, name_of, said, violation
from joshua.testing.values import (
    FRAME,
    PLAUSIBLE_RAD,
    PLAUSIBLE_RAD_S,
    POSITION_TOLERANCE_RAD,
    RESOLUTION_RAD,
    check_array,
    check_message,
    check_plausible,
    check_stamps,
    check_types,
)

ActuatorFactory = Callable[[], Actuator]

NO_SAFE_STOP = "no safe stop: if this driver dies, the joints keep their last goal"

#: A system stall can hide or prolong a motion, so a clause then tries again.
ATTEMPTS = 6
STALL_S = 0.02

#: Wrong units differ by more: a turn is 6.3 rad, a degree 0.017, 1 rpm 0.10 rad/s.
VELOCITY_FACTOR = 3.0


def check_actuator(
    factory: ActuatorFactory,
    *,
    unplug: Callable[[Actuator], None] | None = None,
    timeout_s: float = 10.0,
    only: Collection[str] = (),
) -> None:
    """Check a driver against the contract of ``joshua.devices.actuator.Actuator``.

    The joints move about 0.2 rad within their limits. Run it on a simulator, an emulator, or an arm with free
    space. Resources that the factory opens, such as an emulator, are not attributed to the driver.

    Args:
        factory: makes an actuator that is not connected; each call a new one.
        unplug: disconnects an open device, for example by closing the far end of its link. Without it, the
            clause about disconnection is skipped.
        timeout_s: how long a motion or the detection of a disconnection may take.
        only: names of the clauses to check, such as ``("limits",)`` while you fix one; empty for all.

    Raises:
        ConformanceError: lists every violated clause: what was observed, why it is wrong, the likely cause.
        ValueError: ``only`` names a clause that does not exist.
    """
    clauses = _Clauses(factory, timeout_s)
    checklist = Checklist(name_of(factory, lifecycle.disconnect), only)
    checklist.run("constructor", lambda: lifecycle.check_constructor(factory, Actuator))
    checklist.run_methods(clauses, "description", "order")
    if checklist.run("connection", lambda: lifecycle.check_connection(factory)):
        checklist.run_methods(clauses, "joints", "reading", "stamps", "own data", "further messages")
        checklist.run_methods(clauses, "torque", "torque read back", "enable", "limits", "refused goals")
        checklist.run_methods(clauses, "motion", "velocity", "hold", "release", "safe stop")
        checklist.run("close", lambda: lifecycle.check_idempotent_close(factory, STATES))
        checklist.run("nothing left", lambda: lifecycle.check_nothing_left(factory, _use))
        checklist.run("instances", clauses.instances)
        if unplug is not None:
            checklist.run(
                "disconnection",
                lambda: lifecycle.check_unplugged(factory, unplug, lambda device: device.read(), timeout_s),
            )
    checklist.finish()


def _energise(device: Actuator) -> None:
    device.connect()
    device.enable()


def _energise_and_release(device: Actuator) -> None:
    _energise(device)
    device.release()


#: States in which an actuator can be stopped, and how it gets there.
STATES: Mapping[str, Callable[[Actuator], None]] = {
    "never connected": lambda device: None,
    "connected": lambda device: device.connect(),
    "energised": _energise,
    "released": _energise_and_release,
}


def _use(device: Actuator) -> None:
    """Use a device as a node does."""
    device.read()
    device.enable()
    device.write(device.read().position_rad)
    device.hold()
    device.release()


class _Clauses:
    """One method for each clause; each makes its own device."""

    def __init__(self, factory: ActuatorFactory, timeout_s: float) -> None:
        self._factory = factory
        self._timeout_s = timeout_s

    def joints(self) -> None:
        with lifecycle.made(self._factory) as device:
            before = device.joint_names
            device.connect()
            must("joints", before == device.joint_names, before, device.joint_names)

    def description(self) -> None:
        with lifecycle.made(self._factory) as device:
            names, limits = device.joint_names, device.limits
        are_names = isinstance(names, tuple) and all(isinstance(name, str) and name for name in names)
        must("names.type", are_names and bool(names), names)
        must("names.twice", len(set(names)) == len(names), names)
        low, high, speed = limits.position_min_rad, limits.position_max_rad, limits.velocity_max_rad_s
        check_array("limits.position_min_rad", low, len(names))
        check_array("limits.position_max_rad", high, len(names))
        check_array("limits.velocity_max_rad_s", speed, len(names))
        for index, name in enumerate(names):
            must("range", low[index] < high[index], name, low[index], high[index])
        check_plausible("a limit", [low, high], PLAUSIBLE_RAD, "rad")
        check_plausible("a speed limit", speed, PLAUSIBLE_RAD_S, "rad/s")
        must("speed", float(speed.min()) > 0, speed)

    def order(self) -> None:
        with lifecycle.made(self._factory) as device:
            goal = np.zeros(len(device.joint_names))
            calls = {
                "read()": device.read,
                "enable()": device.enable,
                "write(goal)": lambda: device.write(goal),
                "hold()": device.hold,
            }
            lifecycle.check_refused_when_closed(calls, "before connect")
            device.release()
            device.disconnect()
            device.connect()
            device.disconnect()
            lifecycle.check_refused_when_closed({"read()": device.read}, "after disconnect")

    def reading(self) -> None:
        with lifecycle.opened(self._factory) as device:
            reading = device.read()
            must("reading.type", isinstance(reading, JointReading), type(reading).__name__)
            for label in ("position_rad", "velocity_rad_s", "effort"):
                check_array(f"read().{label}", getattr(reading, label), len(device.joint_names))
            check_plausible("a position", reading.position_rad, PLAUSIBLE_RAD, "rad")
            check_plausible("a velocity", reading.velocity_rad_s, PLAUSIBLE_RAD_S, "rad/s")
            beyond = _beyond(reading.position_rad, device.limits)
            must("reading.beyond", beyond <= POSITION_TOLERANCE_RAD, beyond)

    def stamps(self) -> None:
        with lifecycle.opened(self._factory) as device:
            check_stamps(lambda: device.read().stamp_ns, 20)

    def own_data(self) -> None:
        with lifecycle.opened(self._factory) as device:
            first = device.read()
            kept = first.position_rad.copy()
            if first.position_rad.flags.writeable:
                first.position_rad[:] += 1e3
            second = device.read().position_rad
            must("reading.shared", bool(np.abs(second - kept).max() < PLAUSIBLE_RAD))
            device.enable()
            goal = device.read().position_rad.copy()
            asked = goal.copy()
            written = device.write(goal)
            must("write.shared", bool((goal == asked).all()) and written is not goal)

    def further_messages(self) -> None:
        with lifecycle.made(self._factory) as device:
            types = device.further_types
            check_types("further_types", types)
            if types:
                device.connect()
                device.read()
            for type_name in types:
                check_message(device.further_message(type_name, FRAME), type_name, "further_message")

    def torque(self) -> None:
        with lifecycle.opened(self._factory) as device:
            goal = device.read().position_rad
            for state in ("before enable", "after release"):
                must_refuse("torque", lambda: device.write(goal), DeviceError, state)
                device.enable()
                device.release()

    def torque_read_back(self) -> None:
        with lifecycle.opened(self._factory) as device:
            device.enable()
            if device.read_torque() is None:
                return
            for verb, expected in (("enable", True), ("release", False)):
                getattr(device, verb)()
                told = device.read_torque()
                must("torque.read", told == dict.fromkeys(device.joint_names, expected), verb, told)

    def enable(self) -> None:
        with lifecycle.opened(self._factory) as device:
            self._require_still_enable(device, "enable")
            for _ in range(ATTEMPTS):
                device.enable()
                goal = device.write(_far(device))
                device.release()  # while the joints are on their way: the device still has that goal
                if np.abs(device.read().position_rad - goal).max() > 2 * POSITION_TOLERANCE_RAD:
                    break
            self._require_still_enable(device, "enable after a release during a motion")

    def _require_still_enable(self, device: Actuator, what: str) -> None:
        for _ in range(ATTEMPTS):
            began_s = time.monotonic()
            device.enable()
            before = device.read().position_rad
            late = time.monotonic() - began_s > 5 * STALL_S
            moved = _moved(device, before, 0.3)
            must("enable", moved <= POSITION_TOLERANCE_RAD, what, moved)
            if not late:
                return
            device.release()

    def limits(self) -> None:
        with lifecycle.opened(self._factory) as device:
            device.enable()
            here, limits = device.read().position_rad, device.limits
            written = device.write(here)
            check_array("write(goal)", written, len(device.joint_names))
            off = float(np.abs(written - here).max())
            must("write.other", off <= RESOLUTION_RAD, off)
            above, below = limits.position_max_rad + 1, limits.position_min_rad - 1
            for label, goal in (("above", above), ("below", below)):
                over = _beyond(device.write(goal), limits)
                device.hold()
                must("write.beyond", over <= 1e-6, label, over)
            beyond = _beyond(device.read().position_rad, limits)
            must("limits.beyond", beyond <= POSITION_TOLERANCE_RAD, beyond)

    def refused_goals(self) -> None:
        with lifecycle.opened(self._factory) as device:
            device.enable()
            here = device.write(device.read().position_rad)
            not_a_number, infinite = here.copy(), here.copy()
            not_a_number[-1], infinite[0] = np.nan, np.inf
            for label, goal in {
                "NaN": not_a_number,
                "infinity": infinite,
                f"shape ({len(here) + 1},)": np.append(here, 0.0),
                f"shape (1, {len(here)})": here[None, :],
                "an empty array": np.zeros(0),
            }.items():
                must_refuse("goal.taken", functools.partial(device.write, goal), ValueError, label)
            moved = _moved(device, here, 0.2)
            must("goal.moved", moved <= POSITION_TOLERANCE_RAD, moved)

    def motion(self) -> None:
        with lifecycle.opened(self._factory) as device:
            device.enable()
            self._travel(device)

    def velocity(self) -> None:
        with lifecycle.opened(self._factory) as device:
            device.enable()
            for attempt in range(ATTEMPTS):
                readings = self._travel(device)
                stamps_s = np.array([reading.stamp_ns for reading in readings]) / 1e9
                speed = np.array([reading.velocity_rad_s for reading in readings])
                added = (np.diff(stamps_s)[:, None] * (speed[1:] + speed[:-1]) / 2).sum(axis=0)
                moved = readings[-1].position_rad - readings[0].position_rad
                seen = np.abs(moved) > 1.5 * RESOLUTION_RAD
                ratio = added[seen] / moved[seen]
                wrong = (ratio < 1 / VELOCITY_FACTOR) | (ratio > VELOCITY_FACTOR)
                if not wrong.any():
                    return
                index = int(np.flatnonzero(seen)[wrong.argmax()])
                last = attempt == ATTEMPTS - 1
                must("velocity", not last, device.joint_names[index], moved[index], added[index])

    def _travel(self, device: Actuator) -> list[JointReading]:
        """Command a goal near by until the joints are there; return all readings from rest to rest."""
        readings = [device.read()]
        here, limits = readings[0].position_rad, device.limits
        step = np.minimum(0.2, (limits.position_max_rad - limits.position_min_rad) / 4)
        goal = here + np.where(_middle(limits) >= here, step, -step)
        end = time.monotonic() + self._timeout_s
        rest_s = 0.0
        while not rest_s or time.monotonic() < rest_s:
            device.write(goal)
            readings.append(device.read())
            left = np.abs(readings[-1].position_rad - goal)
            worst = int(left.argmax())
            if not rest_s and left[worst] <= POSITION_TOLERANCE_RAD / 2:
                rest_s = time.monotonic() + 0.2
            in_time = bool(rest_s) or time.monotonic() < end
            must("motion", in_time, device.joint_names[worst], left[worst], self._timeout_s, step[worst])
            time.sleep(0.005)
        return readings

    def hold(self) -> None:
        with lifecycle.opened(self._factory) as device:
            device.enable()
            for attempt in range(ATTEMPTS):
                goal = device.write(_far(device))
                time.sleep(0.03)
                began_s = time.monotonic()
                device.hold()
                stop = device.read().position_rad
                stalled = time.monotonic() - began_s > STALL_S
                moved = _moved(device, stop, 0.4)
                if stalled and moved > 2 * POSITION_TOLERANCE_RAD and attempt < ATTEMPTS - 1:
                    continue
                must("hold", moved <= 2 * POSITION_TOLERANCE_RAD, moved)
                if np.abs(stop - goal).max() > 2 * POSITION_TOLERANCE_RAD or attempt > 1:
                    break

    def release(self) -> None:
        for state, reach in STATES.items():
            with lifecycle.made(self._factory) as device:
                reach(device)
                try:
                    device.release()
                    device.release()
                except Exception as error:
                    raise violation("release", said(error), state) from error

    def safe_stop(self) -> None:
        with lifecycle.made(self._factory) as device:
            before = resources.take()
            _energise(device)
            hold, off = self._request(device, "HOLD"), self._request(device, "RELEASE")
            if hold is None or off is None:
                return
            resources.disconnect_since(before)  # as the driver's death does; torque stays as it is
            for request, state in ((hold, "held"), (off, "released"), (hold, "was off")):
                _check_stop(request, state)
        with lifecycle.opened(self._factory) as device:
            told = device.read_torque()
        must("stop.torque", told is None or not any(told.values()), type(off).__name__, told)

    def _request(self, device: Actuator, action: str) -> SafeStopRequest | None:
        """Return the driver's request; None if it has no safe stop and needs none."""
        try:
            request: object = device.safe_stop_request(action, timeout_s=self._timeout_s)
        except NotImplementedError:
            spec = _spec_of(device)
            if spec is not None and not (spec.virtual or spec.stops_itself):
                warnings.warn(f"{type(device).__name__} has {NO_SAFE_STOP}", stacklevel=2)
            must("stop.missing", spec is None or not spec.safe_stop)
            return None
        must("stop.request", isinstance(request, SafeStopRequest), type(request).__name__)
        assert isinstance(request, SafeStopRequest)
        return request

    def instances(self) -> None:
        with lifecycle.made(self._factory) as first, lifecycle.made(self._factory) as second:
            if not lifecycle.both_open(first, second):
                return  # the device cannot be opened twice: nothing else to check
            first.enable()
            still = second.read().position_rad
            first.write(_far(first))
            must_refuse("instances.torque", lambda: second.write(still), DeviceError)
            first.disconnect()
            must("instances.closed", second.connected)
            second.read()


def _check_stop(request: SafeStopRequest, state: str) -> None:
    """Run a request as the guardian does, from its plain values; every joint must reach a state."""
    name = f"{type(request).__name__}.run with {request.action}"
    result: object = type(request).from_values(request.to_values()).run()
    must("stop.result", isinstance(result, SafeStopResult), name, type(result).__name__)
    assert isinstance(result, SafeStopResult)
    must("stop.state", set(result.joints.values()) == {state}, name, result, state)


def _spec_of(device: Actuator) -> ActuatorSpec | None:
    """Return the spec of a driver from the installed plugins; None if there is none."""
    name = f"{type(device).__module__}:{type(device).__qualname__}"
    specs = (spec for row in load_registry().rows() for spec in row.specs)
    return next(
        (spec for spec in specs if isinstance(spec, ActuatorSpec) and spec.implementation == name), None
    )


def _beyond(position_rad: FloatArray, limits: JointLimits) -> float:
    """Return how far the worst joint is beyond its limits; negative within."""
    over = np.maximum(limits.position_min_rad - position_rad, position_rad - limits.position_max_rad)
    return float(over.max())


def _middle(limits: JointLimits) -> FloatArray:
    return (limits.position_min_rad + limits.position_max_rad) / 2


def _far(device: Actuator) -> FloatArray:
    """Return the limit of each joint that is farther away."""
    limits = device.limits
    here = device.read().position_rad
    return np.where(_middle(limits) >= here, limits.position_max_rad, limits.position_min_rad)


def _moved(device: Actuator, start_rad: FloatArray, duration_s: float) -> float:
    """Return the largest distance of any joint from a position, over a time."""
    end, largest = time.monotonic() + duration_s, 0.0
    while time.monotonic() < end:
        largest = max(largest, float(np.abs(device.read().position_rad - start_rad).max()))
        time.sleep(0.01)
    return largest
