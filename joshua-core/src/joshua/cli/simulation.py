"""The simulation in place of the devices of a file, as ``--sim`` asks for it."""

from __future__ import annotations

import shutil
import sys
import tempfile
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from joshua.generator.examination import Checked
    from joshua.plugins.emulator import PhysicsLink


def start_simulation(
    checked: Checked, stack: ExitStack, *, emulated: bool
) -> tuple[Checked, dict[str, PhysicsLink]] | int:
    """Rewrites the configuration.

    Args:
        checked: the file; stack: tidies up after the run.
        emulated: buses are emulated, and the simulation moves their joints.

    Returns:
        The file and the links of emulated buses by node name; an exit code where that is refused.
    """
    from joshua.generator.simulated import NoSimulatorError, StandInError, stand_in
    from joshua.plugins.emulator import PhysicsLink

    try:
        simulated = stand_in(checked.loaded.config, checked.registry, emulated=emulated)
    except StandInError as error:
        sys.stderr.write(f"joshua: error: {error}\nnothing was started\n")
        return ExitCode.NOT_INSTALLED if isinstance(error, NoSimulatorError) else ExitCode.INVALID
    sys.stdout.write(f"simulated: {', '.join(simulated.names)}\n")
    sys.stdout.flush()
    if not simulated.arms:
        return checked, {}
    folder = tempfile.mkdtemp(prefix="joshua-physics-")  # for this user only
    stack.callback(shutil.rmtree, folder, ignore_errors=True)
    socket = Path(folder) / "bus.sock"
    links = {name: PhysicsLink(socket, arm.actuators, arm.start_rad) for name, arm in simulated.arms.items()}
    return replace(checked, request=replace(checked.request, physics_socket=str(socket))), links
