"""From a path to a checked plan: all steps before "supervise", without opening a device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from joshua.plan import Diagnostic, Severity
from joshua.planner.request import Purpose, Request

if TYPE_CHECKING:
    from joshua.config import LoadedConfig
    from joshua.plan import Plan
    from joshua.planner.amend import Simulated
    from joshua.plugins import Registry


@dataclass(frozen=True, eq=False, repr=False)
class PipelineResult:
    """The result for a configuration.

    Attributes:
        diagnostics: all findings; sources: file name to text, for rendering.
        plan: the plan, if one was requested and no finding is an error.
    """

    diagnostics: Sequence[Diagnostic]
    sources: Mapping[str, str]
    plan: Plan | None = None

    @property
    def errors(self) -> list[Diagnostic]:
        """The findings that prevent a run."""
        return [item for item in self.diagnostics if item.severity is Severity.ERROR]


@dataclass(frozen=True, eq=False, repr=False)
class Checked:
    """A configuration whose text has been read and checked.

    Attributes:
        loaded: with simulated devices if ``--sim`` is set.
        simulated: replaced devices; None if simulation was not requested or is refused.
    """

    request: Request
    registry: Registry
    loaded: LoadedConfig
    diagnostics: Sequence[Diagnostic]
    simulated: Simulated | None = None

    @property
    def result(self) -> PipelineResult:
        """The result so far."""
        return PipelineResult(self.diagnostics, self.loaded.sources)


def examine(request: Request) -> PipelineResult:
    """Load, check and plan a configuration. Report all problems together, and never raise for one.

    Emulated devices get the endpoint ``emulated``, because nothing is started.
    """
    checked = check_file(request)
    if request.emulate and not checked.result.errors:
        from joshua.planner.amend import emulate, unstarted_emulators

        emulators = unstarted_emulators(checked.loaded, checked.registry)
        checked = replace(checked, loaded=emulate(checked.loaded, emulators, started=False))
    return finish(checked)


def check_file(request: Request) -> Checked:
    """Load a configuration, run the checks of its text, and replace devices by simulated ones."""
    from joshua.config import check, load
    from joshua.config.checks.paths import check_paths
    from joshua.modes import check_mode, mode_of
    from joshua.planner.calibration_place import calibration_place, interrupted_calibrations
    from joshua.plugins import load_registry
    from joshua.schema.config_pb2 import Config

    registry = load_registry(blocked=tuple(request.blocked_plugins))
    home = request.state_home
    place = calibration_place(home, emulate=request.emulate)

    def calibration_file(path: str, config: Config) -> str:
        return "" if mode_of(config, registry).recalibrates else place(path, config.general.id)

    loaded = load(
        request.path,
        overrides=request.overrides,
        message_types=registry.message_modules(),
        calibration=calibration_file,
    )
    recalibrates = mode_of(loaded.config, registry).recalibrates
    diagnostics = [
        *loaded.diagnostics,
        *check(loaded, without=("calibration",) if recalibrates else ()),
        *check_mode(loaded, registry, launch=request.launch),
        *check_paths(
            loaded,
            launch=request.launch,
            host=request.host,
            is_packaged=registry.is_packaged,
            packaged_weights=registry.packaged_weights,
        ),
    ]
    if request.launch and not recalibrates and (request.emulate or not request.simulate):
        diagnostics += interrupted_calibrations(loaded, emulate=request.emulate, state_home=home)
    checked = Checked(request, registry, loaded, diagnostics)
    if checked.result.errors or not (request.simulate or request.emulate):
        return checked
    return _amended(checked)


def _amended(checked: Checked) -> Checked:
    """Apply ``--sim``, and find devices without an emulator. Refusals become findings."""
    from joshua.config.checks import Context
    from joshua.planner import amend
    from joshua.planner.calibration_place import calibration_place
    from joshua.plugins.emulator import SimAdapterError

    request, registry, loaded = checked.request, checked.registry, checked.loaded
    found, context = list(checked.diagnostics), Context(loaded)
    simulated = None
    if request.simulate:
        place = calibration_place(request.state_home, emulate=False, simulate=True)
        path = place(loaded.path, loaded.config.general.id) if request.state_home else ""
        try:
            simulated = amend.simulate(loaded, registry, emulated=request.emulate, calibrations=path)
        except amend.NoSimulatorError as error:
            found.append(context.error("plugin-missing", str(error), remedy="Install the simulator"))
        except SimAdapterError as error:
            found.append(context.error("simulation-refused", str(error)))
        else:
            loaded, real = simulated.loaded, ", ".join(simulated.real)
            message = f"--sim does not replace these devices, and the run opens them: {real}"
            found += [context.note("devices-stay-real", message, found=real)] if real else []
    if request.emulate:
        found += amend.without_emulator(loaded, registry)
    return replace(checked, loaded=loaded, diagnostics=found, simulated=simulated)


def finish(checked: Checked) -> PipelineResult:
    """Resolve the plugins of a checked configuration and, if requested, make its plan."""
    from joshua.config.checks.taint import one_of_each
    from joshua.planner.draft import Draft
    from joshua.planner.planning import make_plan, resolve

    draft = Draft(checked.loaded, checked.registry, checked.request)
    nodes, services = resolve(draft)

    def result() -> PipelineResult:
        findings = one_of_each(checked.diagnostics, draft.findings, checked.loaded.positions)
        return PipelineResult(findings, checked.loaded.sources)

    if result().errors or checked.request.purpose is Purpose.VALIDATE:
        return result()
    plan = make_plan(draft, nodes, services)
    found = result()
    if plan is None or found.errors:
        return found
    return replace(found, plan=plan.model_copy(update={"findings": tuple(found.diagnostics)}))
