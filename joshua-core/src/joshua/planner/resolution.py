"""From the blocks of a file to installed implementations and checked settings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from joshua.config.checks.device_table import fitting_blocks
from joshua.plan import Related
from joshua.planner.devices import Wanted, joints_of
from joshua.planner.safety import check_safety
from joshua.plugins import ActuatorSpec, DeviceSpec, ModelSpec, NodePluginSpec, SensorSpec
from joshua.plugins.block_context import BlockContext
from joshua.schema import data_type_pb2, data_types

if TYPE_CHECKING:
    from joshua.config.checks import Context
    from joshua.plan import Diagnostic, JointRange
    from joshua.planner.draft import Draft


@dataclass(frozen=True, eq=False, repr=False)
class Resolved:
    """One wanted node with its implementation.

    Attributes:
        settings: the checked settings model; None where the plugin declares none.
        joints: that a sensor's commands reach, where all of them are known.
    """

    want: Wanted
    spec: NodePluginSpec
    settings: Any
    joints: tuple[JointRange, ...] = ()


def resolve_nodes(draft: Draft, wanted: list[Wanted], physics: dict[str, Any] | None) -> list[Resolved]:
    """Resolve all nodes whose plugin is installed, fill in ``draft.joints``; the others become findings.

    Args:
        physics: settings of the simulation; None where there is none.
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
        # The joints that a sensor's commands reach are known where the names of all of them are final.
        driven = draft.graph.driven_by(entry) if want.kind is SensorSpec else []
        known = all(other.path in final_names for other in driven)
        reached = tuple(joint for other in driven for joint in draft.joints[other.path]) if known else ()
        simulation = physics if want.is_simulated else None
        context = BlockContext(calibration, reached, simulation, launch=draft.launch)
        block = want.block
        if block is not None and spec.settings:
            positions = draft.loaded.positions
            block = with_absolute_paths(block, want.block_path, positions, draft.request.path)
        settings = draft.settings(spec, block, want.block_path, context, entry.node)
        draft.findings += _unfit_types(draft, want, spec)
        resolved.append(Resolved(want, spec, settings, reached))
        if isinstance(spec, ActuatorSpec):
            joints = draft.joints[entry.path] = joints_of(settings)
            # Without a calibration the names of joints are placeholders, unless the user waives it.
            if joints and (calibration is not None or spec.virtual or draft.allows_uncalibrated):
                final_names.add(entry.path)
            check_safety(draft, want, spec, joints)
    draft.findings += [_plugin_missing(draft, wants) for wants in missing.values()]
    return resolved


def _plugin_missing(draft: Draft, wants: list[Wanted]) -> Diagnostic:
    """One finding for all nodes of one kind and block whose plugin is not installed."""
    first, others = wants[0], wants[1:]
    names = ", ".join(want.entry.node.node_name or want.entry.owner_path for want in wants)
    # Several nodes with one block may have different roles, none of which matters here.
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
    """Topics of a third party's device that it cannot serve; the checks know the types of the others."""
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
    """Whether block and type are there and go together; the checks report what is absent or does not."""
    if want.enum_value.endswith("_UNSPECIFIED"):
        return False
    if want.kind is ModelSpec:
        return True
    is_third_party = "." in want.block_name
    return is_third_party or want.block_name in fitting_blocks(want.entry.owner)
