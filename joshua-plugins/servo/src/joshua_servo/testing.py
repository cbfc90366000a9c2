"""The conformance check of bus tools: finding motors on a bus, and assigning id and line speed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace

from joshua.api import DeviceDisconnected
from joshua.testing import resources
from joshua.testing.conformance import Checklist, name_of, refuses, require

from joshua_servo.bus_tools import AssignmentFailed, BusTools, FoundMotor
from joshua_servo.testing_values import check_description, check_motor

BusToolsFactory = Callable[[], BusTools]


def check_bus_tools(
    factory: BusToolsFactory,
    *,
    unplug: Callable[[BusTools], None] | None = None,
    only: Collection[str] = (),
) -> None:
    """Check a driver's tools against the contract of ``joshua_servo.bus_tools.BusTools``.

    The bus needs two or more motors at one line speed. The first one gets another id and line speed, then its
    own again. Torque stays off.

    Args:
        factory: makes tools on an open port of the bus. Each call makes new ones on a separate port, which is
            closed before the next call.
        unplug: disconnects the adapter of an open port. Without it, the clause about disconnection is
            skipped.
        only: names of the clauses to check, such as ``("scan",)`` while you fix one; empty for all.

    Raises:
        ConformanceError: lists every violated clause: what was observed, why it is wrong, the likely cause.
    """
    clauses = _BusToolsClauses(factory)
    checklist = Checklist(name_of(factory, lambda tools: tools.port.close()), only)
    if not checklist.run("constructor", clauses.constructor):
        checklist.finish()  # without a port there is nothing to check
        return
    checklist.run("description", clauses.description)
    if checklist.run("scan", clauses.scan):
        checklist.run("chosen speeds", clauses.chosen_speeds)
        checklist.run("line speed", clauses.line_speed)
        checklist.run("assign", clauses.assign)
        checklist.run("assign again", clauses.assign_again)
        checklist.run("assign speed", clauses.assign_speed)
        checklist.run("refused", clauses.refused)
        if unplug is not None:
            checklist.run("disconnection", lambda: clauses.disconnection(unplug))
    checklist.finish()


class _BusToolsClauses:
    """One method for each clause; each makes its own tools."""

    def __init__(self, factory: BusToolsFactory) -> None:
        self._factory = factory
        self._found: list[FoundMotor] = []

    def constructor(self) -> None:
        """The tools use the given port and start nothing by themselves."""
        with self._tools() as tools:
            require(
                isinstance(tools, BusTools),
                f"the factory made {type(tools).__name__}",
                why="joshua find-port, motors and doctor work with BusTools",
                cause="the class does not derive from joshua_servo.bus_tools.BusTools",
            )
            require(
                tools.port.is_open,
                "the port is closed after the constructor",
                why="the caller opened the port for several uses and closes it itself",
                cause="the constructor closes the port, or the factory does not open it",
            )
            before = resources.take()
            type(tools)(tools.port)
            left = resources.take().since(before)
            require(
                not left,
                f"the constructor opened {left}",
                why="a port gets tools of each family in turn until one of them finds a motor",
                cause="work that belongs into scan is done in __init__",
            )

    def description(self) -> None:
        """Name and settings of the motors."""
        with self._tools() as tools:
            check_description(tools)

    def scan(self) -> None:
        """Motors are yielded one by one, by line speed and then by id, each with its data."""
        with self._tools() as tools:
            found = tools.scan()
            require(
                isinstance(found, Iterator),
                f"scan() returned {type(found).__name__}",
                why="the user sees each motor as soon as scan finds it, because a scan of every speed "
                "takes long",
                cause="scan collects all motors first. Yield each one",
            )
            motors = list(found)
            require(
                len(motors) >= 2,
                f"scan() found {[str(motor) for motor in motors]}",
                why="this check needs at least two motors at one line speed, and scan must find all of them",
                cause="the bus has fewer motors, they have no supply, or scan waits too briefly for replies",
            )
            for motor in motors:
                check_motor(motor, tools)
            require(
                len({motor.baudrate for motor in motors}) == 1,
                f"scan() found motors at {sorted({motor.baudrate for motor in motors})} bit/s",
                why="this check needs motors at one line speed",
                cause="the motors have different speeds, or scan reports a motor at a speed that it does "
                "not have",
            )
            order = [(tools.baudrates.index(motor.baudrate), motor.motor_id) for motor in motors]
            require(
                order == sorted(set(order)),
                f"scan() yielded {_places(motors)} (id, bit/s)",
                why="the user sees each motor once, by line speed and then by id",
                cause="scan pings ids in another order, or finds a motor at two speeds",
            )
            self._found = motors

    def chosen_speeds(self) -> None:
        """Only the requested line speeds are searched, with the same motors."""
        with self._tools() as tools:
            home, *others = self._speeds(tools)
            for asked in ((others[0],), (others[0], home)) if others else ((home,),):
                seen = _places(tools.scan(asked))
                wanted = [place for place in _places(self._motors(tools)) if place[1] in asked]
                require(
                    seen == wanted,
                    f"scan({asked}) found {seen} (id, bit/s); expected {wanted}",
                    why="if the caller knows the speed, a scan of all speeds wastes time, and a scan must "
                    "not change a motor",
                    cause="scan ignores its argument, takes a late reply of one motor for the reply of the "
                    "next, or writes to a motor",
                )

    def line_speed(self) -> None:
        """The port's line speed is restored in all cases."""
        with self._tools() as tools:
            speeds = self._speeds(tools)
            for speed in speeds:
                tools.port.set_baudrate(speed)
                list(tools.scan(speeds[1:]))
                self._require_speed(tools, speed, "scan")
            found = tools.scan(speeds)
            next(found)
            getattr(found, "close", lambda: None)()
            self._require_speed(tools, speeds[-1], "a scan that ended early")

    def assign(self) -> None:
        """The motor replies only to its new id, and the others are unchanged."""
        with self._tools() as tools:
            motor, *others = self._motors(tools)
            free, speed = self._free_ids(tools)[0], tools.port.baudrate
            with self._put_back(tools):
                after = tools.assign(motor, free, motor.baudrate)
                self._require_speed(tools, speed, "assign")
                seen = _places(tools.scan((motor.baudrate,)))
                wanted = sorted([*_places(others), (free, motor.baudrate)])
                require(
                    _places([after]) == [(free, motor.baudrate)] and seen == wanted,
                    f"assign({motor.motor_id} → {free}) returned {after.motor_id}, and scan finds {seen} "
                    f"(id, bit/s); expected {wanted}",
                    why="the user labels the motor with its new id",
                    cause="assign locks the motor's memory too early, or another motor takes the id as well",
                )
            tools.assign(after, motor.motor_id, motor.baudrate)

    def assign_again(self) -> None:
        """A motor that already has its id is unchanged."""
        with self._tools() as tools:
            motor = self._motors(tools)[0]
            after = tools.assign(motor, motor.motor_id, motor.baudrate)
            require(
                (after.motor_id, after.baudrate, after.model)
                == (motor.motor_id, motor.baudrate, motor.model),
                f"assign of the present id and speed of {motor} returned {after}",
                why="a user may repeat joshua motors setup after an interruption",
                cause="assign takes the motor's own id for the id of another motor",
            )

    def assign_speed(self) -> None:
        """The motor replies only at its new line speed."""
        with self._tools() as tools:
            motor, *others = self._motors(tools)
            home, *more = self._speeds(tools)
            if not more:
                return
            other, speed = more[0], tools.port.baudrate
            with self._put_back(tools):
                after = tools.assign(motor, motor.motor_id, other)
                self._require_speed(tools, speed, "assign")
                seen = _places(tools.scan((home, other)))
                wanted = [*_places(others), (motor.motor_id, other)]
                require(
                    _places([after]) == wanted[-1:] and seen == wanted,
                    f"assign({motor.motor_id}, {other}) returned {after.motor_id} at {after.baudrate}, and "
                    f"scan finds {seen} (id, bit/s); expected {wanted}",
                    why="later requests to the motor use its new speed",
                    cause="assign writes the register code of another speed, or does not switch the port "
                    "to the new speed",
                )
            tools.assign(after, motor.motor_id, motor.baudrate)

    def refused(self) -> None:
        """Invalid values and duplicate ids are refused without a change."""
        with self._tools() as tools:
            motor, other, *_ = self._motors(tools)
            home, speed = motor.baudrate, tools.port.baudrate
            free, another = self._free_ids(tools)[:2]
            foreign, shared = max(tools.baudrates) + 1, replace(motor, shared=True)
            unchecked = "assign sends the value unchecked, and the motor takes its lowest bits"
            for what, one, motor_id, baudrate, cause in (
                (f"the id {tools.ids[-1] + 1}", motor, tools.ids[-1] + 1, home, unchecked),
                ("the id -1", motor, -1, home, unchecked),
                (f"{foreign} bit/s", motor, free, foreign, unchecked),
                (
                    f"the id {other.motor_id}, which another motor has",
                    motor,
                    other.motor_id,
                    home,
                    "assign does not check whether the id is free before it writes the id",
                ),
                (
                    "an id for several motors at once",
                    shared,
                    free,
                    home,
                    "assign does not check FoundMotor.shared",
                ),
                (
                    "an id to a motor that does not reply",
                    replace(motor, motor_id=another),
                    free,
                    home,
                    "assign sends the write without waiting for a reply, or sends it to all motors",
                ),
            ):
                refuses(
                    lambda args=(one, motor_id, baudrate): tools.assign(*args),  # type: ignore[misc]
                    AssignmentFailed,
                    f"assign of {what}",
                    why="the user can neither tell apart two motors with one id nor find a motor with an "
                    "unknown id",
                    cause=cause,
                )
                self._require_speed(tools, speed, f"a refused assign of {what}")
            seen, wanted = _places(tools.scan(self._speeds(tools))), _places(self._motors(tools))
            require(
                seen == wanted,
                f"assign refused all of that, but scan finds {seen} (id, bit/s) instead of {wanted}",
                why="a refused assign must leave the motor unchanged",
                cause="assign checks the value after writing it",
            )

    def disconnection(self, unplug: Callable[[BusTools], None]) -> None:
        """A disconnected adapter raises an error."""
        with self._tools() as tools:
            motor = self._motors(tools)[0]
            unplug(tools)
            for what, call in (
                ("scan()", lambda: list(tools.scan())),
                ("assign(motor)", lambda: tools.assign(motor, motor.motor_id, motor.baudrate)),
            ):
                refuses(
                    call,
                    DeviceDisconnected,
                    f"after unplugging, {what}",
                    why="the message must report the missing adapter, not missing motors",
                    cause="the tools take errors of the port for motors that do not reply",
                )

    # -- what the clauses share ---------------------------------------------------------------------------

    @contextmanager
    def _tools(self) -> Iterator[BusTools]:
        tools = self._factory()
        try:
            yield tools
        finally:
            tools.port.close()

    @contextmanager
    def _put_back(self, tools: BusTools) -> Iterator[None]:
        """If the clause fails, restore id and speed of the first motor if it is found."""
        try:
            yield
        except BaseException:
            with suppress(Exception):  # the first failure is more informative
                motor, *others = self._motors(tools)
                for found in list(tools.scan(self._speeds(tools))):
                    if _places([found])[0] not in _places(others):
                        tools.assign(found, motor.motor_id, motor.baudrate)
            raise

    def _motors(self, tools: BusTools) -> list[FoundMotor]:
        """All motors, at the line speed of the first one."""
        if not self._found:
            self._found = list(tools.scan())
        return self._found

    def _speeds(self, tools: BusTools) -> tuple[int, ...]:
        """The line speed of the motors, and the most common one without motors, if any."""
        home = self._motors(tools)[0].baudrate
        return (home, *[speed for speed in tools.baudrates if speed != home][:1])

    def _free_ids(self, tools: BusTools) -> list[int]:
        taken = {motor.motor_id for motor in self._motors(tools)}
        return [number for number in reversed(tools.ids) if number not in taken]

    @staticmethod
    def _require_speed(tools: BusTools, speed: int, what: str) -> None:
        require(
            tools.port.baudrate == speed,
            f"the port runs at {tools.port.baudrate} bit/s after {what}; it ran at {speed} before",
            why="the caller has chosen the port's speed and continues with it",
            cause="the method does not restore the speed on every path. Use try and finally",
        )


def _places(motors: Iterable[FoundMotor]) -> list[tuple[int, int]]:
    """Id and line speed of each."""
    return [(motor.motor_id, motor.baudrate) for motor in motors]
