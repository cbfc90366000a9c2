"""The simulation in place of the devices of a file: where emulated devices and physics meet."""

from __future__ import annotations

import os
import sys
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from joshua.planner.pipeline import Checked
    from joshua.plugins.emulator import Coupling


def start_simulation(checked: Checked, stack: ExitStack) -> tuple[Checked, dict[str, Coupling]] | int:
    """Says what is simulated, and makes the socket between the physics and emulated devices.

    Args:
        checked: the file; stack: tidies up after the run.

    Returns:
        The file and the links of emulated devices by node name; an exit code where that is refused.
    """
    from joshua.ipc.run_bases import RunDirectoryError, short_base_directory
    from joshua.plugins.emulator import PhysicsCamera, PhysicsLink
    from joshua.plugins.sim_adapter import CoupledCamera
    from joshua.supervisor.run_directory import physics_folder

    simulated = checked.simulated
    if simulated is None:
        return checked, {}
    sys.stdout.write(f"simulated: {', '.join(simulated.names)}\n")
    sys.stdout.flush()
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
