"""The simulation in place of the devices of a file, as ``--sim`` asks for it."""

from __future__ import annotations

import os
import sys
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from collections.abc import Collection

    from joshua.planner.pipeline import Checked
    from joshua.plugins.emulator import Coupling


def start_simulation(
    checked: Checked, stack: ExitStack, *, emulated: bool
) -> tuple[Checked, dict[str, Coupling]] | int:
    """Rewrites the configuration.

    Args:
        checked: the file; stack: tidies up after the run.
        emulated: devices are emulated, and the simulation moves their joints and draws their pictures.

    Returns:
        The file and the links of emulated devices by node name; an exit code where that is refused.
    """
    from joshua.ipc.run_bases import RunDirectoryError, short_base_directory
    from joshua.planner.calibration_place import FileRefused
    from joshua.planner.simulated import NoSimulatorError, SimAdapterError, simulate
    from joshua.plugins.emulator import PhysicsCamera, PhysicsLink
    from joshua.plugins.sim_adapter import CoupledCamera
    from joshua.supervisor.run_directory import physics_folder

    try:
        simulated = simulate(checked.loaded.config, checked.registry, emulated=emulated)
    except SimAdapterError as error:
        sys.stderr.write(f"joshua: error: {error}\nnothing was started\n")
        return ExitCode.NOT_INSTALLED if isinstance(error, NoSimulatorError) else ExitCode.INVALID
    sys.stdout.write(f"simulated: {', '.join(simulated.names)}\n")
    sys.stdout.flush()
    if not emulated:
        try:
            take_calibrations(checked, simulated.names)
        except FileRefused as error:
            sys.stderr.write(f"joshua: error: {error}\nnothing was started\n")
            return ExitCode.INVALID
    checked = replace(checked, loaded=replace(checked.loaded))  # whose graph is made anew
    if not simulated.coupled:
        return checked, {}
    try:
        base = short_base_directory(os.environ, len("/physics/01234567/bus.sock"))
        folder = stack.enter_context(physics_folder(base))
    except RunDirectoryError as error:
        sys.stderr.write(f"joshua: error: {error}\nnothing was started\n")
        return ExitCode.FAILED
    socket = folder / "bus.sock"
    links: dict[str, Coupling] = {}
    for name, device in simulated.coupled.items():
        if isinstance(device, CoupledCamera):
            links[name] = PhysicsCamera(socket, device.camera)
        else:
            links[name] = PhysicsLink(socket, device.actuators, device.start_rad)
    return replace(checked, request=replace(checked.request, physics_socket=str(socket))), links


def take_calibrations(checked: Checked, names: Collection[str]) -> None:
    """Puts the calibrations of simulated arms in place of those of the real ones, which are not theirs.

    An arm that the file itself describes as simulated keeps its own where ``--sim`` has found none.

    Raises FileRefused.
    """
    from joshua.config.checks.device_table import block_of
    from joshua.config.graph import node_entries
    from joshua.planner.calibration_place import calibration_place, kept_calibrations

    config = checked.loaded.config
    path = calibration_place(emulate=False, simulate=True)(checked.loaded.path, config.general.id)
    simulated = [e.node.node_name for e in node_entries(config) if block_of(e.owner)[0] == "sim_config"]
    kept_there = kept_calibrations(path) if path else {}
    found = {name: kept_there.get(name) for name in dict.fromkeys(simulated)}
    kept = [
        arm
        for arm in config.calibration.arms
        if arm.node_name not in names and found.get(arm.node_name) is None
    ]
    config.ClearField("calibration")
    config.calibration.arms.extend(kept)
    config.calibration.arms.extend(arm for arm in found.values() if arm is not None)
    if not config.calibration.arms:
        config.ClearField("calibration")
