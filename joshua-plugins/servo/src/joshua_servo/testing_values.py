"""Clauses about the data of bus tools and of the motors that they find."""

from __future__ import annotations

from joshua.testing.conformance import require

from joshua_servo.bus_tools import BusTools, FoundMotor

#: Voltages and temperatures beyond these are ticks or tenths, not V and °C.
PLAUSIBLE_V, PLAUSIBLE_C = (1.0, 60.0), (-40.0, 150.0)


def check_description(tools: BusTools) -> None:
    """Name and settings of the motors."""
    family, speeds, ids = tools.family, tools.baudrates, tools.ids
    models, factory_id = tools.expected_models, tools.factory_id
    require(
        isinstance(family, str) and bool(family),
        f"family is {family!r}",
        why="messages name the family of motors that a scan looks for",
        cause="the class does not set family",
    )
    require(
        isinstance(speeds, tuple) and bool(speeds) and all(type(s) is int and s > 0 for s in speeds),
        f"baudrates is {speeds!r}",
        why="scan tries these line speeds, the usual one first",
        cause="baudrates holds register codes instead of bit/s, is a list, or is empty",
    )
    require(
        len(set(speeds)) == len(speeds),
        f"baudrates {speeds} lists a speed twice",
        why="scan tries each speed once, because each takes time",
        cause="two register codes stand for one speed",
    )
    require(
        isinstance(ids, range) and factory_id in ids,
        f"ids is {ids!r} and factory_id {factory_id!r}",
        why="a new motor replies to factory_id and gets one of ids",
        cause="ids is not a range, begins after factory_id, or ends before it",
    )
    require(
        isinstance(models, tuple) and bool(models) and all(isinstance(m, str) and m for m in models),
        f"expected_models is {models!r}",
        why="joshua reports a motor that the driver cannot drive",
        cause="expected_models holds numbers instead of names, or is empty",
    )


def check_motor(motor: object, tools: BusTools) -> None:
    """The data of a motor, in V and °C."""
    require(
        isinstance(motor, FoundMotor),
        f"scan() yielded {type(motor).__name__}",
        why="find-port, motors and doctor show the fields of a FoundMotor",
        cause="scan yields ids instead of FoundMotor",
    )
    assert isinstance(motor, FoundMotor)
    require(
        motor.motor_id in tools.ids and motor.baudrate in tools.baudrates,
        f"a motor was found with id {motor.motor_id} at {motor.baudrate} bit/s",
        why="joshua can use neither an id outside ids nor a speed outside baudrates",
        cause="scan takes an echo or a damaged reply for a motor",
    )
    require(
        not motor.shared,
        f"several motors answer to id {motor.motor_id}",
        why="this check needs a bus on which each motor has an id of its own",
        cause="two motors have one id, or scan takes one damaged reply for two motors",
    )
    require(
        motor.model in tools.expected_models,
        f"the motor {motor.motor_id} is a {motor.model!r}; expected {' or '.join(tools.expected_models)}",
        why="the driver refuses unknown models",
        cause="scan does not convert the model number into a name, or expected_models lacks the model",
    )
    for what, value, (low, high) in (
        ("voltage_v", motor.voltage_v, PLAUSIBLE_V),
        ("min_voltage_v", motor.min_voltage_v, (0.0, PLAUSIBLE_V[1])),
        ("max_voltage_v", motor.max_voltage_v, PLAUSIBLE_V),
        ("temperature_c", motor.temperature_c, PLAUSIBLE_C),
        ("max_temperature_c", motor.max_temperature_c, PLAUSIBLE_C),
    ):
        require(
            value is None or low <= value <= high,
            f"{what} of motor {motor.motor_id} is {value}",
            why="joshua doctor compares it with limits in V and °C",
            cause="scan returns the register's own unit, such as tenths of a volt",
        )
