# ruff: noqa: I001 - by headings, which the reference lists the names under

# Configurations
from joshua.tools.configuration import check as check
from joshua.tools.configuration import plan as plan
from joshua.tools.configuration import spans as spans
from joshua.tools.configuration import calibration_place as calibration_place
from joshua.devices.context import open_driver as open_driver
from joshua.cli.commands.explain import explain as explain
from joshua.planner.request import Request as Request
from joshua.planner.request import Purpose as Purpose
from joshua.planner.pipeline import PipelineResult as PipelineResult
from joshua.planner.pipeline import Checked as Checked
from joshua.planner.pipeline import check_file as check_file
from joshua.planner.pipeline import finish as finish
from joshua.planner.calibration_place import kept_calibrations as kept_calibrations
from joshua.planner.calibration_place import FileRefused as FileRefused
from joshua.config.loading import journal_path as journal_path
from joshua.plan import Diagnostic as Diagnostic
from joshua.plan import NodeKind as NodeKind
from joshua.plan import NodeSpec as NodeSpec
from joshua.plan import Plan as Plan
from joshua.plan import events as events
from joshua.plugins.targets import TargetError as TargetError
from joshua.plugins.targets import load_target as load_target
from joshua.config import LoadedConfig as LoadedConfig
from joshua.config import load as load
from joshua.config.diagnostics import render_text as render_text
from joshua.config.checks.device_table import calibratable_blocks as calibratable_blocks
from joshua.config.checks.device_table import device_block as device_block
from joshua.planner.resolution import Wanted as Wanted
from joshua.planner.resolution import wanted_nodes as wanted_nodes
from joshua.plugins import Registry as Registry
from joshua.plugins import load_registry as load_registry
from joshua.plan.installing import install as install
from joshua.plan.json_text import parse_json as parse_json
from joshua.plan.lfs import describe_pointer as describe_pointer
from joshua.plan.lfs import describe_pointers as describe_pointers
from joshua.textproto.nearest import nearest_first as nearest_first

# A running system
from joshua.ipc.client import RunningSystem as RunningSystem
from joshua.ipc.client import RunInfo as RunInfo
from joshua.ipc.client import CallError as CallError
from joshua.ipc.client import is_named as is_named
from joshua.supervisor.log_files import log_directory as log_directory

# ROS 2 graphs
from joshua.tools.ros_graph import GraphError as GraphError
from joshua.tools.ros_graph import graph_transport as graph_transport

# Programs that take nodes
from joshua.tools.foreground import foreground_job as foreground_job

# Commands of plugins
from joshua.cli.exit_codes import ExitCode as ExitCode
from joshua.cli.options import FAULT_ALONE as FAULT_ALONE
from joshua.cli.options import add_config as add_config
from joshua.cli.options import add_config_options as add_config_options
from joshua.cli.options import add_timeout as add_timeout
from joshua.cli.options import add_fault_option as add_fault_option
from joshua.cli.options import positive_seconds as positive_seconds
from joshua.cli.report import request_of as request_of
from joshua.tools.keys import key_screen as key_screen
from joshua.cli.report import show_findings as show_findings
from joshua.cli.report import exit_code_of as exit_code_of
from joshua.cli.report import NotStartedError as NotStartedError
from joshua.cli.stand_ins import replace_devices as replace_devices
from joshua.cli.stand_ins import EmulatedRig as EmulatedRig
from joshua.supervisor.tables import Screen as Screen
from joshua.supervisor.tables import columns as columns
from joshua.plan.foreign_text import printable as printable
from joshua.plan.foreign_text import raw as raw
from joshua.cli.running import node_that_holds as node_that_holds

# Configuration text
from joshua.textproto.positions import Positions as Positions
from joshua.textproto.positions import Entry as Entry
from joshua.config.format_file import replace_file as replace_file
from joshua.tools.field_edits import EditError as EditError
from joshua.tools.field_edits import load_readable as load_readable
from joshua.tools.field_edits import edited_texts as edited_texts
from joshua.tools.field_edits import replace_texts as replace_texts
from joshua.tools.field_edits import show_change as show_change

# Checks of `joshua doctor`
from joshua.cli.doctor.result import DoctorResult as DoctorResult
from joshua.cli.doctor.result import Level as Level
from joshua.cli.doctor.host import Host as Host
from joshua.cli.doctor.host import may_open as may_open

SECTIONS: dict[str, dict[str, tuple[str, ...]]]
