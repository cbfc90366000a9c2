"""What editors, dashboards, scripts and the commands of plugins use: load, check, plan, explain, take nodes.

Nothing is imported before it is used. ``check(path)`` finds every problem of a file, ``plan(path)`` says what
would be started, ``explain(name)`` documents a field; ``check_file`` and ``finish`` are the same road in two
steps, for a program that changes the configuration between them. ``RunningSystem`` finds what runs, asks its
nodes and hears its events; ``ForegroundJob`` lets a program hold nodes of a robot as a run does. A command of
a plugin takes its options, its exit codes and its stand-ins from here.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from joshua.cli.emulation import start_rig as start_rig
    from joshua.cli.exit_codes import ExitCode as ExitCode
    from joshua.cli.options import FAULT_ALONE as FAULT_ALONE
    from joshua.cli.options import add_config_options as add_config_options
    from joshua.cli.options import add_fault_option as add_fault_option
    from joshua.cli.options import positive_seconds as positive_seconds
    from joshua.cli.report import exit_code_of as exit_code_of
    from joshua.cli.report import request_of as request_of
    from joshua.cli.report import show_findings as show_findings
    from joshua.cli.simulation import start_simulation as start_simulation
    from joshua.config.calibration_paths import journal_path as journal_path
    from joshua.ipc.client import CallError as CallError
    from joshua.ipc.client import RunInfo as RunInfo
    from joshua.ipc.client import RunningSystem as RunningSystem
    from joshua.plan import Diagnostic as Diagnostic
    from joshua.plan import NodeKind as NodeKind
    from joshua.plan import NodeSpec as NodeSpec
    from joshua.plan import Plan as Plan
    from joshua.plan.events import Event as Event
    from joshua.plan.events import Gap as Gap
    from joshua.plan.events import LogEntry as LogEntry
    from joshua.plan.events import NodeRow as NodeRow
    from joshua.plan.events import NodeStatus as NodeStatus
    from joshua.plan.events import Progress as Progress
    from joshua.plan.events import RunEvent as RunEvent
    from joshua.plan.events import RunStatus as RunStatus
    from joshua.plan.events import StartTable as StartTable
    from joshua.plan.events import event_record as event_record
    from joshua.planner.calibration_place import FileRefused as FileRefused
    from joshua.planner.calibration_place import calibration_place as calibration_place
    from joshua.planner.calibration_place import kept_calibrations as kept_calibrations
    from joshua.planner.emulation import EmulatedRig as EmulatedRig
    from joshua.planner.pipeline import Checked as Checked
    from joshua.planner.pipeline import Examination as Examination
    from joshua.planner.pipeline import check_file as check_file
    from joshua.planner.pipeline import finish as finish
    from joshua.planner.request import Purpose as Purpose
    from joshua.planner.request import Request as Request
    from joshua.plugins.targets import TargetError as TargetError
    from joshua.tools.configuration import check as check
    from joshua.tools.configuration import explain as explain
    from joshua.tools.configuration import open_driver as open_driver
    from joshua.tools.configuration import plan as plan
    from joshua.tools.configuration import spans as spans
    from joshua.tools.foreground import ForegroundJob as ForegroundJob
    from joshua.tools.foreground import JobRefusedError as JobRefusedError

SECTIONS: dict[str, dict[str, tuple[str, ...]]] = {
    "Configurations": {
        "joshua.tools.configuration": ("check", "plan", "explain", "spans", "open_driver"),
        "joshua.planner.request": ("Request", "Purpose"),
        "joshua.planner.pipeline": ("Examination", "Checked", "check_file", "finish"),
        "joshua.planner.calibration_place": ("calibration_place", "kept_calibrations", "FileRefused"),
        "joshua.config.calibration_paths": ("journal_path",),
        "joshua.plan": ("Diagnostic", "NodeKind", "NodeSpec", "Plan"),
        "joshua.plugins.targets": ("TargetError",),
    },
    "A running system": {
        "joshua.ipc.client": ("RunningSystem", "RunInfo", "CallError"),
        "joshua.plan.events": (
            *(
                "Event",
                "RunStatus",
                "NodeStatus",
                "RunEvent",
                "Progress",
                "LogEntry",
                "StartTable",
                "NodeRow",
            ),
            *("Gap", "event_record"),
        ),
    },
    "Programs that take nodes": {
        "joshua.tools.foreground": ("ForegroundJob", "JobRefusedError"),
    },
    "Commands of plugins": {
        "joshua.cli.exit_codes": ("ExitCode",),
        "joshua.cli.options": ("FAULT_ALONE", "add_config_options", "add_fault_option", "positive_seconds"),
        "joshua.cli.report": ("request_of", "show_findings", "exit_code_of"),
        "joshua.cli.emulation": ("start_rig",),
        "joshua.cli.simulation": ("start_simulation",),
        "joshua.planner.emulation": ("EmulatedRig",),
    },
}
"""The names by the heading that the reference lists them under, and the module that each stands in."""

_MODULE_OF = {
    name: module for modules in SECTIONS.values() for module, names in modules.items() for name in names
}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted(_MODULE_OF)
