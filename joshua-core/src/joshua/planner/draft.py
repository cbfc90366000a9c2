"""A checked configuration during planning, with the findings of planning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from joshua.config.checks import Context
from joshua.modes import mode_of
from joshua.plan import Diagnostic, JointRange

if TYPE_CHECKING:
    from joshua.config import LoadedConfig
    from joshua.planner.request import Request
    from joshua.plugins import PluginSpec, Registry
    from joshua.plugins.block_context import BlockContext
    from joshua.schema import config_pb2 as pb


class Draft(Context):
    """The state of the planning steps.

    Attributes:
        registry: the installed plugins; request: of the user; mode: of the file.
        graph: with the services of the mode, once they are resolved.
        findings: problems that planning has found.
        joints: of each actuator by the field path of its node block; () if unknown.
    """

    def __init__(self, loaded: LoadedConfig, registry: Registry, request: Request) -> None:
        super().__init__(loaded, launch=request.launch)
        self.registry, self.request = registry, request
        self.mode = mode_of(loaded.config, registry)
        self.findings: list[Diagnostic] = []
        self.joints: dict[str, Sequence[JointRange]] = {}

    @property
    def allows_uncalibrated(self) -> bool:
        """Whether joints without a calibration may be energised."""
        return self.request.allow_uncalibrated or self.mode.works_uncalibrated

    def settings(
        self, spec: PluginSpec, block: Any, path: str, context: BlockContext, node: pb.Node | None = None
    ) -> Any:
        """Make the settings model of a block. Broken rules become findings.

        Returns:
            None if the plugin declares no settings or a rule is broken.
        """
        if block is None or not spec.settings:
            return None
        # Imported here because it requires pydantic, which a file without such a block does not need.
        from joshua.plugins.settings import make_settings

        settings, problems = make_settings(
            spec, block, node=node, context=context, field_path=path, positions=self.loaded.positions
        )
        self.findings += [self._at_calibration(item, path, context) for item in problems]
        return settings

    def _at_calibration(self, item: Diagnostic, path: str, context: BlockContext) -> Diagnostic:
        """Move a problem with the calibration that a block was given to the file that contains it."""
        given, inside = context.calibration, f"{path}.calibration"
        if given is None or not f"{item.field_path}.".startswith(f"{inside}."):
            return item
        arms = self.config.calibration.arms
        index = next(number for number, arm in enumerate(arms) if arm.node_name == given.node_name)
        field_path = f"calibration.arms[{index}]{item.field_path.removeprefix(inside)}"
        return replace(item, field_path=field_path, position=self.loaded.positions.nearest(field_path))
