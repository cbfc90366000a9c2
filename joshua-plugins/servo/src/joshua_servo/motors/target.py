"""Selects the bus of `joshua motors`: from a node of a configuration or the command line."""

from __future__ import annotations

import argparse
import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from joshua.tools import install
from joshua_serial.ports.bus_plugins import short_name
from joshua_serial.usb_ports import Endpoint

from joshua_servo.motors.setup_procedure import WantedMotor

if TYPE_CHECKING:
    from joshua.tools import Wanted

    from joshua_servo.bus_tools import BusTools

#: Refuses a typo such as 1-60000000. The family decides which smaller ids are valid.
MOST_IDS = 1000


class TargetRefused(Exception):
    """The bus or its motors are unclear. The message says what to write."""


@dataclass(frozen=True)
class Target:
    """A bus and its future motors.

    Attributes:
        tools: of the motors' family; motors: in cable order.
        option: part of the command line that names this bus, for a command that continues later.
    """

    tools: type[BusTools]
    endpoint: Endpoint
    baudrate: int
    motors: tuple[WantedMotor, ...]
    option: str


def parse_ids(text: str) -> tuple[int, ...]:
    """Read ids such as ``1-6`` or ``1,2,5``. Raises ArgumentTypeError."""
    ids: list[int] = []
    try:
        for part in text.split(","):
            first, dash, last = part.partition("-")
            ids += range(int(first), min(int(last), int(first) + MOST_IDS) + 1) if dash else [int(first)]
    except ValueError:
        ids = []
    if not ids or len(set(ids)) != len(ids) or min(ids) < 0 or len(ids) > MOST_IDS:
        raise argparse.ArgumentTypeError(f"expected ids, each once, such as 1-6 or 1,2,5; found {text!r}")
    return tuple(ids)


def find_target(arguments: argparse.Namespace, families: Mapping[str, type[BusTools]]) -> Target:
    """Return the bus of the command line. Raises TargetRefused."""
    if not families:
        raise TargetRefused(f"no installed plugin drives a bus of motors: {install('joshua-sts3215')}")
    return _from_file(arguments, families) if arguments.config else _from_options(arguments, families)


def _from_options(arguments: argparse.Namespace, families: Mapping[str, type[BusTools]]) -> Target:
    if not (arguments.port and arguments.ids):
        raise TargetRefused(
            "name the motors: --config FILE [--node NAME], or --port PATH --ids 1-6 "
            "(joshua find-port lists ports)"
        )
    tools = families[_block(arguments.kind, families)]
    motors = tuple(WantedMotor(motor_id, f"joint_{motor_id}") for motor_id in arguments.ids)
    option = f"--port {arguments.port}" + (f" --kind {arguments.kind}" if arguments.kind else "")
    baudrate = _baudrate(arguments.baudrate or tools.baudrates[0], tools)
    if arguments.baudrate:
        option += f" --baudrate {baudrate}"
    return Target(tools, Endpoint(arguments.port), baudrate, _possible(motors, tools), option)


def _block(kind: str, families: Mapping[str, type[BusTools]]) -> str:
    names = {short_name(block): block for block in families}
    if kind in names:
        return names[kind]
    if kind or len(names) > 1:
        near = difflib.get_close_matches(kind, list(names), n=1)
        found = (
            f"there is no kind {kind!r}{f'; nearest: {near[0]}' if near else ''}"
            if kind
            else "--kind is missing"
        )
        raise TargetRefused(f"{found}; choose one of {', '.join(names)}")
    return next(iter(families))


def _from_file(arguments: argparse.Namespace, families: Mapping[str, type[BusTools]]) -> Target:
    wanted = {want.entry.node.node_name: want for want in _buses(arguments.config, families)}
    want = _chosen(arguments, wanted)
    name = want.entry.node.node_name
    tools = families[want.block_name]
    block: Any = want.block
    serial = block.comm.serial
    endpoint = (
        Endpoint(arguments.port)
        if arguments.port
        else Endpoint(serial.port, serial.serial_number, serial.vid_pid)
    )
    if not (endpoint.path or endpoint.serial_number or endpoint.vid_pid):
        raise TargetRefused(f"{name} has no serial port: add --port PATH (joshua find-port lists ports)")
    names = _joint_names(arguments.config, name)
    motors = [WantedMotor(number, names.get(number, f"joint_{number}")) for number in block.motor_ids]
    if arguments.ids:
        motors = [motor for motor in motors if motor.motor_id in arguments.ids]
        unknown = set(arguments.ids) - {motor.motor_id for motor in motors}
        if unknown:
            raise TargetRefused(
                f"{name} has no motor {', '.join(map(str, sorted(unknown)))}: motor_ids of the file are "
                f"{', '.join(map(str, block.motor_ids))}"
            )
    baudrate = _baudrate(arguments.baudrate or serial.baudrate or tools.baudrates[0], tools)
    option = f"--config {arguments.config} --node {name}" + (
        f" --port {arguments.port}" if arguments.port else ""
    )
    return Target(tools, endpoint, baudrate, _possible(motors, tools), option)


def _buses(path: str, families: Mapping[str, type[BusTools]]) -> list[Wanted]:
    from joshua.tools import EditError, load_readable, wanted_nodes

    try:
        loaded = load_readable(path)
    except EditError as error:
        raise TargetRefused(str(error)) from error
    found = wanted_nodes(loaded.graph, devices=True, models=False)
    return [want for want in found if want.block_name in families]


def _chosen(arguments: argparse.Namespace, wanted: Mapping[str, Wanted]) -> Wanted:
    listing = ", ".join(wanted) or "none"
    if arguments.node:
        if arguments.node in wanted:
            return wanted[arguments.node]
        near = difflib.get_close_matches(arguments.node, list(wanted), n=1)
        hint = f"; nearest: {near[0]}" if near else ""
        raise TargetRefused(
            f"{arguments.config} has no node {arguments.node!r} with a bus of motors{hint}. Nodes with one: "
            f"{listing}"
        )
    if len(wanted) == 1:
        return next(iter(wanted.values()))
    if not wanted:
        raise TargetRefused(f"{arguments.config} has no node with a bus of motors")
    raise TargetRefused(f"{arguments.config} has several buses: add --node with one of {listing}")


def _joint_names(path: str, node: str) -> dict[int, str]:
    """Names of the joints by id, if the file has a calibration of the node."""
    from joshua.tools import load

    arms = load(path).config.calibration.arms
    return {motor.id: motor.joint_name for arm in arms if arm.node_name == node for motor in arm.motors}


def _baudrate(baudrate: int, tools: type[BusTools]) -> int:
    if baudrate not in tools.baudrates:
        allowed = ", ".join(map(str, tools.baudrates))
        raise TargetRefused(
            f"{tools.family} do not support a line speed of {baudrate} bit/s: allowed {allowed}"
        )
    return baudrate


def _possible(motors: Sequence[WantedMotor], tools: type[BusTools]) -> tuple[WantedMotor, ...]:
    wrong = [motor for motor in motors if motor.motor_id not in tools.ids]
    if wrong:
        raise TargetRefused(
            f"{tools.family} cannot have the id {wrong[0].motor_id}: "
            f"allowed {tools.ids.start} to {tools.ids.stop - 1}"
        )
    return tuple(motors)
