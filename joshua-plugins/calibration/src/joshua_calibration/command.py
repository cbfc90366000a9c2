"""``joshua calibrate``: calibrate arms, compare, recover, exchange calibrations with LeRobot."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from joshua.tools import FAULT_ALONE, ExitCode

if TYPE_CHECKING:
    import argparse


SUMMARY = "calibrate arms by hand, compare file and servos, or exchange calibrations with LeRobot"
ACTIONS = ("import-lerobot", "export-lerobot")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``joshua calibrate``."""
    from joshua.tools import add_config_options, add_fault_option

    add_config_options(parser)
    parser.add_argument(
        "words",
        nargs="*",
        metavar="FILE",
        help="configuration whose arms are calibrated; or import-lerobot or export-lerobot, with NODE=PATH "
        "for each node and LeRobot file, such as leader_arm=my_leader.json",
    )
    work = parser.add_mutually_exclusive_group()
    work.add_argument("--check", action="store_true", help="compare file and servos; nothing is written")
    work.add_argument(
        "--recover", action="store_true", help="undo or complete a calibration that was interrupted"
    )
    parser.add_argument(
        "--node", dest="nodes", metavar="NAME", action="append", help="only this arm; may be repeated"
    )
    parser.add_argument("--open", action="store_true", help="open the page in the browser")
    parser.add_argument(
        "--emulate", action="store_true", help="calibrate emulated arms, which move themselves"
    )
    parser.add_argument(
        "--sim", action="store_true", help="calibrate simulated arms, which are moved by a simulated hand"
    )
    parser.add_argument("--force", action="store_true", help="with export-lerobot: replace existing files")
    add_fault_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command. Exit code 1 if ``--check`` finds differences, 4 without hardware."""
    if problem := _read_words(arguments):
        sys.stderr.write(f"joshua calibrate: {problem}\n")
        return ExitCode.INVALID
    option = _without_effect(arguments)
    if option:
        what = (
            arguments.action or (arguments.check and "--check") or (arguments.recover and "--recover") or ""
        )
        command = f"joshua calibrate {what}".rstrip()
        sys.stderr.write(f"{command}: {option} has no effect here: leave it out\n")
        return ExitCode.INVALID
    if not arguments.config:
        if arguments.action == "import-lerobot" and not arguments.items:
            from joshua_calibration.exchange import list_files

            return list_files()
        sys.stderr.write("joshua calibrate: no file given: joshua calibrate FILE\n")
        return ExitCode.INVALID
    if arguments.action:
        from joshua_calibration import exchange

        if arguments.check or arguments.recover:
            sys.stderr.write(
                f"joshua calibrate {arguments.action}: --check and --recover have no effect "
                "here: leave them out\n"
            )
            return ExitCode.INVALID
        return (
            exchange.import_files(arguments) if arguments.action == ACTIONS[0] else exchange.export(arguments)
        )
    if arguments.faults and not arguments.emulate:
        sys.stderr.write(f"joshua calibrate: {FAULT_ALONE}\n")
        return ExitCode.INVALID
    from joshua_calibration.hardware import with_arms

    return with_arms(arguments)


def _read_words(arguments: argparse.Namespace) -> str:
    """Parse action, nodes and file from the arguments. Return what is wrong, or ""."""
    words = list(arguments.words)
    arguments.action = words.pop(0) if words and words[0] in ACTIONS else ""
    arguments.items = [word for word in words if arguments.action and not word.endswith(".pbtxt")]
    files = {*(word for word in words if word not in arguments.items), *filter(None, [arguments.config])}
    if len(files) > 1:
        return f"one file is expected, found {', '.join(sorted(files))}"
    arguments.config = next(iter(files), None)
    return ""


def _without_effect(arguments: argparse.Namespace) -> str:
    """Return an option that belongs to another form of the command; "" for none."""
    exchanges, looks = bool(arguments.action), arguments.check or arguments.recover
    wrong = {
        "--node": exchanges and arguments.nodes,
        "--open": arguments.open and (exchanges or looks),
        "--sim": arguments.sim and exchanges,  # only real servos store calibrations to exchange
        "--force": arguments.force and arguments.action != ACTIONS[1],
    }
    return next((option for option, is_wrong in wrong.items() if is_wrong), "")
