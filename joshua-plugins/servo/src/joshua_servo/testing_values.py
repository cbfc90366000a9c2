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
        why="the user is told which motors are looked for",
        cause="the class does not set family",
    )
    require(
        isinstance(speeds, tuple) and bool(speeds) and all(type(s) is int and s > 0 for s in speeds),
        f"baudrates is {speeds!r}",
        why="these line speeds are looked at, the usual one first",
        cause="codes of the register are given in place of bit/s, or a list or nothing",
    )
    require(
        len(set(speeds)) == len(speeds),
        f"baudrates {speeds} holds a speed twice",
        why="each speed is looked at once, which takes its time",
        cause="two codes of the register mean one speed",
    )
    require(
        isinstance(ids, range) and factory_id in ids,
        f"ids is {ids!r} and factory_id {factory_id!r}",
        why="a new motor answers to the factory's id and gets one of ids",
        cause="ids is no range, begins after the factory's id, or ends before it",
    )
    require(
        isinstance(models, tuple) and bool(models) and all(isinstance(m, str) and m for m in models),
        f"expected_models is {models!r}",
        why="a motor that the driver cannot drive is remarked upon",
        cause="model numbers are given in place of names, or nothing",
    )


def check_motor(motor: object, tools: BusTools) -> None:
    """The data of a motor, in V and °C."""
    require(
        isinstance(motor, FoundMotor),
        f"scan() yielded {type(motor).__name__}",
        why="find-port, motors and doctor show what a FoundMotor says",
        cause="ids are yielded in place of FoundMotor",
    )
    assert isinstance(motor, FoundMotor)
    require(
        motor.motor_id in tools.ids and motor.baudrate in tools.baudrates,
        f"a motor was found with id {motor.motor_id} at {motor.baudrate} bit/s",
        why="an id that cannot be given, or a speed that cannot be set, leads nowhere",
        cause="an echo or a broken reply is taken for a motor",
    )
    require(
        not motor.shared,
        f"several motors answer to id {motor.motor_id}",
        why="this check needs a bus on which each motor has an id of its own",
        cause="two motors have one id, or a reply that was broken once is taken for two",
    )
    require(
        motor.model in tools.expected_models,
        f"the motor {motor.motor_id} is a {motor.model!r}; expected are {', '.join(tools.expected_models)}",
        why="the driver refuses models that it does not know",
        cause="the model's number is not turned into its name, or the model is missing in expected_models",
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
            cause="the register's own unit, such as tenths of a volt, is handed out",
        )
