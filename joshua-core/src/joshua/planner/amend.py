"""``--sim`` and ``--emulate`` as functions from a loaded configuration to a loaded configuration.

They start nothing, so a plan with both can be shown on any machine. The command that runs the file owns the
emulators' processes and the folder of the coupling socket.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.config.checks import Context
from joshua.config.checks.device_table import device_block, motor_ids
from joshua.modes import mode_of
from joshua.plan import Diagnostic, installing
from joshua.planner.calibration_place import FileRefused, kept_calibrations
from joshua.planner.resolution import Wanted, also_needed_by, joints_of, unpack, wanted_nodes
from joshua.plugins import ActuatorSpec, DeviceSpec, EmulatorSpec, PluginStatus, Registry, SimulatorSpec
from joshua.plugins.block_context import BlockContext
from joshua.plugins.emulator import (
    Coupling,
    DeviceEmulator,
    EmulatedDevice,
    RealDevice,
    SimAdapter,
    SimAdapterError,
)
from joshua.plugins.hints import distribution_for, emulator_for
from joshua.plugins.targets import TargetError, load_target
from joshua.schema import config_pb2 as pb
from joshua.schema.rules import block_rule

if TYPE_CHECKING:
    from joshua.config import LoadedConfig


class NoSimulatorError(SimAdapterError):
    """No simulator is installed."""


@dataclass(frozen=True)
class Simulated:
    """A configuration with simulated devices.

    Attributes:
        loaded: the configuration; names: nodes whose devices are simulated.
        coupled: emulated devices whose joints the simulation moves or whose pictures it renders, by node
        name.
        real: nodes whose devices stay real.
    """

    loaded: LoadedConfig
    names: tuple[str, ...] = ()
    coupled: Mapping[str, Coupling] = field(default_factory=dict)
    real: tuple[str, ...] = ()


def simulate(
    loaded: LoadedConfig, registry: Registry, *, emulated: bool = False, calibrations: str = ""
) -> Simulated:
    """Replace real devices by simulated ones.

    Args:
        emulated: devices are emulated, and the simulation only moves their joints and renders their pictures.
        calibrations: file of the simulated arms' calibrations; "" for none.

    Raises:
        SimAdapterError: no simulator is installed, or it cannot replace a device.
    """
    spec = registry.find(SimulatorSpec, "simulation", "OFFSCREEN")
    if spec is None or not spec.sim_adapter:
        raise NoSimulatorError(f"--sim {installing.requires(distribution_for('simulation'))}")
    loaded = _copy(loaded)
    config = loaded.config
    physical = physical_nodes(loaded, registry)
    chosen = [want for want in physical if _fits(registry, want, emulated=emulated)]
    if not (chosen or config.robot.actions or config.robot.perceptions):
        return Simulated(loaded)  # such as an upload, which needs no robot
    if not chosen:
        raise SimAdapterError(
            "--sim has nothing to replace: every actuator and camera of the file is virtual already"
            + (", and whose emulator can be part of the simulation" if emulated else "")
        )
    devices = [_device(config, registry, want) for want in chosen]
    try:
        adapter: SimAdapter = load_target(spec.sim_adapter)
        coupled = adapter(config, devices, emulated)
    except TargetError as error:
        raise SimAdapterError(f"the simulator is broken: {error}") from error
    names = tuple(coupled if emulated else (device.node_name for device in devices))
    if not emulated:
        take_calibrations(loaded, names, calibrations)
    replaced = {want.entry.path for want in chosen}
    real = () if emulated else tuple(_name(want) for want in physical if want.entry.path not in replaced)
    return Simulated(replace(loaded), names, coupled, real)  # a copy, whose graph is rebuilt


def physical_nodes(loaded: LoadedConfig, registry: Registry) -> list[Wanted]:
    """The devices that the mode starts, except virtual ones."""
    mode = mode_of(loaded.config, registry)
    wanted = wanted_nodes(loaded.graph, devices=mode.devices, models=False)
    return [want for want in wanted if want.block_name and not _is_virtual(registry, want)]


def _is_virtual(registry: Registry, want: Wanted) -> bool:
    spec = registry.find(want.kind, want.block_name, want.enum_value)
    if spec is None:  # the schema also has those of missing plugins
        rule = None if want.block is None else block_rule(want.block.DESCRIPTOR)
        return rule is not None and rule.virtual
    return isinstance(spec, DeviceSpec) and spec.virtual


def _name(want: Wanted) -> str:
    return want.entry.node.node_name


def _copy(loaded: LoadedConfig) -> LoadedConfig:
    config = pb.Config()
    config.CopyFrom(loaded.config)
    return replace(loaded, config=config)


def _fits(registry: Registry, want: Wanted, *, emulated: bool) -> bool:
    """Whether the simulation can replace a device or, if it is emulated, move and show it."""
    if not (want.kind is ActuatorSpec or _is_camera(want)):
        return False
    if not emulated:
        return True
    spec = registry.find(EmulatorSpec, want.block_name)
    try:
        return spec is not None and bool(load_target(spec.implementation).couples)
    except TargetError:
        return False  # named when the emulators start


def _is_camera(want: Wanted) -> bool:
    """Whether a sensor is a real camera. Other sensors are not simulated."""
    rule = None if want.block is None else block_rule(want.block.DESCRIPTOR)
    return rule is not None and "PERCEPTION_CAMERA" in rule.fits and not rule.virtual


def _device(config: pb.Config, registry: Registry, want: Wanted) -> RealDevice:
    block = want.block_path.rpartition(".")[2]
    joints = _joint_names(config, registry, want) if want.kind is ActuatorSpec else ()
    in_chain = motor_ids(want.block) is not None
    return RealDevice(_name(want), want.enum_value, want.entry.owner, block, joints, in_chain)


def _joint_names(config: pb.Config, registry: Registry, want: Wanted) -> tuple[str, ...]:
    """The joints of an actuator, from its settings or, without its plugin, the ids in its block."""
    calibration = next((arm for arm in config.calibration.arms if arm.node_name == _name(want)), None)
    spec = registry.find(want.kind, want.block_name, want.enum_value)
    if spec is not None and want.block is not None:
        from joshua.plugins.settings import make_settings  # needs pydantic

        context = BlockContext(calibration)
        settings, _ = make_settings(spec, want.block, node=want.entry.node, context=context)
        names = tuple(joint.name for joint in joints_of(settings))
    else:
        known = {motor.id: motor.joint_name for motor in calibration.motors} if calibration else {}
        names = tuple(known.get(number) or f"joint_{number}" for number in motor_ids(want.block) or ())
    if not names:
        raise SimAdapterError(
            f"{_name(want)}: its block does not say which joints it has, so the simulation cannot replace "
            "it. Leave it out of the file, or run without --sim"
        )
    return names


def take_calibrations(loaded: LoadedConfig, names: Iterable[str], path: str) -> None:
    """Replace the calibrations of real arms by those of the simulated ones.

    An arm that the file declares as simulated keeps its own, if there is none for it in ``path``.

    Args:
        loaded: a copy, which is changed; names: of the nodes that became part of the simulation.
        path: of the simulated arms' calibrations; "" for none.

    Raises:
        SimAdapterError: that file cannot be read.
    """
    config, names = loaded.config, set(names)
    actions = config.robot.actions
    simulated = [action.node.node_name for action in actions if device_block(action)[2].simulated]
    try:
        kept = kept_calibrations(path) if path else {}
    except FileRefused as error:
        raise SimAdapterError(str(error)) from error
    found = {name: kept[name] for name in simulated if name in kept}
    arms = [arm for arm in config.calibration.arms if arm.node_name not in names | found.keys()]
    arms += found.values()
    config.ClearField("calibration")
    if arms:
        config.calibration.arms.extend(arms)


def without_emulator(loaded: LoadedConfig, registry: Registry) -> list[Diagnostic]:
    """Devices without an emulator: one finding per kind of block."""
    by_block: dict[str, list[Wanted]] = {}
    for want in physical_nodes(loaded, registry):
        if registry.find(EmulatorSpec, want.block_name) is None:
            by_block.setdefault(want.block_name, []).append(want)
    context = Context(loaded)
    return [
        context.error(
            "emulator-missing",
            f"{', '.join(map(_name, wants))}: no plugin in use emulates {block}, "
            "and --emulate never opens a real device",
            wants[0].block_path,
            found="",
            remedy=_remedy(registry, block),
            related=also_needed_by(context, wants[1:]),
        )
        for block, wants in by_block.items()
    ]


def _remedy(registry: Registry, block: str) -> str:
    emulator = emulator_for(block)
    row = next((row for row in registry.rows() if row.distribution == emulator), None)
    if row is None and emulator:
        return f"{installing.install(emulator)}, or leave the device out of the file."
    if row is not None and row.status is PluginStatus.BLOCKED:
        return f"Leave --block-plugin {row.name} out, or leave the device out of the file."
    if row is not None and row.status is not PluginStatus.OK:
        return f"Look up {emulator} in `joshua plugins`, or leave the device out of the file."
    return "Leave the device out of the file, or ask its vendor for a plugin with an emulator."


def unstarted_emulators(loaded: LoadedConfig, registry: Registry) -> list[DeviceEmulator]:
    """The emulators of a file's devices, not started, for showing a plan."""
    found: list[DeviceEmulator] = []
    for want in physical_nodes(loaded, registry):
        spec = registry.find(EmulatorSpec, want.block_name)
        if spec is not None:
            try:
                emulator_type = load_target(spec.implementation)
            except TargetError:
                continue  # named when the emulators start
            found.append(emulator_type(EmulatedDevice(_name(want), want.enum_value, want.block, Path())))
    return found


def emulate(
    loaded: LoadedConfig, emulators: Iterable[DeviceEmulator], *, started: bool = True
) -> LoadedConfig:
    """Replace the endpoints and calibrations of devices by those of their emulators.

    Args:
        started: whether the emulators run. Those that do not only mark the device as emulated.
    """
    loaded = _copy(loaded)
    by_name = {emulator.device.node_name: emulator for emulator in emulators}
    known = {arm.node_name for arm in loaded.config.calibration.arms}
    for want in wanted_nodes(loaded.graph, devices=True, models=False):
        emulator = by_name.get(_name(want))
        if emulator is None:
            continue
        container = getattr(want.entry.owner, want.block_path.rpartition(".")[2])
        if want.block is container:
            emulator.amend(container)
        else:  # an Any block is unpacked, changed and packed again
            _, message = unpack(container)
            emulator.amend(message)
            container.Pack(message)
        calibration = emulator.calibration() if started and _name(want) not in known else None
        if calibration is not None:
            calibration.node_name = _name(want)
            loaded.config.calibration.arms.append(calibration)
    return loaded
