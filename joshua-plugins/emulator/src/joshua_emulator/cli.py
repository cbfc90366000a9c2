"""The command line of the emulator process."""

from __future__ import annotations

import argparse
import gc
import json
import os
import signal
import sys
import tempfile
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from joshua_emulator.arms import ARMS
from joshua_emulator.camera import cli as camera_cli
from joshua_emulator.control import ControlError
from joshua_emulator.dynamixel import registers as dynamixel
from joshua_emulator.dynamixel.assembly import DynamixelAssembly
from joshua_emulator.dynamixel.models import MODELS
from joshua_emulator.eeprom_store import EepromStoreError
from joshua_emulator.emulator_process import FAULT_REFUSED
from joshua_emulator.encoder import cli as encoder_cli
from joshua_emulator.feetech import registers as feetech
from joshua_emulator.feetech.assembly import FeetechAssembly
from joshua_emulator.gamepad import cli as gamepad_cli
from joshua_emulator.lidar import cli as lidar_cli
from joshua_emulator.motion import MotionError
from joshua_emulator.servo_bus.assembly import BusAssembly, BusSpec, SpecError
from joshua_emulator.spike import cli as spike_cli
from joshua_emulator.station import Station

_BUSES: dict[str, type[BusAssembly[Any]]] = {"feetech": FeetechAssembly, "dynamixel": DynamixelAssembly}


@dataclass(frozen=True)
class Machine:
    """Interface of an emulated device for the command line.

    Attributes:
        facts: content of the JSON line at the start.
        handle: executes one request, like the control channel.
        run: serves until ``stop``, or until one of the file descriptors reaches its end.
        stop: ends ``run``; close: cleans up.
    """

    facts: dict[str, Any]
    handle: Callable[[dict[str, Any]], dict[str, Any]]
    run: Callable[[Collection[int]], None]
    stop: Callable[[], None]
    close: Callable[[], None]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one emulated device until it is stopped; print one line of JSON when it is ready."""
    options = _parser().parse_args(arguments)
    if options.root:
        return emulate(options, options.root)
    # Removed by this process because its parent may be killed.
    with tempfile.TemporaryDirectory(prefix="joshua-emulator-", ignore_cleanup_errors=True) as folder:
        return emulate(options, Path(folder))


def emulate(options: argparse.Namespace, root: Path) -> int:
    """Run the device below a folder. Return the exit code."""
    try:
        machine = MAKERS.get(options.protocol, _bus)(options, root)
    except (EepromStoreError, ControlError, MotionError, SpecError, OSError) as error:
        print(f"joshua-emulator: {error}", file=sys.stderr)  # noqa: T201 - the output of this program
        return 2
    try:
        for text in options.fault:
            machine.handle({"op": "fault", **parse_fault(text)})
    except ControlError as error:
        machine.close()
        print(f"joshua-emulator: {error}", file=sys.stderr)  # noqa: T201 - the output of this program
        return FAULT_REFUSED
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: machine.stop())
    wake, wake_writer = os.pipe()  # a signal must wake the loop
    os.set_blocking(wake_writer, False)
    signal.set_wakeup_fd(wake_writer)
    facts = {"pid": os.getpid(), "root": str(root), **machine.facts}
    print(json.dumps(facts), flush=True)  # noqa: T201 - read by whoever started this process
    gc.freeze()
    gc.disable()  # the loop creates no reference cycles, and a collection would delay a reply
    try:
        machine.run((sys.stdin.fileno(), wake) if options.until_stdin_closes else (wake,))
    finally:
        machine.close()
    return 0


def parse_fault(text: str) -> dict[str, Any]:
    """Read a fault such as ``drop=0.01``, ``silent=3,at_s=2`` or ``unplug,at_s=5,replug_after_s=1``."""
    first, *rest = text.split(",")
    kind, equals, value = first.partition("=")
    request: dict[str, Any] = {"kind": kind.strip()}
    if equals:
        request["value"] = _number(value)
    for part in rest:
        key, equals, setting = (piece.strip() for piece in part.partition("="))
        if not (equals and setting):
            raise ControlError(f"fault {text!r}: {part!r} needs a value, as in at_s=5")
        if key in ("op", "kind", "value"):
            raise ControlError(
                f"fault {text!r}: {key!r} is not a setting; write the fault as KIND=VALUE,at_s=5"
            )
        if key in request:
            raise ControlError(f"fault {text!r}: {key} is set twice; leave one of them out")
        request[key] = _number(setting)
    return request


def _bus(options: argparse.Namespace, root: Path) -> Machine:
    assembly = _BUSES[options.protocol](_spec(options, root))
    assembly.station.replug(options.name)
    if options.motion:
        assembly.operations.start_motion(*_parse_settings(options.motion))
    line = assembly.station.line
    facts = {
        "port": str(line.port),
        "by_id": str(line.by_id),
        "identity": line.identity,
        "root": str(line.root),
        "control": str(assembly.spec.control),
        "joints": assembly.joint_names,
    }
    station = assembly.station
    return Machine(facts, assembly.operations.handle, station.run, station.stop, assembly.close)


def _camera(options: argparse.Namespace, root: Path) -> Machine:
    server = camera_cli.make_server(options, root)
    assert server.control is not None
    return Machine(
        camera_cli.ready_facts(server), server.control.handler, server.run, server.stop, server.close
    )


def _hub(options: argparse.Namespace, root: Path) -> Machine:
    machine = spike_cli.make_machine(options, root)
    assert machine.control is not None
    handle = machine.control.handler
    if options.motion:
        kind, settings = _parse_settings(options.motion)
        handle({"op": "motion", "kind": kind, **settings})
    return Machine(spike_cli.ready_facts(machine), handle, machine.run, machine.stop, machine.close)


def _serial_sensor(station: Station) -> Machine:
    facts = {
        "port": str(station.line.port),
        "by_id": str(station.line.by_id),
        "identity": station.line.identity,
        "control": str(station.control.path),
    }
    return Machine(facts, station.control.handler, station.run, station.stop, station.close)


def _gamepad(options: argparse.Namespace, root: Path) -> Machine:
    server = gamepad_cli.make_server(options, root)
    assert server.control is not None
    return Machine(
        gamepad_cli.ready_facts(server), server.control.handler, server.run, server.stop, server.close
    )


MAKERS: dict[str, Callable[[argparse.Namespace, Path], Machine]] = {
    "camera": _camera,
    "encoder": lambda options, root: _serial_sensor(encoder_cli.make_station(options, root)),
    "gamepad": _gamepad,
    "lidar": lambda options, root: _serial_sensor(lidar_cli.make_station(options, root)),
    "spike": _hub,
}


def _spec(options: argparse.Namespace, root: Path) -> BusSpec:
    return BusSpec(
        ids=options.ids,
        root=root,
        control=options.control or root / "control.sock",
        name=options.name,
        identity=options.identity,
        eeprom=options.eeprom,
        arm=options.arm,
        calibrated=options.calibrated,
        baudrate=options.baudrate,
        return_delay_s=options.return_delay_s,
        models=options.models,
        volts=options.volts,
        seed=options.seed,
        echo=options.echo,
        burst_window_s=options.burst_window_s,
        physics=options.physics,
        physics_actuators=options.physics_actuators,
        physics_start_rad=options.physics_start_rad,
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="joshua-emulator", description="Emulated robot hardware.")
    protocols = parser.add_subparsers(dest="protocol", required=True)
    _add_bus(protocols, "feetech", "a bus of STS3215 servos", feetech.BAUDRATES.values(), "model numbers")
    speeds = dynamixel.BAUDRATES.values()
    _add_bus(protocols, "dynamixel", "a bus of X-series servos", speeds, f"models, of {', '.join(MODELS)}")
    camera_cli.add_parser(protocols)
    encoder_cli.add_parser(protocols)
    lidar_cli.add_parser(protocols)
    gamepad_cli.add_parser(protocols)
    spike_cli.add_parser(protocols)
    return parser


def _add_bus(protocols: Any, name: str, summary: str, baudrates: Iterable[int], models: str) -> None:
    bus = protocols.add_parser(name, help=summary)
    bus.add_argument(
        "--ids", type=_ids, default=(1, 2, 3, 4, 5, 6), help="bus ids in cable order: 1-6 or 1,2,5"
    )
    bus.add_argument("--root", type=Path, help="folder for dev/ and sys/; default is a new temporary folder")
    bus.add_argument("--name", default="ttyACM0", help="device name of the port")
    bus.add_argument("--identity", default="EMULATED0", help="USB serial number of the adapter")
    bus.add_argument(
        "--control", type=Path, help="control socket; default is control.sock in the root folder"
    )
    bus.add_argument("--eeprom", type=Path, help="file that keeps the EEPROM across runs")
    bus.add_argument(
        "--arm", choices=sorted(ARMS), default="", help="arm whose stops and joint names the servos have"
    )
    bus.add_argument("--calibrated", action="store_true", help="start with calibrated EEPROM contents")
    bus.add_argument("--baudrate", type=int, choices=sorted(baudrates), default=1_000_000)
    bus.add_argument(
        "--return-delay-s", type=float, default=0.0, help="return delay of the servos, at most 508e-6"
    )
    bus.add_argument("--models", type=_names, default=(), help=f"{models}, in cable order")
    bus.add_argument("--volts", type=float, help="voltage of the supply")
    bus.add_argument("--seed", type=int, default=0, help="seed of the line faults")
    bus.add_argument("--echo", action="store_true", help="the adapter echoes what the host sends")
    bus.add_argument(
        "--burst-window-s",
        type=float,
        default=0.0005,
        help="the adapter delivers replies this close together",
    )
    bus.add_argument("--physics", type=Path, help="socket of a simulation that moves the joints")
    bus.add_argument(
        "--physics-actuators", type=_names, default=(), help="joints of its model, in cable order"
    )
    bus.add_argument(
        "--physics-start-rad", type=_floats, default=(), help="initial positions, relative to their middles"
    )
    bus.add_argument("--motion", help="motion of the user's hand: sine, sweep, file,file=PATH")
    bus.add_argument("--fault", action="append", default=[], help="drop=0.01, silent=3, unplug,at_s=5, …")
    bus.add_argument(
        "--until-stdin-closes", action="store_true", help="exit with the process that started this one"
    )


def _names(text: str) -> tuple[str, ...]:
    return tuple(text.split(","))


def _floats(text: str) -> tuple[float, ...]:
    return tuple(float(part) for part in text.split(","))


def _ids(text: str) -> tuple[int, ...]:
    numbers: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        numbers += range(int(first), int(last) + 1) if dash else [int(first)]
    return tuple(numbers)


def _parse_settings(text: str) -> tuple[str, dict[str, Any]]:
    kind, *rest = text.split(",")
    return kind, {key: _number(value) for key, _, value in (part.partition("=") for part in rest)}


def _number(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
