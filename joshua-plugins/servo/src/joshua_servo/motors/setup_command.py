"""``joshua motors setup``: ids and line speed, one motor at a time."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.api import DeviceError
from joshua.tools import ExitCode
from joshua_serial.port import SerialPort
from joshua_serial.ports.bus_plugins import installed_bus_tools

from joshua_servo.motors.dialogue import Dialogue, HandsFreeDialogue, NoAnswer, TerminalDialogue
from joshua_servo.motors.setup_procedure import SetupProcedure
from joshua_servo.motors.target import Target, TargetRefused, find_target

if TYPE_CHECKING:
    import argparse


def run(arguments: argparse.Namespace) -> int:
    """Give the motors their ids. Exit code 0 if all reply, else 2, 4 or 130."""
    families = installed_bus_tools()
    try:
        target = find_target(arguments, families)
    except TargetRefused as error:
        sys.stderr.write(f"joshua motors setup: {error}\n")
        return ExitCode.INVALID if families else ExitCode.NOT_INSTALLED
    dialogue = HandsFreeDialogue(arguments.timeout) if arguments.yes else TerminalDialogue()
    port = SerialPort(target.endpoint, target.baudrate)
    try:
        port.open()
        return _set_up(target, port, dialogue)
    except DeviceError as error:
        sys.stderr.write(f"joshua motors setup: {error}\n")
        return ExitCode.HARDWARE
    finally:
        port.close()


def _set_up(target: Target, port: SerialPort, dialogue: Dialogue) -> ExitCode:
    dialogue.say(
        f"{port}: {len(target.motors)} {target.tools.family} at {target.baudrate} bit/s; searching for "
        "connected motors"
    )
    procedure = SetupProcedure(target.tools(port), target.motors, target.baudrate, dialogue)
    try:
        procedure.run()
    except KeyboardInterrupt:
        sys.stdout.write("\n")
        _say_how_to_go_on(procedure, target, "interrupted")
        return ExitCode.INTERRUPTED
    except (NoAnswer, DeviceError) as error:
        _say_how_to_go_on(procedure, target, str(error))
        return ExitCode.HARDWARE
    return ExitCode.OK


def _say_how_to_go_on(procedure: SetupProcedure, target: Target, reason: str) -> None:
    """Finished motors keep their ids, so a later run needs only the others."""
    done = ", ".join(map(str, procedure.done)) or "none"
    lines = [f"joshua motors setup: {reason}", f"  done: {done}"]
    ids = ",".join(str(motor.motor_id) for motor in reversed(procedure.remaining))
    if ids:
        lines.append(f"  continue with: joshua motors setup {target.option} --ids {ids}")
    else:
        lines.append("  every motor has its id. Run joshua motors list to check the whole chain")
    sys.stderr.write("\n".join(lines) + "\n")
