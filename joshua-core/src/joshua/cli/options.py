"""The options of a run, declared once and shared by the commands that read a configuration."""

from __future__ import annotations

import argparse
import math

FAULT_ALONE = "--fault breaks an emulated device, never a real one: add --emulate, or leave it out"

#: Options of a run that no command sees where they stand before its name.
RUN_ONLY = ("--validate-only", "--fault", "--open")
#: Those that `joshua plan` shows the effect of.
RUN_OR_PLAN = ("--duration", "--allow-uncalibrated", "--dry-run", "--emulate", "--sim")


def positive_seconds(text: str) -> float:
    """Reads a duration in seconds; raises ArgumentTypeError unless it is finite and above zero."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected seconds, such as 10 or 0.5, found {text!r}") from None
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"expected seconds above zero, found {text!r}")
    return value


def add_config_options(parser: argparse.ArgumentParser, *, suppress: bool = True) -> None:
    """Adds the options that choose and change a configuration.

    Args:
        suppress: leave absent options out of the namespace, so that a subcommand does not undo what
            stood before it on the command line.
    """
    default = argparse.SUPPRESS if suppress else None
    group = parser.add_argument_group("configuration")
    group.add_argument("--config", metavar="PATH", default=default, help="the file that describes the robot")
    group.add_argument(
        "--set",
        dest="overrides",
        metavar="FIELD=VALUE",
        action="append",
        default=argparse.SUPPRESS if suppress else [],
        help="replace a field, such as robot.actions[0].sts3215_config.comm.serial.port=/dev/ttyACM3",
    )
    group.add_argument(
        "--host", metavar="NAME", default=default, help="start this machine's share of the file"
    )
    group.add_argument(
        "--block-plugin",
        dest="blocked_plugins",
        metavar="NAME",
        action="append",
        default=argparse.SUPPRESS if suppress else [],
        help="leave a plugin out, by its name in `joshua plugins`",
    )
    group.add_argument(
        "--format",
        choices=("text", "json"),
        default=argparse.SUPPRESS if suppress else "text",
        help="form of the diagnostics",
    )


def add_stand_in_options(
    parser: argparse.ArgumentParser | argparse._ArgumentGroup, *, suppress: bool = True
) -> None:
    """Adds the options that put something in place of devices; ``suppress`` as for ``add_config_options``."""
    default = argparse.SUPPRESS if suppress else False
    parser.add_argument(
        "--emulate",
        action="store_true",
        default=default,
        help="replace every device by an emulator; no hardware is opened",
    )
    parser.add_argument(
        "--sim",
        action="store_true",
        default=default,
        help="replace actuators and cameras by the simulation; none of these is opened",
    )


def add_fault_option(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """Adds the option that brings about faults of emulated devices."""
    parser.add_argument(
        "--fault",
        dest="faults",
        metavar="NODE:FAULT",
        action="append",
        default=[],
        help="a fault of an emulated device, such as follower_arm:drop=0.01 or camera_top:stall=1,at_s=2",
    )


def add_run_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the main command."""
    add_config_options(parser, suppress=False)
    group = parser.add_argument_group("run")
    group.add_argument("--validate-only", action="store_true", help="check the file and start nothing")
    group.add_argument(
        "--duration", metavar="SECONDS", type=positive_seconds, help="end in good order after this time"
    )
    add_stand_in_options(group, suppress=False)
    add_fault_option(group)
    group.add_argument("--open", action="store_true", help="open the page of a calibration in the browser")
    group.add_argument(
        "--allow-uncalibrated",
        action="store_true",
        help="energise actuators without a calibration: radians count from the middle of their range",
    )
    group.add_argument("--dry-run", action="store_true", help="do everything with torque off")
    group.add_argument(
        "--log-level",
        metavar="LEVEL",
        type=str.upper,
        choices=("DEBUG", "INFO", "WARNING", "ERROR"),
        default="INFO",
        help="least level of the log lines shown: DEBUG, INFO, WARNING, ERROR",
    )
    parser.add_argument("--version", action="store_true", help="print the version and end")
    parser.add_argument(
        "--print-completion",
        metavar="SHELL",
        choices=("bash", "zsh", "fish"),
        help="print the completion script of a shell: bash, zsh, fish",
    )
