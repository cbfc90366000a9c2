"""The conformance check of actuators.

Why one file: the clauses of one contract, in the order in which they run, with the motions that they share.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Collection, Mapping

import numpy as np

from joshua.devices.actuator import Actuator, DeviceError, FloatArray, JointLimits, JointReading
from joshua.guardian.safe_stop import SafeStopRequest, SafeStopResult
from joshua.plugins import ActuatorSpec, load_registry
from joshua.testing import lifecycle, resources
from joshua.testing.conformance import Checklist, ViolationError, clause, name_of, refuses, require
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

#: A machine that stalls hides a motion, or shows one that was to be over; a clause then tries again.
ATTEMPTS = 6
STALL_S = 0.02

#: Wrong units differ by more: a turn is 6.3 rad, a degree 0.017, 1 rpm 0.10 rad/s.
VELOCITY_FACTOR = 3.0

_TWO_DEVICES = "a robot has two arms of the same kind in one process"
_STOPS = "the guardian stops the joints with it after the driver has died"


def check_actuator(
    factory: ActuatorFactory,
    *,
    unplug: Callable[[Actuator], None] | None = None,
    timeout_s: float = 10.0,
    only: Collection[str] = (),
) -> None:
    """Check a driver against the contract of ``joshua.devices.actuator.Actuator``.

    The joints move about 0.2 rad within their limits. Run it on a simulator, an emulator, or an arm that
    has room. What the factory opens itself, such as an emulator, is not held against the driver.

    Args:
        factory: makes an actuator that is not connected; each call a new one.
        unplug: makes an open device vanish, such as by closing the far end of its link. Without it the
            clause about disconnection is left out.
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

    @clause("the plan, a leader and data sets name the joints before the device is open")
    def joints(self) -> None:
        with lifecycle.made(self._factory) as device:
            before = device.joint_names
            device.connect()
            after = device.joint_names
        require(
            before == after,
            f"connect changed joint_names from {before} to {after}",
            "the names are those of the device, and the settings do not list them",
        )

    def description(self) -> None:
        with lifecycle.made(self._factory) as device:
            names, limits = device.joint_names, device.limits
        require(
            isinstance(names, tuple) and bool(names) and all(isinstance(n, str) and n for n in names),
            f"joint_names is {names!r}",
            "the names are not made from the settings as a tuple of strings",
            "messages name each joint",
        )
        require(
            len(set(names)) == len(names),
            f"joint_names {names} contains a name twice",
            "the names are made from something that two joints share",
            "commands find their joints by name",
        )
        low, high, speed = limits.position_min_rad, limits.position_max_rad, limits.velocity_max_rad_s
        check_array("limits.position_min_rad", low, len(names))
        check_array("limits.position_max_rad", high, len(names))
        check_array("limits.velocity_max_rad_s", speed, len(names))
        for index, name in enumerate(names):
            require(
                low[index] < high[index],
                f"the limits of {name} are {low[index]:g} to {high[index]:g} rad",
                "the limits are swapped, or a direction is inverted without swapping them",
                "a joint without a range cannot be commanded",
            )
        largest = float(np.abs([low, high]).max())
        check_plausible(f"a limit is {largest:g} rad", largest, PLAUSIBLE_RAD)
        check_plausible(f"a speed limit is {speed.max():g} rad/s", float(speed.max()), PLAUSIBLE_RAD_S)
        require(
            float(speed.min()) > 0,
            f"the speed limits are {speed}",
            "a vendor's 0, which means «no limit», is taken as a speed",
            "a joint with a speed limit of 0 never moves",
        )

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
            reading, count = device.read(), len(device.joint_names)
            require(
                isinstance(reading, JointReading),
                f"read returned {type(reading).__name__}",
                "read returns the value of the library underneath",
                "the node publishes a JointReading",
            )
            for label in ("position_rad", "velocity_rad_s", "effort"):
                check_array(f"read().{label}", getattr(reading, label), count)
            largest = float(np.abs(reading.position_rad).max())
            check_plausible(f"a position is {largest:g} rad", largest, PLAUSIBLE_RAD)
            fastest = float(np.abs(reading.velocity_rad_s).max())
            check_plausible(f"a velocity is {fastest:g} rad/s", fastest, PLAUSIBLE_RAD_S)
            beyond = _beyond(reading.position_rad, device.limits)
            require(
                beyond <= POSITION_TOLERANCE_RAD,
                f"a joint is {beyond:.3f} rad beyond its limits",
                "zero, direction or unit of read and limits differ",
                "positions and limits must agree about zero and direction",
            )

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
            require(
                bool(np.abs(second - kept).max() < PLAUSIBLE_RAD),
                "a change of one reading shows in the next",
                "read returns the driver's own array instead of a copy",
                "others keep a reading while the device continues",
            )
            device.enable()
            goal = device.read().position_rad.copy()
            asked = goal.copy()
            written = device.write(goal)
            require(
                bool((goal == asked).all()) and written is not goal,
                "write changed or returned the array that it was given",
                "the clamp works in place",
                "the array belongs to the caller",
            )

    def further_messages(self) -> None:
        with lifecycle.made(self._factory) as device:
            types = device.further_types
            check_types("further_types", types)
            if types:
                device.connect()
                device.read()
            for type_name in types:
                check_message(device.further_message(type_name, FRAME), type_name, "further_message")

    @clause("a goal for a joint without torque becomes a jump when torque is enabled")
    def torque(self) -> None:
        with lifecycle.opened(self._factory) as device:
            goal = device.read().position_rad
            for state in ("before enable", "after release"):
                refuses(
                    lambda: device.write(goal),
                    DeviceError,
                    f"write {state}",
                    "write does not check that torque is on; some servos enable it themselves on a goal",
                )
                device.enable()
                device.release()

    @clause("an e-stop reports with it whether torque is off")
    def torque_read_back(self) -> None:
        with lifecycle.opened(self._factory) as device:
            device.enable()
            if device.read_torque() is None:
                return
            for verb, expected in (("enable", True), ("release", False)):
                getattr(device, verb)()
                told = device.read_torque()
                require(
                    told == dict.fromkeys(device.joint_names, expected),
                    f"read_torque after {verb} returned {told!r}",
                    "it repeats what the driver requested, or is not by joint name",
                )

    @clause("nobody expects a motion before the first command")
    def enable(self) -> None:
        cause = "enable does not set the goal to the present position before it switches torque on"
        with lifecycle.opened(self._factory) as device:
            self._require_still_enable(device, "enable", cause)
            for _ in range(ATTEMPTS):
                device.enable()
                goal = device.write(_far(device))
                device.release()  # while the joints are on their way: the device still has that goal
                if np.abs(device.read().position_rad - goal).max() > 2 * POSITION_TOLERANCE_RAD:
                    break
            self._require_still_enable(device, "enable after a release during a motion", cause)

    def _require_still_enable(self, device: Actuator, what: str, cause: str) -> None:
        for _ in range(ATTEMPTS):
            began_s = time.monotonic()
            device.enable()
            before = device.read().position_rad
            late = time.monotonic() - began_s > 5 * STALL_S
            moved = _moved(device, before, 0.3)
            require(moved <= POSITION_TOLERANCE_RAD, f"{what} moved a joint by {moved:.3f} rad", cause)
            if not late:
                return
            device.release()

    def limits(self) -> None:
        stops = "the limits keep the joint from its mechanical stops"
        with lifecycle.opened(self._factory) as device:
            device.enable()
            here, limits = device.read().position_rad, device.limits
            written = device.write(here)
            check_array("write(goal)", written, len(device.joint_names))
            off = float(np.abs(written - here).max())
            require(
                off <= RESOLUTION_RAD,
                f"write of the present position returned a goal {off:.3f} rad away from it",
                "the returned value is in another unit, or about another zero",
                "data sets record as action what write returns",
            )
            for label, goal in (
                ("above", limits.position_max_rad + 1),
                ("below", limits.position_min_rad - 1),
            ):
                over = _beyond(device.write(goal), limits)
                device.hold()
                require(
                    over <= 1e-6,
                    f"write of a goal 1 rad {label} the limits returned one {over:.3f} rad {label} them",
                    "write passes the goal on, or returns the requested goal instead of the written one",
                    stops,
                )
            beyond = _beyond(device.read().position_rad, limits)
            require(
                beyond <= POSITION_TOLERANCE_RAD,
                f"a joint is {beyond:.3f} rad beyond its limits after such goals",
                "write clamps the goal that it returns, but not the one that it sends",
                stops,
            )

    @clause("a value that is not a position must never reach a motor")
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
                refuses(
                    lambda goal=goal: device.write(goal),  # type: ignore[misc]
                    ValueError,
                    f"write of {label}",
                    "write does not begin with self.checked_goal(goal_rad)",
                )
            moved = _moved(device, here, 0.2)
            require(
                moved <= POSITION_TOLERANCE_RAD,
                f"a refused goal moved a joint by {moved:.3f} rad",
                "write checks the goal after it has sent it",
            )

    def motion(self) -> None:
        with lifecycle.opened(self._factory) as device:
            device.enable()
            self._travel(device)

    @clause("the node publishes velocity_rad_s; controllers and policies take it as rad/s")
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
                if attempt == ATTEMPTS - 1:
                    index = int(np.flatnonzero(seen)[wrong.argmax()])
                    raise ViolationError(
                        f"{device.joint_names[index]} moved by {moved[index]:.3f} rad, while its velocity "
                        f"over that time adds up to {added[index]:.3f} rad",
                        cause="velocity_rad_s is in degrees, ticks or turns, has the opposite sign, or is "
                        "never filled in",
                    )

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
            if not rest_s and left.max() <= POSITION_TOLERANCE_RAD / 2:
                rest_s = time.monotonic() + 0.2
            elif not rest_s and time.monotonic() > end:
                worst = int(left.argmax())
                raise ViolationError(
                    f"{device.joint_names[worst]} is {left[worst]:.3f} rad from its goal "
                    f"after {self._timeout_s:g} s; it had to move {step[worst]:.2f} rad",
                    "a goal in radians leads to that position in radians",
                    "write and read differ in unit, zero or direction, or torque is off after enable",
                )
            time.sleep(0.005)
        return readings

    @clause("hold is the safe state of an arm that must not fall")
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
                require(
                    moved <= 2 * POSITION_TOLERANCE_RAD,
                    f"a joint moved on by {moved:.3f} rad after hold",
                    "hold does not set the goal to the present position",
                )
                if np.abs(stop - goal).max() > 2 * POSITION_TOLERANCE_RAD or attempt > 1:
                    break

    @clause("release is the last resort and must not depend on the state before")
    def release(self) -> None:
        for state, reach in STATES.items():
            with lifecycle.made(self._factory) as device:
                reach(device)
                try:
                    device.release()
                    device.release()
                except Exception as error:
                    observed = f"release raised {type(error).__name__}: {error} ({state})"
                    raise ViolationError(observed, cause="release needs an open device, or torque") from error

    @clause(_STOPS)
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
        require(
            told is None or not any(told.values()),
            f"after {type(off).__name__}.run with RELEASE, read_torque returned {told!r}",
            "run reports what it wanted to reach instead of what it read back",
        )

    def _request(self, device: Actuator, action: str) -> SafeStopRequest | None:
        """Return the driver's request; None from one that has no safe stop and need not."""
        try:
            request: object = device.safe_stop_request(action, timeout_s=self._timeout_s)
        except NotImplementedError:
            spec = _spec_of(device)
            if spec is not None and not (spec.virtual or spec.stops_itself):
                warnings.warn(f"{type(device).__name__} has {NO_SAFE_STOP}", stacklevel=2)
            require(
                spec is None or not spec.safe_stop,
                "safe_stop_request is not overridden, and the plugin names a safe_stop",
                "the driver does not make the request that its plugin names",
            )
            return None
        require(
            isinstance(request, SafeStopRequest),
            f"safe_stop_request returned {type(request).__name__}",
            "it returns plain values instead of a joshua.api.SafeStopRequest",
        )
        assert isinstance(request, SafeStopRequest)
        return request

    def instances(self) -> None:
        with lifecycle.made(self._factory) as first, lifecycle.made(self._factory) as second:
            if not lifecycle.both_open(first, second, why=_TWO_DEVICES):
                return  # one device cannot be opened twice: nothing else to check
            first.enable()
            still = second.read().position_rad
            first.write(_far(first))
            refuses(
                lambda: second.write(still),
                DeviceError,
                "write to one while only the other has torque",
                lifecycle.SHARED,
                _TWO_DEVICES,
            )
            first.disconnect()
            require(second.connected, "closing one closed the other", lifecycle.SHARED, _TWO_DEVICES)
            second.read()


def _check_stop(request: SafeStopRequest, state: str) -> None:
    """Run a request as the guardian does, from its plain values; every joint must reach a state."""
    name = f"{type(request).__name__}.run with {request.action}"
    result: object = type(request).from_values(request.to_values()).run()
    require(
        isinstance(result, SafeStopResult),
        f"{name} returned {type(result).__name__}",
        "it returns plain values, or nothing, instead of a joshua.api.SafeStopResult",
    )
    assert isinstance(result, SafeStopResult)
    require(
        bool(result.joints) and set(result.joints.values()) == {state},
        f"{name} returned {result}; every joint should be {state!r}",
        "the device was not reached, or the result is not read back from it",
    )


def _spec_of(device: Actuator) -> ActuatorSpec | None:
    """Return what an installed plugin declares of a driver; None for one that no plugin names."""
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
