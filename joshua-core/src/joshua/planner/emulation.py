"""``--emulate``: every device of a file is replaced by an emulator that speaks its protocol.

Only endpoints change: the same driver opens a pseudo-terminal or a loopback address. Where a device has
no emulator nothing is started, so that a real device is never opened by a run that was to be emulated.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.ipc.run_bases import state_home
from joshua.modes import mode_of
from joshua.plan import Diagnostic, Related, Severity, installing
from joshua.planner.devices import Wanted, unpack, wanted_nodes
from joshua.plugins import DeviceSpec, EmulatorSpec, PluginStatus, Registry
from joshua.plugins.emulator import (
    Coupling,
    DeviceEmulator,
    EmulatedDevice,
    EmulationError,
    FaultRefusedError,
)
from joshua.plugins.hints import emulator_for
from joshua.plugins.targets import TargetError, load_target
from joshua.schema import config_pb2 as pb

if TYPE_CHECKING:
    from joshua.textproto.positions import Positions

__all__ = ["EmulatedRig", "EmulationError", "FaultRefusedError", "parse_faults"]


class EmulatedRig:
    """The emulators of one file; a context manager that ends them all.

    Args:
        config: the loaded file; ``start`` puts the emulators' endpoints into it.
        registry: installed plugins.
        faults: by node name, in the emulators' own words.
        physics: by node name, what moves the joints or draws the pictures of an emulated device.
    """

    def __init__(
        self,
        config: pb.Config,
        registry: Registry,
        faults: Mapping[str, Sequence[str]],
        physics: Mapping[str, Coupling] | None = None,
    ) -> None:
        self._config = config
        self._registry = registry
        self._faults = faults
        self._physics = physics or {}
        mode = mode_of(config, registry)
        wanted = wanted_nodes(config, devices=mode.devices, models=False)
        self._wanted = [want for want in wanted if not self._is_virtual(want)]
        self._stack = ExitStack()
        self.emulators: list[DeviceEmulator] = []

    def __enter__(self) -> EmulatedRig:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def problems(self, positions: Positions) -> list[Diagnostic]:
        """Devices without an emulator, and faults of nodes that are not emulated."""
        found = self._without_emulator(positions)
        names = [want.entry.node.node_name for want in self._wanted]
        found += [
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
        return found

    def _without_emulator(self, positions: Positions) -> list[Diagnostic]:
        """One finding for all devices of one block that nothing emulates."""
        by_block: dict[str, list[Wanted]] = {}
        for want in self._wanted:
            if self._spec(want) is None:
                by_block.setdefault(want.block_name, []).append(want)
        return [
            Diagnostic(
                "emulator-missing",
                Severity.ERROR,
                f"{', '.join(want.entry.node.node_name for want in wants)}: no plugin in use emulates "
                f"{block}, and --emulate never opens a real device.",
                positions.name(wants[0].block_path),
                wants[0].block_path,
                remedy=self._remedy(block),
                related=tuple(
                    Related(place, f"{want.entry.node.node_name} needs it too")
                    for want in wants[1:]
                    if (place := positions.name(want.block_path)) is not None
                ),
            )
            for block, wants in by_block.items()
        ]

    def _remedy(self, block: str) -> str:
        emulator = emulator_for(block)
        row = next((row for row in self._registry.rows() if row.distribution == emulator), None)
        if row is None and emulator:
            return f"{installing.install(emulator)}, or leave the device out of the file."
        if row is None:
            return "Leave the device out of the file, or ask its vendor for a plugin with an emulator."
        if row.status is PluginStatus.BLOCKED:
            return f"Leave --block-plugin {row.name} out, or leave the device out of the file."
        if row.status is not PluginStatus.OK:
            return f"See what `joshua plugins` says of {emulator}, or leave the device out of the file."
        return "Leave the device out of the file, or ask its vendor for a plugin with an emulator."

    def start(self) -> None:
        """Starts every emulator and puts its endpoint and calibration into the configuration.

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
        spec = self._spec(want)
        name = want.entry.node.node_name
        if spec is None:
            raise EmulationError(f"{name}: no installed plugin emulates {want.block_name}")
        try:
            emulator_type = load_target(spec.implementation)
        except TargetError as error:
            raise EmulationError(f"{name}: the emulator is broken: {error}") from error
        folder = state_folder(self._config.general.id) / name
        faults = tuple(self._faults.get(name, ()))
        link = self._physics.get(name)
        device = EmulatedDevice(name, want.enum_value, want.block, folder, faults, link)
        emulator: DeviceEmulator = emulator_type(device)
        self._stack.callback(emulator.close)
        emulator.start()
        self.emulators.append(emulator)
        self._amend(want, emulator)

    def _amend(self, want: Wanted, emulator: DeviceEmulator) -> None:
        container = getattr(want.entry.owner, want.block_path.rpartition(".")[2])
        if want.block is container:
            emulator.amend(container)
        else:  # an Any block is opened, changed and closed again
            _, message = unpack(container)
            emulator.amend(message)
            container.Pack(message)
        known = {arm.node_name for arm in self._config.calibration.arms}
        calibration = emulator.calibration()
        if calibration is not None and want.entry.node.node_name not in known:
            calibration.node_name = want.entry.node.node_name
            self._config.calibration.arms.append(calibration)

    def _spec(self, want: Wanted) -> EmulatorSpec | None:
        return self._registry.find(EmulatorSpec, want.block_name)

    def _is_virtual(self, want: Wanted) -> bool:
        spec = self._registry.find(want.kind, want.block_name, want.enum_value)
        return not want.block_name or (isinstance(spec, DeviceSpec) and spec.virtual)


def parse_faults(options: Sequence[str]) -> dict[str, list[str]]:
    """Reads ``--fault NODE:FAULT`` options. Raises ValueError for one without a node."""
    faults: dict[str, list[str]] = {}
    for option in options:
        node, colon, fault = option.partition(":")
        if not (node and colon and fault):
            raise ValueError(f"--fault {option!r}: expected NODE:FAULT, such as follower_arm:drop=0.01")
        faults.setdefault(node, []).append(fault)
    return faults


def state_folder(robot_id: str, kind: str = "emulated") -> Path:
    """Where emulated or simulated devices of one robot keep what they remember, such as their EEPROM."""
    safe = "".join(c if c.isalnum() or c in "-_." else "_" for c in robot_id).strip(".") or "robot"
    return state_home(os.environ) / kind / safe
