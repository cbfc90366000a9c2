"""Emulators in place of the devices of a file, as ``--emulate`` and ``joshua emulate`` start them.

Only endpoints change: the same driver opens a pseudo-terminal or a loopback address. Where a device has
no emulator nothing is started, so that a real device is never opened by a run that was to be emulated.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.ipc.run_bases import state_home
from joshua.plan import Diagnostic, Severity
from joshua.planner.amend import emulate, physical_nodes
from joshua.planner.calibration_place import state_folder
from joshua.plugins import EmulatorSpec
from joshua.plugins.emulator import EmulatedDevice, EmulationError, FaultRefusedError
from joshua.plugins.targets import TargetError, load_target

if TYPE_CHECKING:
    import argparse

    from joshua.planner.devices import Wanted
    from joshua.planner.pipeline import Checked
    from joshua.plugins.emulator import Coupling, DeviceEmulator


class EmulatedRig:
    """The emulators of one file; a context manager that ends them all.

    Args:
        checked: the file; faults: by node name, in the emulators' own words.
        physics: by node name, what moves the joints or draws the pictures of an emulated device.
    """

    def __init__(
        self,
        checked: Checked,
        faults: Mapping[str, Sequence[str]],
        physics: Mapping[str, Coupling] | None = None,
    ) -> None:
        self._registry = checked.registry
        self._wanted = physical_nodes(checked.loaded, checked.registry)
        self._folder = state_folder(state_home(os.environ), checked.loaded.config.general.id)
        self._faults = faults
        self._physics = physics or {}
        self._stack = ExitStack()
        self.emulators: list[DeviceEmulator] = []

    def __enter__(self) -> EmulatedRig:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def problems(self) -> list[Diagnostic]:
        """Faults of nodes that are not emulated."""
        names = [want.entry.node.node_name for want in self._wanted]
        return [
            Diagnostic(
                "fault-node-unknown",
                Severity.ERROR,
                f"--fault names {name!r}, which is no emulated device of the file.",
                found=name,
                allowed=tuple(names),
                remedy="Name one of the devices: --fault NODE:FAULT.",
            )
            for name in self._faults
            if name not in names
        ]

    def start(self) -> None:
        """Starts every emulator.

        Raises:
            EmulationError: an emulator does not start, or refuses a fault; those that did are closed.
        """
        try:
            for want in self._wanted:
                self._start(want)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Ends every emulator; a second call does nothing."""
        self._stack.close()
        self.emulators.clear()

    def _start(self, want: Wanted) -> None:
        spec = self._registry.find(EmulatorSpec, want.block_name)
        name = want.entry.node.node_name
        if spec is None:
            raise EmulationError(f"{name}: no installed plugin emulates {want.block_name}")
        try:
            emulator_type = load_target(spec.implementation)
        except TargetError as error:
            raise EmulationError(f"{name}: the emulator is broken: {error}") from error
        faults = tuple(self._faults.get(name, ()))
        device = EmulatedDevice(
            name, want.enum_value, want.block, self._folder / name, faults, self._physics.get(name)
        )
        emulator: DeviceEmulator = emulator_type(device)
        self._stack.callback(emulator.close)
        emulator.start()
        self.emulators.append(emulator)


def parse_faults(options: Sequence[str]) -> dict[str, list[str]]:
    """Reads ``--fault NODE:FAULT`` options. Raises ValueError for one without a node."""
    faults: dict[str, list[str]] = {}
    for option in options:
        node, colon, fault = option.partition(":")
        if not (node and colon and fault):
            raise ValueError(f"--fault {option!r}: expected NODE:FAULT, such as follower_arm:drop=0.01")
        faults.setdefault(node, []).append(fault)
    return faults


def start_rig(
    checked: Checked,
    arguments: argparse.Namespace,
    stack: ExitStack,
    physics: Mapping[str, Coupling] | None = None,
) -> tuple[Checked, EmulatedRig] | int:
    """Starts the emulators and puts their endpoints into the file; ``stack`` ends them.

    Args:
        physics: by node name, what moves the joints or draws the pictures of an emulated device.

    Returns:
        The file and its emulators; an exit code where something is refused.
    """
    from joshua.cli.report import exit_code_of, show_findings

    try:
        rig = stack.enter_context(EmulatedRig(checked, parse_faults(arguments.faults), physics))
        problems = rig.problems()
        if problems:
            found = replace(checked.result, diagnostics=[*checked.diagnostics, *problems])
            show_findings(found, arguments.format)
            sys.stderr.write("nothing was started\n")
            return exit_code_of(found)
        rig.start()
    except ValueError as error:
        sys.stderr.write(f"joshua: error: {error}\n")
        return ExitCode.INVALID
    except EmulationError as error:
        sys.stderr.write(f"joshua: error: {error}\nnothing was started\n")
        return ExitCode.INVALID if isinstance(error, FaultRefusedError) else ExitCode.FAILED
    for emulator in rig.emulators:
        sys.stdout.write(f"emulated: {emulator.device.node_name} at {emulator.endpoint}\n")
    sys.stdout.flush()
    return replace(checked, loaded=emulate(checked.loaded, rig.emulators)), rig
