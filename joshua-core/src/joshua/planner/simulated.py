"""``--sim``: actuators and cameras of a file become part of the simulation, which the file need not name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from joshua.modes import mode_of
from joshua.plan import installing
from joshua.planner.devices import Wanted, joints_of, wanted_nodes
from joshua.plugins import ActuatorSpec, DeviceSpec, EmulatorSpec, Registry, SimulatorSpec
from joshua.plugins.block_context import BlockContext
from joshua.plugins.hints import distribution_for
from joshua.plugins.sim_adapter import CoupledArm, CoupledCamera, RealDevice, SimAdapter, SimAdapterError
from joshua.plugins.targets import TargetError, load_target
from joshua.schema import config_pb2 as pb
from joshua.schema.rules import block_rule

__all__ = ["NoSimulatorError", "SimAdapterError", "Simulated", "simulate"]


class NoSimulatorError(SimAdapterError):
    """No simulator is installed."""


@dataclass(frozen=True)
class Simulated:
    """What became part of the simulation.

    Attributes:
        names: nodes whose devices are simulated; coupled: those that are emulated, and whose joints the
            simulation moves or whose pictures it draws, by node name.
    """

    names: tuple[str, ...]
    coupled: Mapping[str, CoupledArm | CoupledCamera]


def simulate(config: pb.Config, registry: Registry, *, emulated: bool = False) -> Simulated:
    """Puts simulated devices in place of the real ones.

    Args:
        config: the loaded file, which is changed.
        registry: installed plugins.
        emulated: devices are emulated, and the simulation only moves their joints and draws their pictures.

    Raises:
        SimAdapterError: no simulator is installed, or it cannot stand for a device.
    """
    spec = registry.find(SimulatorSpec, "simulation", "OFFSCREEN")
    if spec is None or not spec.sim_adapter:
        raise NoSimulatorError(
            f"--sim needs a simulator: {installing.install(distribution_for('simulation'))}"
        )
    devices = [_device(config, registry, want) for want in _replaceable(config, registry, emulated=emulated)]
    if not devices:
        raise SimAdapterError(
            "--sim has nothing to replace: the file has no actuator and no camera that is not virtual already"
            + (", and whose emulator can be part of the simulation" if emulated else "")
        )
    try:
        adapter: SimAdapter = load_target(spec.sim_adapter)
        coupled = adapter(config, devices, emulated)
    except TargetError as error:
        raise SimAdapterError(f"the simulator is broken: {error}") from error
    names = coupled if emulated else [device.node_name for device in devices]
    return Simulated(tuple(names), coupled)


def _is_camera(want: Wanted) -> bool:
    """Whether a sensor is a real camera; others have no place in the simulation."""
    rule = None if want.block is None else block_rule(want.block.DESCRIPTOR)
    return rule is not None and "PERCEPTION_CAMERA" in rule.fits and not rule.virtual


def _replaceable(config: pb.Config, registry: Registry, *, emulated: bool) -> list[Wanted]:
    mode = mode_of(config, registry)
    found = []
    for want in wanted_nodes(config, devices=mode.devices, models=False):
        spec = registry.find(want.kind, want.block_name, want.enum_value)
        is_virtual = isinstance(spec, DeviceSpec) and spec.virtual
        fits = want.kind is ActuatorSpec or _is_camera(want)
        if want.block_name and fits and not is_virtual and (not emulated or _couples(registry, want)):
            found.append(want)
    return found


def _couples(registry: Registry, want: Wanted) -> bool:
    """Whether a device's emulator can be part of the simulation; else it stays as without one."""
    spec = registry.find(EmulatorSpec, want.block_name)
    try:
        return spec is not None and bool(load_target(spec.implementation).couples)
    except TargetError:
        return False  # named when the emulators start


def _device(config: pb.Config, registry: Registry, want: Wanted) -> RealDevice:
    name = want.entry.node.node_name
    block = want.block_path.rpartition(".")[2]
    joints = _joint_names(config, registry, want) if want.kind is ActuatorSpec else ()
    return RealDevice(name, want.enum_value, want.entry.owner, block, joints)


def _joint_names(config: pb.Config, registry: Registry, want: Wanted) -> tuple[str, ...]:
    name = want.entry.node.node_name
    calibration = next((arm for arm in config.calibration.arms if arm.node_name == name), None)
    spec = registry.find(want.kind, want.block_name, want.enum_value)
    settings = None
    if spec is not None and want.block is not None:
        from joshua.plugins.settings import make_settings  # needs pydantic

        context = BlockContext(calibration)
        settings, _ = make_settings(spec, want.block, node=want.entry.node, context=context)
    names = tuple(joint.name for joint in joints_of(settings, want.block, calibration))
    if not names:
        raise SimAdapterError(
            f"{name}: its block does not say which joints it has, so the simulation cannot stand for it: "
            "leave it out of the file, or run without --sim"
        )
    return names
