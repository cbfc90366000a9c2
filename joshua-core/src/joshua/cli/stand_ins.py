"""Replaces a file's devices by emulators or the simulation: ``--emulate``, ``--sim``, ``joshua emulate``.

Only endpoints change: the same driver opens a pseudo-terminal or a loopback address. If a device has no
emulator, nothing is started, so an emulated run never opens a real device.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode
from joshua.cli.report import NotStartedError
from joshua.plan import Diagnostic, Severity
from joshua.plugins.emulator import EmulatedDevice, EmulationError, FaultRefusedError
from joshua.plugins.targets import TargetError, load_target

if TYPE_CHECKING:
    import argparse

    from joshua.planner.pipeline import Checked
    from joshua.planner.resolution import Wanted
    from joshua.plugins.emulator import Coupling, DeviceEmulator


@dataclass
class EmulatedRig:
    """The running emulators of one file."""

    emulators: list[DeviceEmulator] = field(default_factory=list)


def replace_devices(
    checked: Checked, arguments: argparse.Namespace, stack: ExitStack
) -> tuple[Checked, EmulatedRig | None]:
    """Start the replacements of ``--sim`` and ``--emulate``. ``stack`` ends them.

    Returns:
        The file with the endpoints of its emulators, and these; None without ``--emulate``.

    Raises:
        NotStartedError: a device has no emulator, or an emulator refuses its fault or does not start.
    """
    links: dict[str, Coupling] = {}
    if getattr(arguments, "sim", False):
        checked, links = _simulate(checked, stack)
    return _emulate(checked, arguments, stack, links) if arguments.emulate else (checked, None)


def _simulate(checked: Checked, stack: ExitStack) -> tuple[Checked, dict[str, Coupling]]:
    """Report the simulated devices, and create the socket between the physics and emulated devices.

    Returns:
        The file, and the coupling of each emulated device by node name.
    """
    from joshua.ipc.run_bases import RunDirectoryError, short_base_directory
    from joshua.supervisor.run_directory import PHYSICS_FOLDER, socket_folder

    simulated = checked.simulated
    if simulated is None:
        return checked, {}
    sys.stdout.write(f"simulated: {', '.join(simulated.names)}\n")
    sys.stdout.flush()
    if not simulated.coupled:
        return checked, {}
    try:
        base = short_base_directory(os.environ, len("/physics/01234567/bus.sock"))
        socket = stack.enter_context(socket_folder(base, PHYSICS_FOLDER)) / "bus.sock"
    except RunDirectoryError as error:
        raise NotStartedError(str(error), ExitCode.FAILED) from error
    links = {name: replace(device, socket=socket) for name, device in simulated.coupled.items()}
    return replace(checked, request=replace(checked.request, physics_socket=str(socket))), links


def _emulate(
    checked: Checked, arguments: argparse.Namespace, stack: ExitStack, links: Mapping[str, Coupling]
) -> tuple[Checked, EmulatedRig]:
    from joshua.ipc.run_bases import state_home
    from joshua.planner.amend import emulate, physical_nodes
    from joshua.planner.calibration_place import state_folder

    wanted = physical_nodes(checked.loaded, checked.registry)
    names = [want.entry.node.node_name for want in wanted]
    faults = _faults(arguments.faults)
    if unknown := [_unknown_node(name, names) for name in faults if name not in names]:
        found = replace(checked.result, diagnostics=[*checked.diagnostics, *unknown])
        raise NotStartedError.of(found, arguments.format)
    folder = state_folder(state_home(os.environ), checked.loaded.config.general.id)
    rig = EmulatedRig()
    try:
        for want, name in zip(wanted, names, strict=True):
            emulator = _emulator(checked, want, folder / name, faults.get(name, ()), links.get(name))
            stack.callback(emulator.close)
            emulator.start()
            rig.emulators.append(emulator)
    except FaultRefusedError as error:
        raise NotStartedError(str(error)) from error
    except EmulationError as error:
        raise NotStartedError(str(error), ExitCode.FAILED) from error
    for emulator in rig.emulators:
        sys.stdout.write(f"emulated: {emulator.device.node_name} at {emulator.endpoint}\n")
    sys.stdout.flush()
    return replace(checked, loaded=emulate(checked.loaded, rig.emulators)), rig


def _faults(options: Sequence[str]) -> dict[str, list[str]]:
    """The faults of ``--fault NODE:FAULT`` by node name."""
    faults: dict[str, list[str]] = {}
    for option in options:
        node, colon, fault = option.partition(":")
        if not (node and colon and fault):
            raise NotStartedError(f"--fault {option!r}: expected NODE:FAULT, such as follower_arm:drop=0.01")
        faults.setdefault(node, []).append(fault)
    return faults


def _unknown_node(name: str, names: Sequence[str]) -> Diagnostic:
    return Diagnostic(
        "fault-node-unknown",
        Severity.ERROR,
        f"--fault names {name!r}, which is not an emulated device of the file.",
        found=name,
        allowed=tuple(names),
        remedy="Name one of the devices: --fault NODE:FAULT.",
    )


def _emulator(
    checked: Checked, want: Wanted, folder: Path, faults: Sequence[str], link: Coupling | None
) -> DeviceEmulator:
    from joshua.plugins import EmulatorSpec

    spec = checked.registry.find(EmulatorSpec, want.block_name)
    name = want.entry.node.node_name
    if spec is None:
        raise EmulationError(f"{name}: no installed plugin emulates {want.block_name}")
    try:
        emulator_type = load_target(spec.implementation)
    except TargetError as error:
        raise EmulationError(f"{name}: the emulator is broken: {error}") from error
    device = EmulatedDevice(name, want.enum_value, want.block, folder, tuple(faults), link)
    emulator: DeviceEmulator = emulator_type(device)
    return emulator
