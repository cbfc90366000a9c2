"""From the blocks of a file to installed implementations and checked settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from joshua.config.checks.device_table import fitting_blocks
from joshua.plan import Diagnostic, Severity
from joshua.plan.graph import RobotGraph
from joshua.planner.devices import Wanted, joints_of
from joshua.planner.diagnostics import Diagnostics
from joshua.planner.safety import check_safety
from joshua.plugins import ActuatorSpec, DeviceSpec, ModelSpec, NodePluginSpec, Registry, SensorSpec
from joshua.plugins.block_context import BlockContext
from joshua.schema import config_pb2 as pb
from joshua.schema import data_type_pb2, data_types

if TYPE_CHECKING:
    from joshua.plan import JointRange


@dataclass(frozen=True)
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


class Resolver:
    """Finds the implementation of each wanted node and makes its settings; problems become findings.

    Args:
        source: the configuration file, at whose folder relative paths start.
        allow_uncalibrated: joints without calibration may be energised.

    Attributes:
        joints: joints of each actuator by field path of its node block, known without a connection.
    """

    def __init__(
        self,
        config: pb.Config,
        graph: RobotGraph,
        registry: Registry,
        findings: Diagnostics,
        source: str,
        *,
        allow_uncalibrated: bool,
    ) -> None:
        self._registry = registry
        self._allow_uncalibrated = allow_uncalibrated
        self._findings = findings
        self._source = source
        self._calibrations = {arm.node_name: arm for arm in config.calibration.arms}
        self.joints: dict[str, Sequence[JointRange]] = {}
        self._graph = graph
        self._final_names: set[str] = set()

    def resolve(self, wanted: list[Wanted], physics: dict[str, Any] | None) -> list[Resolved]:
        """Resolves all nodes whose plugin is installed; the others become findings.

        Args:
            physics: settings of the simulation; None where there is none.
        """
        resolved = []
        missing: dict[tuple[type[NodePluginSpec], str], list[Wanted]] = {}
        for want in wanted:
            spec = self._spec(want)
            if spec is None and _is_complete(want):
                key = (want.kind, want.block_name or want.enum_value)
                missing.setdefault(key, []).append(want)
            calibration = self._calibrations.get(want.entry.node.node_name)
            reached = self._reached_joints(want) if want.kind is SensorSpec else ()
            simulation = physics if want.is_simulated else None
            settings = None
            if spec is not None:
                context = BlockContext(calibration, reached, simulation, launch=self._findings.launch)
                settings, problems = self._settings(want, spec, context)
                self._findings.items += problems
                self._unfit_types(want, spec)
                resolved.append(Resolved(want, spec, settings, reached))
            if want.kind is ActuatorSpec:
                joints = self.joints[want.entry.path] = joints_of(settings, want.block, calibration)
                # Without calibration an arm's joints have names that nobody will use, unless that is waived.
                virtual = isinstance(spec, DeviceSpec) and spec.virtual
                if calibration is not None or virtual or self._allow_uncalibrated:
                    self._final_names.add(want.entry.path)
                if isinstance(spec, ActuatorSpec):
                    check_safety(want, spec, joints, self._findings)
        for wants in missing.values():
            self._findings.plugin_missing(wants, self._registry)
        return resolved

    def _reached_joints(self, want: Wanted) -> tuple[JointRange, ...]:
        """The joints that a sensor's commands reach; empty unless the names of all of them are final."""
        reached = self._graph.driven_by(want.entry)
        if not all(entry.path in self._final_names for entry in reached):
            return ()
        return tuple(joint for entry in reached for joint in self.joints[entry.path])

    def _spec(self, want: Wanted) -> NodePluginSpec | None:
        if not _is_complete(want):
            return None
        return self._registry.find(want.kind, want.block_name, want.enum_value)

    def _settings(
        self, want: Wanted, spec: NodePluginSpec, context: BlockContext
    ) -> tuple[Any, list[Diagnostic]]:
        if want.block is None or not spec.settings:
            return None, []
        # Imported here, because it needs pydantic, which a file without such a block need not wait for.
        from joshua.config.input_paths import with_absolute_paths
        from joshua.plugins.settings import make_settings

        return make_settings(
            spec,
            with_absolute_paths(want.block, want.block_path, self._findings.positions, self._source),
            node=want.entry.node,
            context=context,
            field_path=want.block_path,
            positions=self._findings.positions,
        )

    def _unfit_types(self, want: Wanted, spec: NodePluginSpec) -> None:
        """Topics of a third party's device that it cannot serve; the checks know the types of the others."""
        if "." not in want.block_name or not isinstance(spec, DeviceSpec) or not spec.data_types:
            return
        offered = tuple(data_types.number(name) for name in spec.data_types)
        allowed = tuple(data_types.enum_names(number)[0] for number in offered)
        for index, publisher in enumerate(want.entry.node.publishers):
            number = publisher.data_type
            if number in offered or number not in data_type_pb2.DataType.values() or not number:
                continue  # absent and unknown numbers are findings of the checks
            found = data_types.enum_names(number)[0]
            self._findings.add(
                "data-type-unfit",
                Severity.ERROR,
                f"{want.entry.node.node_name} ({want.block_name}) cannot publish {found}",
                f"{want.entry.path}.publishers[{index}].data_type",
                found=found,
                allowed=allowed,
                remedy=f"write data_type: {allowed[0]}",
            )


def _is_complete(want: Wanted) -> bool:
    """Whether block and type are there and go together; the checks report what is absent or does not."""
    if want.enum_value.endswith("_UNSPECIFIED"):
        return False
    if want.kind is ModelSpec:
        return True
    is_third_party = "." in want.block_name
    return is_third_party or want.block_name in fitting_blocks(want.entry.owner)
