"""For editors, dashboards, scripts and the commands of plugins: load, check, plan, explain, hold nodes.

Nothing is imported before it is used. ``check(path)`` finds every problem of a file, ``plan(path)`` says what
it starts, ``explain(name)`` documents a field. ``check_file`` and ``finish`` do the same in two steps, for a
program that changes the configuration between them. ``RunningSystem`` finds what runs, calls its nodes and
receives its ``events``; ``ForegroundJob`` lets a program hold nodes of a robot as a run does. A command of a
plugin takes its options, its exit codes and its emulators from here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from joshua.plan.lazy import lazy_names

if TYPE_CHECKING:
    from joshua.cli.commands.explain import explain as explain
    from joshua.cli.doctor.finding import Finding as Finding
    from joshua.cli.doctor.finding import Level as Level
    from joshua.cli.doctor.host import Host as Host
    from joshua.cli.doctor.host import may_open as may_open
    from joshua.cli.exit_codes import ExitCode as ExitCode
    from joshua.cli.options import FAULT_ALONE as FAULT_ALONE
    from joshua.cli.options import add_config_options as add_config_options
    from joshua.cli.options import add_fault_option as add_fault_option
    from joshua.cli.options import positive_seconds as positive_seconds
    from joshua.cli.report import NotStartedError as NotStartedError
    from joshua.cli.report import exit_code_of as exit_code_of
    from joshua.cli.report import request_of as request_of
    from joshua.cli.report import show_findings as show_findings
    from joshua.cli.running import node_that_holds as node_that_holds
    from joshua.cli.stand_ins import EmulatedRig as EmulatedRig
    from joshua.cli.stand_ins import replace_devices as replace_devices
    from joshua.config import LoadedConfig as LoadedConfig
    from joshua.config import load as load
    from joshua.config.checks.device_table import calibratable_blocks as calibratable_blocks
    from joshua.config.checks.device_table import device_block as device_block
    from joshua.config.diagnostics import render_text as render_text
    from joshua.config.format_file import replace_file as replace_file
    from joshua.config.loading import journal_path as journal_path
    from joshua.devices.context import open_driver as open_driver
    from joshua.ipc.client import CallError as CallError
    from joshua.ipc.client import RunInfo as RunInfo
    from joshua.ipc.client import RunningSystem as RunningSystem
    from joshua.ipc.client import is_named as is_named
    from joshua.plan import Diagnostic as Diagnostic
    from joshua.plan import NodeKind as NodeKind
    from joshua.plan import NodeSpec as NodeSpec
    from joshua.plan import Plan as Plan
    from joshua.plan import events as events
    from joshua.plan.installing import install as install
    from joshua.planner.calibration_place import FileRefused as FileRefused
    from joshua.planner.calibration_place import kept_calibrations as kept_calibrations
    from joshua.planner.devices import Wanted as Wanted
    from joshua.planner.devices import wanted_nodes as wanted_nodes
    from joshua.planner.pipeline import Checked as Checked
    from joshua.planner.pipeline import PipelineResult as PipelineResult
    from joshua.planner.pipeline import check_file as check_file
    from joshua.planner.pipeline import finish as finish
    from joshua.planner.request import Purpose as Purpose
    from joshua.planner.request import Request as Request
    from joshua.plugins import Registry as Registry
    from joshua.plugins import load_registry as load_registry
    from joshua.plugins.targets import TargetError as TargetError
    from joshua.plugins.targets import load_target as load_target
    from joshua.supervisor.log_files import log_directory as log_directory
    from joshua.supervisor.tables import clean as clean
    from joshua.supervisor.tables import columns as columns
    from joshua.textproto.nearest import nearest_first as nearest_first
    from joshua.textproto.positions import Entry as Entry
    from joshua.textproto.positions import Positions as Positions
    from joshua.tools.configuration import calibration_place as calibration_place
    from joshua.tools.configuration import check as check
    from joshua.tools.configuration import plan as plan
    from joshua.tools.configuration import spans as spans
    from joshua.tools.foreground import ForegroundJob as ForegroundJob
    from joshua.tools.foreground import JobRefusedError as JobRefusedError

SECTIONS: dict[str, dict[str, tuple[str, ...]]] = {
    "Configurations": {
        "joshua.tools.configuration": (
            "check",
            "plan",
            "spans",
            "calibration_place",
        ),
        "joshua.devices.context": ("open_driver",),
        "joshua.cli.commands.explain": ("explain",),
        "joshua.planner.request": ("Request", "Purpose"),
        "joshua.planner.pipeline": ("PipelineResult", "Checked", "check_file", "finish"),
        "joshua.planner.calibration_place": ("kept_calibrations", "FileRefused"),
        "joshua.config.loading": ("journal_path",),
        "joshua.plan": ("Diagnostic", "NodeKind", "NodeSpec", "Plan", "events"),
        "joshua.plugins.targets": ("TargetError", "load_target"),
        "joshua.config": ("LoadedConfig", "load"),
        "joshua.config.diagnostics": ("render_text",),
        "joshua.config.checks.device_table": ("calibratable_blocks", "device_block"),
        "joshua.planner.devices": ("Wanted", "wanted_nodes"),
        "joshua.plugins": ("Registry", "load_registry"),
        "joshua.plan.installing": ("install",),
        "joshua.textproto.nearest": ("nearest_first",),
    },
    "A running system": {
        "joshua.ipc.client": ("RunningSystem", "RunInfo", "CallError", "is_named"),
        "joshua.supervisor.log_files": ("log_directory",),
    },
    "Programs that take nodes": {
        "joshua.tools.foreground": ("ForegroundJob", "JobRefusedError"),
    },
    "Commands of plugins": {
        "joshua.cli.exit_codes": ("ExitCode",),
        "joshua.cli.options": ("FAULT_ALONE", "add_config_options", "add_fault_option", "positive_seconds"),
        "joshua.cli.report": ("request_of", "show_findings", "exit_code_of", "NotStartedError"),
        "joshua.cli.stand_ins": ("replace_devices", "EmulatedRig"),
        "joshua.supervisor.tables": ("clean", "columns"),
        "joshua.cli.running": ("node_that_holds",),
    },
    "Configuration text": {
        "joshua.textproto.positions": ("Positions", "Entry"),
        "joshua.config.format_file": ("replace_file",),
    },
    "Checks of `joshua doctor`": {
        "joshua.cli.doctor.finding": ("Finding", "Level"),
        "joshua.cli.doctor.host": ("Host", "may_open"),
    },
}
"""The names by the heading that the reference lists them under, and the module that each stands in."""

__getattr__, __dir__ = lazy_names(__name__, *SECTIONS.values())
