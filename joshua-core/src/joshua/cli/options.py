"""The options of a run, declared once and shared by the commands that read a configuration."""

from __future__ import annotations

import argparse
import math
import os
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

FAULT_ALONE = "--fault affects emulated devices only: add --emulate, or leave --fault out"

_Container = argparse.ArgumentParser | argparse._ArgumentGroup


def positive_seconds(text: str) -> float:
    """Read a duration in seconds. Raises ArgumentTypeError unless it is finite and above zero."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected seconds, such as 10 or 0.5, found {text!r}") from None
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"expected seconds above zero, found {text!r}")
    return value


class _OneFile(argparse.Action):
    """Accepts a file as FILE or --config FILE. Two different files are an error."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:
        other = getattr(namespace, "config", None)
        if other is not None and other != values:
            parser.error(f"two files are given, {other} and {values}: leave one out")
        namespace.config = values


def add_file(parser: _Container, help_text: str) -> None:
    """Add FILE to a command, also accepted as ``--config FILE``."""
    parser.add_argument(
        "config", nargs="?", metavar="FILE", action=_OneFile, default=argparse.SUPPRESS, help=help_text
    )


def add_config(parser: _Container, help_text: str, default: Any = argparse.SUPPRESS) -> None:
    """Add ``--config FILE``. By default, an absent one keeps the value before the command."""
    parser.add_argument("--config", metavar="PATH", action=_OneFile, default=default, help=help_text)


def add_format(parser: _Container, default: str = argparse.SUPPRESS) -> None:
    """Add ``--format``."""
    parser.add_argument("--format", choices=("text", "json"), default=default, help="output format")


def add_timeout(parser: _Container, help_text: str, default_s: float | None) -> None:
    """Add ``--timeout``."""
    parser.add_argument(
        "--timeout", type=positive_seconds, default=default_s, metavar="SECONDS", help=help_text
    )


def add_config_options(parser: argparse.ArgumentParser, *, suppress: bool = True, file: str = "") -> None:
    """Add the options that choose and change a configuration.

    Args:
        suppress: omit absent options from the namespace, so that those before the subcommand apply.
        file: help of the argument FILE, "" for a command that takes ``--config`` only.
    """

    def default(value: Any) -> Any:
        return argparse.SUPPRESS if suppress else value

    if file:
        add_file(parser, file)
    group = parser.add_argument_group("configuration")
    add_config(group, "the file that describes the robot", default(None))
    group.add_argument(
        "--set",
        dest="overrides",
        metavar="FIELD=VALUE",
        action="append",
        default=default([]),
        help="replace a field, such as robot.actions[0].sts3215_config.comm.serial.port=/dev/ttyACM3",
    )
    group.add_argument(
        "--host", metavar="NAME", default=default(None), help="start only the nodes of this host"
    )
    group.add_argument(
        "--block-plugin",
        dest="blocked_plugins",
        metavar="NAME",
        action="append",
        default=default([]),
        help="ignore a plugin, named as in `joshua plugins`",
    )
    add_format(group, default("text"))


def add_plan_options(parser: _Container, *, suppress: bool = True) -> None:
    """Add the options of a run that change its plan; ``suppress`` as for ``add_config_options``."""
    parser.add_argument(
        "--duration",
        metavar="SECONDS",
        type=positive_seconds,
        default=argparse.SUPPRESS if suppress else None,
        help="shut down cleanly this long after every node is ready; a start that takes as long fails",
    )
    for name, help_text in (
        ("--emulate", "replace every device by its emulator; no hardware is opened"),
        ("--sim", "replace actuators and cameras by the simulation; none of them is opened"),
        (
            "--allow-uncalibrated",
            "enable actuators without a calibration; radians count from the middle of their range",
        ),
        ("--dry-run", "run with torque off"),
    ):
        default = argparse.SUPPRESS if suppress else False
        parser.add_argument(name, action="store_true", default=default, help=help_text)


def add_fault_option(parser: _Container, *, suppress: bool = True) -> None:
    """Add the option that injects faults into emulated devices."""
    parser.add_argument(
        "--fault",
        dest="faults",
        metavar="NODE:FAULT",
        action="append",
        default=argparse.SUPPRESS if suppress else [],
        help="a fault of an emulated device, such as follower_arm:drop=0.01 or camera_top:stall=1,at_s=2",
    )


def add_run_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of the main command."""
    add_config_options(parser, suppress=False)
    group = parser.add_argument_group("run")
    group.add_argument("--validate-only", action="store_true", help="check the file and start nothing")
    add_plan_options(group, suppress=False)
    group.add_argument(
        "--start-timeout",
        metavar="SECONDS",
        type=positive_seconds,
        default=os.environ.get("JOSHUA_START_TIMEOUT"),
        help="limit of the start in place of that of --duration (also JOSHUA_START_TIMEOUT)",
    )
    add_fault_option(group, suppress=False)
    group.add_argument("--open", action="store_true", help="open the page of a calibration in the browser")
    group.add_argument(
        "--log-level",
        metavar="LEVEL",
        type=str.upper,
        choices=("DEBUG", "INFO", "WARNING", "ERROR"),
        default="INFO",
        help="lowest level of the log lines shown: DEBUG, INFO, WARNING, ERROR",
    )
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    parser.add_argument(
        "--print-completion",
        metavar="SHELL",
        choices=("bash", "zsh", "fish"),
        help="print the completion script of a shell: bash, zsh, fish",
    )
