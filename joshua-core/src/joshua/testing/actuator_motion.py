"""Clauses of the conformance check about torque and motion."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping

import numpy as np

from joshua.devices.actuator import Actuator, DeviceError, FloatArray
from joshua.guardian.safe_stop import SafeStopRequest, SafeStopResult
from joshua.plugins import ActuatorSpec, load_registry
from joshua.testing import lifecycle
from joshua.testing.conformance import ViolationError, refuses, require
from joshua.testing.values import POSITION_TOLERANCE_RAD, RESOLUTION_RAD, check_array

ActuatorFactory = Callable[[], Actuator]

NO_SAFE_STOP = "no safe stop: if this driver dies, the joints keep their last goal"

#: A look that comes later has missed a motion; what it was to show is then done once more, so often at most.
LATE_S = 0.1
ATTEMPTS = 3

#: A hold during which the joint goes on for longer says more about the machine than about the driver.
LONG_HOLD_S = 0.02
HOLDS = 6


def _spec_of(device: Actuator) -> ActuatorSpec | None:
    """What an installed plugin declares of a driver; None for one that no plugin names."""
    name = f"{type(device).__module__}:{type(device).__qualname__}"
    specs = (spec for row in load_registry().rows() for spec in row.specs)
    return next(
        (spec for spec in specs if isinstance(spec, ActuatorSpec) and spec.implementation == name), None
    )


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


class MotionClauses:
    """One method for each clause; each makes its own device.

    Args:
        factory: makes an actuator that is not connected.
        timeout_s: how long a motion may take.
    """

    def __init__(self, factory: ActuatorFactory, timeout_s: float) -> None:
        self._factory = factory
        self._timeout_s = timeout_s

    def torque(self) -> None:
        """Nothing is commanded without torque; a released device does not take goals either."""
        with lifecycle.opened(self._factory) as device:
            goal = device.read().position_rad
            for state in ("before enable", "after release"):
                refuses(
                    lambda: device.write(goal),
                    DeviceError,
                    f"write {state}",
                    why="a goal for a joint without torque is a jump at the moment when torque comes",
                    cause="write does not look whether the joints are energised; some servos even energise "
                    "themselves when a goal is written",
                )
                device.enable()
                device.release()

    def torque_read_back(self) -> None:
        """What the device says of its torque is true; one that cannot say returns None."""
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
                    why="an e-stop tells the user by it whether the joints have torque",
                    cause="it repeats what the driver wanted, or is not by joint name",
                )

    def safe_stop(self) -> None:
        """What the driver prepares takes the torque off without it, and says so."""
        with lifecycle.opened(self._factory) as device:
            device.enable()
            try:
                request: object = device.safe_stop_request("RELEASE", timeout_s=self._timeout_s)
            except NotImplementedError:
                spec = _spec_of(device)
                if spec is not None and not (spec.virtual or spec.stops_itself):
                    warnings.warn(f"{type(device).__name__} has {NO_SAFE_STOP}", stacklevel=2)
                require(
                    spec is None or not spec.safe_stop,
                    "safe_stop_request is not overridden, and the plugin names a safe_stop",
                    why="no joint is energised before its guardian has what it needs",
                    cause="the driver does not make the request that its plugin names",
                )
                return
        if not isinstance(request, SafeStopRequest):
            raise ViolationError(
                f"safe_stop_request returned {type(request).__name__}",
                "the guardian reads a joshua.guardian.safe_stop.SafeStopRequest",
                "it returns plain values",
            )
        result: object = type(request).from_values(request.to_values()).run()
        if not isinstance(result, SafeStopResult):
            raise ViolationError(
                f"{type(request).__name__}.run returned {type(result).__name__}",
                "what is not said as a SafeStopResult counts as a failed stop",
                "it returns plain values, or nothing",
            )
        require(
            bool(result.joints) and result.complete,
            f"{type(request).__name__}.run returned {result}",
            why="the user is told by it which joints have no torque",
            cause="the device was not reached, or the state of its joints is not read back",
        )
        with lifecycle.opened(self._factory) as device:
            told = device.read_torque()
        require(
            told is None or not any(told.values()),
            f"after {type(request).__name__}.run read_torque returned {told!r}",
            why="it is what stops the joints when the driver is dead",
            cause="it says what it wanted to reach in place of what it read back",
        )

    def enable(self) -> None:
        """Torque comes without a motion."""
        with lifecycle.opened(self._factory) as device:
            for _ in range(ATTEMPTS):
                device.release()
                began_s = time.monotonic()
                device.enable()
                before = device.read().position_rad
                if time.monotonic() - began_s < LATE_S:
                    break
            moved = self._largest_way(device, before, 0.3)
            require(
                moved <= POSITION_TOLERANCE_RAD,
                f"enable moved a joint by {moved:.3f} rad",
                why="nobody expects a motion before the first command",
                cause="the goal is not seeded with the present position before torque is switched on",
            )

    def limits(self) -> None:
        """Write returns what was really written, which stays within the limits."""
        with lifecycle.opened(self._factory) as device:
            device.enable()
            here, limits = device.read().position_rad, device.limits
            written = device.write(here)
            check_array("write(goal)", written, len(device.joint_names))
            off = float(np.abs(written - here).max())
            require(
                off <= RESOLUTION_RAD,
                f"write of the present position returned a goal {off:.3f} rad away from it",
                why="what write returns is recorded as the action",
                cause="the returned value is in another unit, or about another zero",
            )
            for label, goal in (
                ("above", limits.position_max_rad + 1),
                ("below", limits.position_min_rad - 1),
            ):
                written = device.write(goal)
                device.hold()
                over = np.maximum(written - limits.position_max_rad, limits.position_min_rad - written).max()
                require(
                    over <= 1e-6,
                    f"write of a goal 1 rad {label} the limits returned one {over:.3f} rad {label} them",
                    why="the limits keep the joint from its mechanical stops",
                    cause="write passes the goal on, or returns what it was asked in place of what it wrote",
                )
            stands = device.read().position_rad
            beyond = np.maximum(stands - limits.position_max_rad, limits.position_min_rad - stands).max()
            require(
                beyond <= POSITION_TOLERANCE_RAD,
                f"a joint stands {beyond:.3f} rad beyond its limits after such goals",
                why="the limits keep the joint from its mechanical stops",
                cause="the goal is clamped in what write returns, and not in what it sends",
            )

    def refused_goals(self) -> None:
        """Goals that are no positions are refused and change nothing."""
        with lifecycle.opened(self._factory) as device:
            device.enable()
            here = device.write(device.read().position_rad)
            for label, goal in _bad_goals(here).items():
                refuses(
                    lambda goal=goal: device.write(goal),  # type: ignore[misc]
                    ValueError,
                    f"write of {label}",
                    why="a goal that is no position must never reach a motor",
                    cause="write does not begin with self.checked_goal(goal_rad)",
                )
            moved = self._largest_way(device, here, 0.2)
            require(
                moved <= POSITION_TOLERANCE_RAD,
                f"a refused goal moved a joint by {moved:.3f} rad",
                why="a goal that is no position must never reach a motor",
                cause="the goal is checked after it was sent",
            )

    def motion(self) -> None:
        """Joints reach a goal near by, in the direction that was asked."""
        with lifecycle.opened(self._factory) as device:
            device.enable()
            here, limits = device.read().position_rad, device.limits
            middle = (limits.position_min_rad + limits.position_max_rad) / 2
            step = np.minimum(0.2, (limits.position_max_rad - limits.position_min_rad) / 4)
            goal = here + np.where(middle >= here, step, -step)
            end = time.monotonic() + self._timeout_s
            while True:
                device.write(goal)
                left = np.abs(device.read().position_rad - goal)
                if left.max() <= POSITION_TOLERANCE_RAD / 2:
                    break
                if time.monotonic() > end:
                    worst = int(left.argmax())
                    raise ViolationError(
                        f"{device.joint_names[worst]} is {left[worst]:.3f} rad from its goal "
                        f"after {self._timeout_s:g} s; the way was {step[worst]:.2f} rad",
                        "a goal in radians leads to that position in radians",
                        "write and read differ in unit, zero or direction, or torque is off after enable",
                    )
                time.sleep(0.01)

    def hold(self) -> None:
        """Hold stops a motion."""
        with lifecycle.opened(self._factory) as device:
            device.enable()
            limits = device.limits
            middle = (limits.position_min_rad + limits.position_max_rad) / 2
            for left in range(HOLDS - 1, -1, -1):
                here = device.read().position_rad
                goal = device.write(
                    np.where(middle >= here, limits.position_max_rad, limits.position_min_rad)
                )
                time.sleep(0.03)
                began_s = time.monotonic()
                device.hold()
                stop = device.read().position_rad
                took_s = time.monotonic() - began_s
                moved = self._largest_way(device, stop, 0.4)
                if left and moved > 2 * POSITION_TOLERANCE_RAD and took_s > LONG_HOLD_S:
                    continue
                require(
                    moved <= 2 * POSITION_TOLERANCE_RAD,
                    f"a joint moved on by {moved:.3f} rad after hold",
                    why="hold is the safe state of an arm that must not fall",
                    cause="hold does not set the goal to the present position",
                )
                on_its_way = np.abs(stop - goal).max() > 2 * POSITION_TOLERANCE_RAD
                if on_its_way or left <= HOLDS - ATTEMPTS:
                    break

    def release(self) -> None:
        """Release works in every state."""
        for state, reach in STATES.items():
            with lifecycle.made(self._factory) as device:
                reach(device)
                try:
                    device.release()
                    device.release()
                except Exception as error:
                    raise ViolationError(
                        f"release raised {type(error).__name__}: {error} ({state})",
                        "release is the last resort and must not depend on what went before",
                        "release requires an open or energised device",
                    ) from error

    def instances(self) -> None:
        """Two actuators share nothing."""
        why = "a robot has two arms of the same kind in one process"
        cause = "state stands on the class or in the module in place of the instance"
        with lifecycle.made(self._factory) as first, lifecycle.made(self._factory) as second:
            if not lifecycle.both_open(first, second, why=why, cause=cause):
                return  # one device cannot be opened twice; separate objects are all there is to check
            first.enable()
            still = second.read().position_rad
            limits, here = first.limits, first.read().position_rad
            middle = (limits.position_min_rad + limits.position_max_rad) / 2
            first.write(np.where(middle >= here, limits.position_max_rad, limits.position_min_rad))
            refuses(
                lambda: second.write(still),
                DeviceError,
                "write to one while only the other is energised",
                why=why,
                cause=cause,
            )
            first.disconnect()
            require(second.connected, "closing one closed the other", why=why, cause=cause)
            second.read()

    @staticmethod
    def _largest_way(device: Actuator, start_rad: FloatArray, duration_s: float) -> float:
        """Largest distance of any joint from where it started, over a time."""
        end, largest = time.monotonic() + duration_s, 0.0
        while time.monotonic() < end:
            largest = max(largest, float(np.abs(device.read().position_rad - start_rad).max()))
            time.sleep(0.01)
        return largest


def _bad_goals(here: FloatArray) -> dict[str, FloatArray]:
    not_a_number, infinite = here.copy(), here.copy()
    not_a_number[-1], infinite[0] = np.nan, np.inf
    return {
        "NaN": not_a_number,
        "infinity": infinite,
        f"shape ({len(here) + 1},)": np.append(here, 0.0),
        f"shape (1, {len(here)})": here[None, :],
        "an empty array": np.zeros(0),
    }
