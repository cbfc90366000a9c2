"""Emulators in place of the devices of a file, as ``--emulate`` and ``joshua emulate`` start them."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping
    from contextlib import ExitStack

    from joshua.planner.emulation import EmulatedRig
    from joshua.planner.pipeline import Checked
    from joshua.plugins.emulator import Coupling


def start_rig(
    checked: Checked,
    arguments: argparse.Namespace,
    stack: ExitStack,
    physics: Mapping[str, Coupling] | None = None,
) -> EmulatedRig | int:
    """Starts the emulators; ``stack`` ends them. Returns an exit code where something is refused.

    Args:
        physics: by node name, what moves the joints or draws the pictures of an emulated device.
    """
    from joshua.cli.report import show_findings
    from joshua.planner.emulation import EmulatedRig, EmulationError, FaultRefusedError, parse_faults

    try:
        faults = parse_faults(arguments.faults)
        rig = stack.enter_context(EmulatedRig(checked.loaded.config, checked.registry, faults, physics))
        problems = rig.problems(checked.loaded.positions)
        if problems:
            found = replace(checked.examination, diagnostics=[*checked.diagnostics, *problems])
            show_findings(found, arguments.format)
            sys.stderr.write("nothing was started\n")
            missing = all(item.code == "emulator-missing" for item in found.errors)
            return ExitCode.NOT_INSTALLED if missing else ExitCode.INVALID
        rig.start()
    except ValueError as error:
        sys.stderr.write(f"joshua: error: {error}\n")
        return ExitCode.INVALID
    except EmulationError as error:
        sys.stderr.write(f"joshua: error: {error}\nnothing was started\n")
        return ExitCode.INVALID if isinstance(error, FaultRefusedError) else ExitCode.FAILED
    show_rig(rig)
    return rig


def show_rig(rig: EmulatedRig) -> None:
    """Says which emulator stands for which device."""
    for emulator in rig.emulators:
        sys.stdout.write(f"emulated: {emulator.device.node_name} at {emulator.endpoint}\n")
    sys.stdout.flush()
