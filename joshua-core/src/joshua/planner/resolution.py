"""Resolves the blocks of a file: implementations, checked settings, joints and safe states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from joshua.config.checks.context import unpacked
from joshua.config.checks.device_table import fitting_blocks, value_name
from joshua.plan import Related
from joshua.plan.graph import NodeEntry, RobotGraph
from joshua.plan.joints import JointRange
from joshua.plugins import ActuatorSpec, DeviceSpec, ModelSpec, NodePluginSpec, SensorSpec
from joshua.plugins.block_context import BlockContext
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2, data_types
from joshua.schema.rules import block_rule

if TYPE_CHECKING:
    from joshua.config.checks import Context
    from joshua.plan import Diagnostic
    from joshua.planner.draft import Draft
    from joshua.plugins.model_settings import ModelContext

PARK_TIMEOUT_S = 5.0
ON_STALE_AFTER_S = 5.0

#: Time beyond parking: for the guardian, its report, and closing the device.
STOP_MARGIN_S = 6.0


@dataclass(frozen=True, eq=False, repr=False)
class Wanted:
    """One node that the mode starts: its entry in the file, and the key of its implementation.

    Attributes:
        block_name: member of the oneof, or the full message name of an ``Any`` block; "" if none is set.
        block: the block's message, unpacked; None if none is set.
        block_path: field path of the block.
        enum_value: name such as ``PERCEPTION_LIDAR``.
    """

    entry: NodeEntry
    kind: type[NodePluginSpec]
    block_name: str
    block: Any
    block_path: str
    enum_value: str

    @property
    def is_simulated(self) -> bool:
        """Whether the device is part of the simulated model."""
        return self.block is not None and block_rule(self.block.DESCRIPTOR).simulated


def wanted_nodes(graph: RobotGraph, *, devices: bool, models: bool) -> list[Wanted]:
    """List the nodes that a mode starts, in the order of the file. A replay replaces leaders."""
    return [
        _wanted(entry)
        for entry in graph.entries
        if (models if entry.is_model else devices) and not (graph.replays and entry.leads)
    ]


def _wanted(entry: NodeEntry) -> Wanted:
    owner = entry.owner
    if entry.is_actuator:
        name = owner.WhichOneof("actuator_config") or ""
        enum_value = value_name(pb.ActionType, owner.action_type)
        kind: type[NodePluginSpec] = ActuatorSpec
    elif entry.is_sensor:
        name = owner.WhichOneof("device_config") or ""
        enum_value = value_name(pb.PerceptionType, owner.perception_type)
        kind = SensorSpec
    else:
        name = next((n for n in ("plugin_config", "random_noise_config") if owner.HasField(n)), "")
        if not name and owner.model_type == pb.RANDOM_NOISE:
            name = "random_noise_config"  # an omitted block means its defaults
        enum_value = value_name(pb.ModelType, owner.model_type)
        kind = ModelSpec
    path = f"{entry.owner_path}.{name}" if name else entry.owner_path
    block = getattr(owner, name) if name else (owner if kind is ModelSpec else None)
    if name == "plugin_config":
        name, block = unpack(block)
    return Wanted(entry, kind, name, block, path, enum_value)


def unpack(block: Any) -> tuple[str, Any]:
    """Unpack an ``Any`` block: full message name, and the message or None if its type is unknown."""
    return block.type_url.rpartition("/")[2], unpacked(block)


def joints_of(settings: Any) -> tuple[JointRange, ...]:
    """The joints of an actuator, from its settings without a connection; () if unknown."""
    if settings is None:
        return ()
    from joshua.plugins.settings import ActuatorSettings  # needs pydantic, as the settings did

    return settings.joints() if isinstance(settings, ActuatorSettings) else ()


def _exclusive(settings: Any) -> Mapping[str, str]:
    """What no other node may drive, by the field that names it; {} for a node that is no actuator."""
    if settings is None:
        return {}
    from joshua.plugins.settings import ActuatorSettings  # needs pydantic, as the settings did

    return settings.exclusive() if isinstance(settings, ActuatorSettings) else {}


@dataclass(frozen=True, eq=False, repr=False)
class Resolved:
    """A wanted node with its implementation.

    Attributes:
        settings: the checked settings model; None if the plugin declares none.
        joints: those that a sensor commands, if all are known.
    """

    want: Wanted
    spec: NodePluginSpec
    settings: Any
    joints: tuple[JointRange, ...] = ()


def resolve_nodes(draft: Draft, wanted: list[Wanted], physics: dict[str, Any] | None) -> list[Resolved]:
    """Resolve all nodes whose plugin is installed, and set ``draft.joints``. The others become findings.

    Args:
        physics: settings of the simulation; None if there is none.
    """
    from joshua.config.input_paths import with_absolute_paths

    calibrations = {arm.node_name: arm for arm in draft.config.calibration.arms}
    resolved = []
    final_names: set[str] = set()
    missing: dict[tuple[type[NodePluginSpec], str], list[Wanted]] = {}
    for want in wanted:
        if not _is_complete(want):
            continue
        entry = want.entry
        spec = draft.registry.find(want.kind, want.block_name, want.enum_value)
        if spec is None:
            missing.setdefault((want.kind, want.block_name or want.enum_value), []).append(want)
            continue
        calibration = calibrations.get(entry.node.node_name)
        # The joints that a sensor commands are known if the names of all of them are final.
        driven = draft.graph.driven_by(entry) if want.kind is SensorSpec else []
        known = all(other.path in final_names for other in driven)
        reached = tuple(joint for other in driven for joint in draft.joints[other.path]) if known else ()
        simulation = physics if want.is_simulated else None
        model = _model_context(draft, entry) if entry.is_model else None
        context = BlockContext(calibration, reached, simulation, model=model, launch=draft.launch)
        block = want.block
        if block is not None and spec.settings:
            positions = draft.loaded.positions
            block = with_absolute_paths(block, want.block_path, positions, draft.request.path)
        settings = draft.settings(spec, block, want.block_path, context, entry.node)
        draft.findings += _unfit_types(draft, want, spec)
        resolved.append(Resolved(want, spec, settings, reached))
        if isinstance(spec, ActuatorSpec):
            joints = draft.joints[entry.path] = joints_of(settings)
            # Without a calibration, joint names are placeholders, unless the user waives it.
            if joints and (calibration is not None or spec.virtual or draft.allows_uncalibrated):
                final_names.add(entry.path)
            check_safety(draft, want, spec, joints)
    draft.findings += [_plugin_missing(draft, wants) for wants in missing.values()]
    draft.findings += _driven_twice(draft, resolved)
    return resolved


def _driven_twice(draft: Draft, resolved: Sequence[Resolved]) -> list[Diagnostic]:
    """Find what two nodes drive although only one may, such as a joint of a simulation."""
    found = []
    first_of: dict[tuple[str, str], tuple[str, str]] = {}
    for item in resolved:
        node_name = item.want.entry.node.node_name
        for field, name in _exclusive(item.settings).items():
            path = f"{item.want.block_path}.{field}"
            first_name, first_path = first_of.setdefault((item.want.block_name, name), (node_name, path))
            if first_path == path:
                continue
            message = f"{node_name} drives {name!r}, which {first_name} drives already"
            remedy = "Name each in one node only"
            related = draft.see(first_path, f"{first_name} drives it here")
            found.append(draft.error("invalid-setting", message, path, remedy=remedy, related=related))
    return found


def _model_context(draft: Draft, entry: NodeEntry) -> ModelContext:
    from joshua.planner.model_planner import model_context  # imports features, which other files do not need

    return model_context(draft, entry)


def _plugin_missing(draft: Draft, wants: list[Wanted]) -> Diagnostic:
    """One finding for all nodes of a kind and block whose plugin is not installed."""
    first, others = wants[0], wants[1:]
    names = ", ".join(want.entry.node.node_name or want.entry.owner_path for want in wants)
    # Several nodes with the same block may have different roles, which do not matter here.
    same_role = len({want.enum_value for want in wants}) == 1
    enum_value = first.enum_value if same_role or not first.block_name else ""
    message = draft.registry.missing(names, first.kind, first.block_name, enum_value)
    remedy = draft.registry.remedy(first.kind, first.block_name, enum_value)
    related = also_needed_by(draft, others)
    return draft.missing("plugin-missing", message, first.block_path, remedy=remedy, related=related)


def also_needed_by(context: Context, wants: list[Wanted]) -> tuple[Related, ...]:
    """The positions of further blocks that need the same plugin."""
    labels = ((want.block_path, f"{want.entry.node.node_name} needs it too") for want in wants)
    return tuple(related for path, label in labels for related in context.see(path, label))


def _unfit_types(draft: Draft, want: Wanted, spec: NodePluginSpec) -> list[Diagnostic]:
    """Topics that a third party's device does not support. The checks cover other devices."""
    if "." not in want.block_name or not isinstance(spec, DeviceSpec) or not spec.data_types:
        return []
    offered = tuple(data_types.number(name) for name in spec.data_types)
    allowed = tuple(data_types.enum_names(number)[0] for number in offered)
    return [
        draft.error(
            "data-type-unfit",
            f"{want.entry.node.node_name} ({want.block_name}) cannot publish "
            f"{data_types.enum_names(publisher.data_type)[0]}",
            f"{want.entry.path}.publishers[{index}].data_type",
            allowed=allowed,
            remedy=f"Write data_type: {allowed[0]}",
        )
        for index, publisher in enumerate(want.entry.node.publishers)
        # The checks report absent and unknown numbers.
        if publisher.data_type in set(data_type_pb2.DataType.values()) - {0, *offered}
    ]


def _is_complete(want: Wanted) -> bool:
    """Whether block and type are set and match. The checks report everything else."""
    if want.enum_value.endswith("_UNSPECIFIED"):
        return False
    if want.kind is ModelSpec:
        return True
    is_third_party = "." in want.block_name
    return is_third_party or want.block_name in fitting_blocks(want.entry.owner)


def safety_facts(action: pb.SingleAction, spec: ActuatorSpec) -> dict[str, Any]:
    """Facts about the safe state of an actuator, the action of its guardian and of an e-stop."""
    from joshua.plan import OnStale, SafeStop

    is_leader = action.action_type == pb.ACTION_LEADER
    state = action.safe_state or (pb.RELEASE if is_leader else pb.HOLD)
    name = pb.SafeState.Name(state) if state in pb.SafeState.values() else "HOLD"
    facts: dict[str, Any] = {
        "safe_state": name,
        "estop_action": spec.safe_stop,
        "keeps_last_goal": not (spec.safe_stop or spec.stops_itself or spec.virtual),
    }
    timeout_s = float(action.park_timeout_s) if action.HasField("park_timeout_s") else PARK_TIMEOUT_S
    pose = tuple(action.park_pose_rad)
    if not is_leader and action.on_stale in (pb.RELEASE, pb.PARK_THEN_RELEASE):
        after_s = float(action.on_stale_after_s) if action.HasField("on_stale_after_s") else ON_STALE_AFTER_S
        facts["on_stale"] = OnStale(pb.SafeState.Name(action.on_stale), after_s, pose, timeout_s)
    if not is_leader and spec.safe_stop:
        facts["safe_stop"] = SafeStop(spec.safe_stop, name, pose, timeout_s)
        # Not only for parking: a guardian also needs time to search for a missing device.
        facts["stop_timeout_s"] = timeout_s + STOP_MARGIN_S
    return facts


def check_safety(draft: Draft, want: Wanted, spec: ActuatorSpec, joints: Sequence[JointRange]) -> None:
    """Find a park pose that does not match the joints, and devices that cannot park."""
    action, path, name = want.entry.owner, want.entry.owner_path, want.entry.node.node_name
    has_guardian = bool(spec.safe_stop) and action.action_type != pb.ACTION_LEADER
    parks_when_stale = action.on_stale == pb.PARK_THEN_RELEASE
    found = draft.findings
    if action.HasField("park_timeout_s") and not (has_guardian or parks_when_stale):
        message = f"park_timeout_s has no effect: {name} has no guardian whose time it could limit"
        found.append(draft.note("field-unused", message, f"{path}.park_timeout_s"))
    parks = action.safe_state == pb.PARK_THEN_RELEASE
    if parks and not spec.safe_stop:
        message = f"{name}: the plugin of {want.block_name or want.enum_value} cannot park"
        allowed: tuple[str, ...] = ("HOLD", "RELEASE")
        found.append(draft.error("safe-state-unfit", message, f"{path}.safe_state", allowed=allowed))
    elif (parks or parks_when_stale) and joints and len(action.park_pose_rad) not in (0, len(joints)):
        names = ", ".join(joint.name for joint in joints)
        message = (
            f"{name}: the park pose has {len(action.park_pose_rad)} angles, "
            f"but the actuator has {len(joints)} joints: {names}"
        )
        allowed = (f"{len(joints)} angles",)
        found.append(draft.error("park-pose-unfit", message, f"{path}.park_pose_rad", allowed=allowed))
