"""The conformance check of actuators."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection

import numpy as np

from joshua.devices.actuator import Actuator, JointReading
from joshua.messages import encode, known_types
from joshua.testing import lifecycle
from joshua.testing.actuator_motion import STATES, ActuatorFactory, MotionClauses
from joshua.testing.conformance import Checklist, name_of, require
from joshua.testing.values import (
    PLAUSIBLE_RAD,
    PLAUSIBLE_RAD_S,
    POSITION_TOLERANCE_RAD,
    check_array,
    check_plausible,
)


def check_actuator(
    factory: ActuatorFactory,
    *,
    unplug: Callable[[Actuator], None] | None = None,
    timeout_s: float = 10.0,
    only: Collection[str] = (),
) -> None:
    """Checks a driver against the contract of ``joshua.devices.actuator.Actuator``.

    The joints move: about 0.2 rad, within their limits. Run it on a simulator, an emulator, or an arm that
    has room.

    Args:
        factory: makes an actuator that is not connected; each call a new one.
        unplug: makes an open device vanish, such as by closing the far end of its link; without it the
            clause about disconnection is left out.
        timeout_s: how long a motion or the detection of a disconnection may take.
        only: names of the clauses to check, such as ``("limits",)`` while one is mended; empty for all.

    Raises:
        ConformanceError: lists every violated clause: what was observed, why it is wrong, the likely cause.
    """
    clauses = _ActuatorClauses(factory)
    motion = MotionClauses(factory, timeout_s)
    checklist = Checklist(name_of(factory, lambda device: device.disconnect()), only)
    checklist.run("constructor", lambda: lifecycle.check_constructor(factory, Actuator))
    checklist.run("description", clauses.description)
    checklist.run("order", clauses.order)
    if checklist.run("connection", lambda: lifecycle.check_connection(factory)):
        checklist.run("joints", clauses.joints)
        checklist.run("reading", clauses.reading)
        checklist.run("stamps", clauses.stamps)
        checklist.run("own data", clauses.own_data)
        checklist.run("further messages", clauses.further_messages)
        checklist.run("torque", motion.torque)
        checklist.run("torque read back", motion.torque_read_back)
        checklist.run("enable", motion.enable)
        checklist.run("limits", motion.limits)
        checklist.run("refused goals", motion.refused_goals)
        checklist.run("motion", motion.motion)
        checklist.run("hold", motion.hold)
        checklist.run("release", motion.release)
        checklist.run("safe stop", motion.safe_stop)
        checklist.run("close", lambda: lifecycle.check_idempotent_close(factory, STATES))
        checklist.run("nothing left", lambda: lifecycle.check_nothing_left(factory, clauses.use))
        checklist.run("instances", motion.instances)
        if unplug is not None:
            checklist.run(
                "disconnection",
                lambda: lifecycle.check_unplugged(factory, unplug, lambda device: device.read(), timeout_s),
            )
    checklist.finish()


class _ActuatorClauses:
    """One method for each clause; each makes its own device."""

    def __init__(self, factory: ActuatorFactory) -> None:
        self._factory = factory

    @staticmethod
    def use(device: Actuator) -> None:
        """Uses a device as a node does."""
        device.read()
        device.enable()
        device.write(device.read().position_rad)
        device.hold()
        device.release()

    def joints(self) -> None:
        """Connecting changes no joint."""
        with lifecycle.made(self._factory) as device:
            before = device.joint_names
            device.connect()
            after = device.joint_names
        require(
            before == after,
            f"connect changed joint_names from {before} to {after}",
            why="the plan, a leader and data sets name the joints before the device is open",
            cause="the names are those of the device, and the settings do not say which it has",
        )

    def description(self) -> None:
        """Names and limits are known without a connection, in radians."""
        with lifecycle.made(self._factory) as device:
            names, limits = device.joint_names, device.limits
        require(
            isinstance(names, tuple) and bool(names) and all(isinstance(n, str) and n for n in names),
            f"joint_names is {names!r}",
            why="messages name each joint",
            cause="the names are not made from the settings as a tuple of strings",
        )
        require(
            len(set(names)) == len(names),
            f"joint_names {names} holds a name twice",
            why="commands find their joints by name",
            cause="the names are made from something that two joints share",
        )
        for label in ("position_min_rad", "position_max_rad", "velocity_max_rad_s"):
            check_array(f"limits.{label}", getattr(limits, label), len(names))
        for index, name in enumerate(names):
            low, high = limits.position_min_rad[index], limits.position_max_rad[index]
            require(
                low < high,
                f"the limits of {name} are {low:g} to {high:g} rad",
                why="a joint without a range cannot be commanded",
                cause="the ends are swapped, or a direction is inverted without swapping them",
            )
        largest = max(np.abs(limits.position_min_rad).max(), np.abs(limits.position_max_rad).max())
        check_plausible(f"a limit is {largest:g} rad", largest, PLAUSIBLE_RAD)
        fastest = float(limits.velocity_max_rad_s.max())
        check_plausible(f"a speed limit is {fastest:g} rad/s", fastest, PLAUSIBLE_RAD_S)
        require(
            float(limits.velocity_max_rad_s.min()) > 0,
            f"the speed limits are {limits.velocity_max_rad_s}",
            why="a joint whose speed limit is not above zero never moves",
            cause="a vendor's 0, which means «no limit», is taken as a speed",
        )

    def order(self) -> None:
        """Before connect, only release and disconnect work."""
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
        """A reading holds float64 arrays of shape (N,), finite, in radians, within the limits."""
        with lifecycle.opened(self._factory) as device:
            reading, count = device.read(), len(device.joint_names)
            require(
                isinstance(reading, JointReading),
                f"read returned {type(reading).__name__}",
                why="the node publishes a JointReading",
                cause="read returns what the library underneath returns",
            )
            for label in ("position_rad", "velocity_rad_s", "effort"):
                check_array(f"read().{label}", getattr(reading, label), count)
            position, limits = reading.position_rad, device.limits
            largest = float(np.abs(position).max())
            check_plausible(f"a position is {largest:g} rad", largest, PLAUSIBLE_RAD)
            fastest = float(np.abs(reading.velocity_rad_s).max())
            check_plausible(f"a velocity is {fastest:g} rad/s", fastest, PLAUSIBLE_RAD_S)
            beyond = np.maximum(limits.position_min_rad - position, position - limits.position_max_rad).max()
            require(
                beyond <= POSITION_TOLERANCE_RAD,
                f"a joint stands {beyond:.3f} rad beyond its limits",
                why="state and limits must agree about zero and direction",
                cause="zero, direction or unit of read and limits differ",
            )

    def stamps(self) -> None:
        """Stamps are ns since the epoch, at acquisition, and increase."""
        with lifecycle.opened(self._factory) as device:
            last = 0
            for _ in range(20):
                before_ns = time.time_ns()
                stamp_ns = device.read().stamp_ns
                lifecycle.check_stamp(stamp_ns, before_ns, time.time_ns())
                require(
                    stamp_ns > last,
                    f"stamp_ns went from {last} to {stamp_ns}",
                    why="each reading is a new acquisition, later than the one before",
                    cause="the stamp is kept from connect, or a stored reading is returned again",
                )
                last = stamp_ns

    def own_data(self) -> None:
        """What a reading, the limits or a write hand out belongs to the caller."""
        with lifecycle.opened(self._factory) as device:
            first = device.read()
            kept = first.position_rad.copy()
            if first.position_rad.flags.writeable:
                first.position_rad[:] += 1e3
            second = device.read().position_rad
            require(
                bool(np.abs(second - kept).max() < PLAUSIBLE_RAD),
                "a change of one reading shows in the next",
                why="a reading is kept by others while the device goes on",
                cause="read returns the driver's own array in place of a copy",
            )
            device.enable()
            goal = device.read().position_rad.copy()
            asked = goal.copy()
            written = device.write(goal)
            require(
                bool((goal == asked).all()) and written is not goal,
                "write changed or returned the array that it was given",
                why="the caller's goal is the caller's",
                cause="the clamp works in place",
            )

    def further_messages(self) -> None:
        """Each further type is known without a connection, and becomes a message that can be sent."""
        with lifecycle.made(self._factory) as device:
            types = device.further_types
        unknown = [name for name in types if name not in known_types()]
        require(
            not unknown,
            f"further_types names {unknown[0] if unknown else ''}, which is no known ROS 2 type",
            why="a topic's type is a ROS 2 type such as sensor_msgs/msg/BatteryState",
            cause="a name without /msg/, or the enum name of the configuration file",
        )
        with lifecycle.opened(self._factory) as device:
            device.read()
            for type_name in types:
                message = device.further_message(type_name, "frame_of_the_test")
                made = getattr(message, "__msgtype__", type(message).__name__)
                require(
                    made == type_name,
                    f"further_message made {made} where {type_name} was asked for",
                    why="the topic carries the type that the file says, from the first reading on",
                    cause="further_message ignores type_name, or waits for something else than read",
                )
                encode(message)
                header = getattr(message, "header", None)
                require(
                    header is None or header.frame_id == "frame_of_the_test",
                    f"{type_name} has frame_id {getattr(header, 'frame_id', '')!r}",
                    why="the file says which frame the data are in",
                    cause="further_message does not use its argument frame_id",
                )
