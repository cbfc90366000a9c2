from __future__ import annotations

import subprocess
import sys
import textwrap
from typing import Any

import pytest
from joshua.plugins import (
    ActuatorSpec,
    PluginRow,
    PluginStatus,
    SensorSpec,
    load_registry,
)

LIDAR = """
@hookimpl
def joshua_specs():
    return [SensorSpec(block="lidar_config", enum_values=("PERCEPTION_LIDAR",),
                       implementation="acme_lidar.driver:Lidar", summary="a scanner")]
"""


# Provides the same block; the plugins of these tests stand in its place.
OURS = ("joshua-lidar",)


def row_of(distribution: str, blocked: tuple[str, ...] = ()) -> PluginRow:
    rows = [
        row for row in load_registry(blocked=(*OURS, *blocked)).rows() if row.distribution == distribution
    ]
    assert len(rows) == 1
    return rows[0]


def test_the_core_is_a_plugin_like_any_other() -> None:
    row = row_of("joshua-core")
    assert row.status is PluginStatus.OK
    assert row.name == "core"
    assert row.version
    assert {p.block for p in row.specs} == {
        "",  # Zenoh, which an enum value names
    }


def test_an_installed_plugin_is_found_by_block_and_enum_value(plugin_folder: Any) -> None:
    plugin_folder.add("acme-lidar", LIDAR, version="2.5")
    registry = load_registry(blocked=OURS)
    found = registry.find(SensorSpec, "lidar_config", "PERCEPTION_LIDAR")
    assert found is not None
    assert found.implementation == "acme_lidar.driver:Lidar"
    assert registry.owner(found).version == "2.5"
    assert registry.find(SensorSpec, "lidar_config") is found
    assert registry.find(SensorSpec, "lidar_config", "PERCEPTION_CAMERA") is None
    assert registry.find(ActuatorSpec, "lidar_config", "PERCEPTION_LIDAR") is None


@pytest.mark.parametrize("name", ["acme-lidar", "Acme_Lidar", "main"])
def test_a_blocked_plugin_is_not_imported(plugin_folder: Any, name: str) -> None:
    module = plugin_folder.add("acme-lidar", LIDAR)
    row = row_of("acme-lidar", blocked=(name,))
    assert row.status is PluginStatus.BLOCKED
    assert row.reasons == ("blocked on request; its module was not imported",)
    assert module not in sys.modules


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("import no_such_module_at_all", "cannot be imported: ModuleNotFoundError: No module named"),
        ("raise SystemExit('bye')", "cannot be imported: SystemExit: bye"),
        ("def joshua_specs(): return []", "declares no hook. Mark the function joshua_specs"),
        (
            "@hookimpl\ndef joshua_spec(): return []",
            "joshua_spec is not a hook of this version of JOSHUA; allowed: joshua_specs",
        ),
        (
            "@hookimpl\ndef joshua_specs(robot): return []",
            "hookimpl definition: joshua_specs(robot)",
        ),
        ("@hookimpl\ndef joshua_specs(): 1 / 0", "joshua_specs failed: ZeroDivisionError"),
        (
            "@hookimpl\ndef joshua_specs():\n    yield 3\n    raise KeyError('x')",
            "failed: KeyError: 'x'",
        ),
        (
            "@hookimpl\ndef joshua_specs(): return None",
            "returned NoneType, not an iterable of specs",
        ),
        (
            "@hookimpl\ndef joshua_specs(): return [{}]",
            "item 0 is dict, which is not a spec of joshua.api",
        ),
        ("@hookimpl(wrapper=True)\ndef joshua_specs(): return (yield)", "is a hook wrapper"),
    ],
)
def test_a_broken_plugin_is_a_row_with_its_reason(plugin_folder: Any, source: str, reason: str) -> None:
    plugin_folder.add("acme-broken", source)
    plugin_folder.add("acme-lidar", LIDAR)
    row = row_of("acme-broken")
    assert row.status is PluginStatus.BROKEN
    assert any(reason in text for text in row.reasons), row.reasons
    assert row.specs == ()
    assert row_of("acme-lidar").status is PluginStatus.OK


def spec_source(arguments: str) -> str:
    return textwrap.dedent(
        f"""
        def made(kind, block, implementation, **more):
            return kind(block=block, implementation=implementation, **more)

        @hookimpl
        def joshua_specs(): return [made({arguments})]
        """
    )


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (
            "SensorSpec, 'lidar_config', 'a.b:C', enum_values=('PERCEPTION_LIDER',)",
            "enum value 'PERCEPTION_LIDER' is unknown for sensor; allowed: PERCEPTION_LIDAR, ",
        ),
        (
            "SensorSpec, 'lidar_config', 'a.b:C', enum_values=('PERCEPTION_UNSPECIFIED',)",
            "enum value 'PERCEPTION_UNSPECIFIED' is unknown",
        ),
        (
            "SensorSpec, 'sts3215_config', 'a.b:C'",
            "block 'sts3215_config' is not a block of sensor; allowed: ",
        ),
        ("SensorSpec, 'lidar_confg', 'a.b:C'", "allowed: lidar_config, "),
        (
            "SensorSpec, '', 'a.b:C'",
            "neither block nor enum_values says what asks for it",
        ),
        (
            "SensorSpec, 'lidar_config', 'a.b.C'",
            "implementation is 'a.b.C', not an import string",
        ),
        (
            "SensorSpec, 'lidar_config', 'a:B', settings='x y'",
            "settings is 'x y', not an import",
        ),
        (
            "SensorSpec, 'lidar_config', 'a:B', data_types=('sensor_msgs/LaserScan',)",
            "data type 'sensor_msgs/LaserScan' is unknown; allowed: sensor_msgs/msg/LaserScan, ",
        ),
        (
            "EnvironmentSpec, 'training', 'a:make'",
            "environments is empty, and it needs at least one joshua.api.simulation.Environment",
        ),
        (
            "EnvironmentSpec, 'training', 'a:make', environments=('acme/Reach-v0',)",
            "environments is not a tuple of joshua.api.simulation.Environment",
        ),
        (
            "EnvironmentSpec, 'training', 'a:make', environments=(Environment('a/Reach-v0', ()),)",
            "environment 'a/Reach-v0' offers no reward",
        ),
        (
            "SensorSpec, 'lidar_config', 'a:B', data_types='sensor_msgs/msg/LaserScan'",
            "data_types is str, not a tuple of ROS 2 types",
        ),
        ("SensorSpec, 'lidar_config', 'a:B', safe_stop='a:b'", "argument 'safe_stop'"),
        ("PluginSpec, 'lidar_config', 'a:B'", "which is not a spec of joshua.api; "),
        (
            "SensorSpec, 'lidar_config', 'a:B', enum_values='PERCEPTION_LIDAR'",
            "enum_values is str, not a tuple",
        ),
        (
            "ActuatorSpec, 'sts3215_config', 'a:B', enum_values=('ACTION_MOCK',)",
            "ACTION_MOCK fits only mock_motor_config",
        ),
        (
            "ActuatorSpec, 'sts3215_config', 'a:B', enum_values=('ACTION_PLUGIN',)",
            "ACTION_PLUGIN fits only a message of the plugin's own",
        ),
        (
            "ActuatorSpec, 'acme.Nothing', 'a:B'",
            "block acme.Nothing needs message_module",
        ),
        (
            "ActuatorSpec, 'acme.Nothing', 'a:B', message_module='acme_no_such_pb2'",
            "message_module acme_no_such_pb2 fails at import: ModuleNotFoundError",
        ),
        (
            "ActuatorSpec, 'acme.Nothing', 'a:B', message_module='joshua.schema.comm_pb2'",
            "message_module joshua.schema.comm_pb2 does not register the message acme.Nothing",
        ),
    ],
)
def test_each_declaration_is_verified(plugin_folder: Any, arguments: str, reason: str) -> None:
    plugin_folder.add("acme-broken", spec_source(arguments))
    row = row_of("acme-broken")
    assert row.status is PluginStatus.BROKEN
    assert any(reason in text for text in row.reasons), row.reasons


@pytest.mark.parametrize(
    ("source", "what"),
    [
        ("from joshua.plugins import Provision, ProvisionKind", "imports Provision"),
        ("from joshua.plugins.provision import ProvisionKind", "imports Provision"),
        ("@hookimpl\ndef joshua_provisions(): return []", "implements the hook joshua_provisions"),
        (
            "class Provision: pass\n@hookimpl\ndef joshua_specs(): return [Provision()]",
            "returns Provision objects",
        ),
    ],
)
def test_a_plugin_of_the_contract_before_the_specs_is_one_row_that_says_what_changed(
    plugin_folder: Any, source: str, what: str
) -> None:
    plugin_folder.add("acme-old", source)
    row = row_of("acme-old")
    assert row.status is PluginStatus.BROKEN
    assert row.reasons == (
        f"was written for an earlier version of JOSHUA: it {what}. A plugin declares each thing that it "
        "provides as ActuatorSpec, SensorSpec or the like of joshua.api, in the hook joshua_specs. "
        "Upgrade acme-old, or change it as docs/guides/plugins.md shows.",
    )


def test_all_faults_of_a_plugin_are_reported_together(plugin_folder: Any) -> None:
    plugin_folder.add("acme-broken", spec_source("SensorSpec, 'x', 'nowhere', enum_values=('Y', 'Z')"))
    assert len(row_of("acme-broken").reasons) == 4


def test_a_message_of_the_plugins_own_is_a_block(plugin_folder: Any) -> None:
    plugin_folder.add(
        "acme-arm",
        spec_source(
            "ActuatorSpec, 'joshua.Serial', 'a:B', enum_values=('ACTION_PLUGIN',), "
            "message_module='joshua.schema.comm_pb2'"
        ),
    )
    registry = load_registry()
    assert registry.find(ActuatorSpec, "joshua.Serial", "ACTION_PLUGIN") is not None
    assert "joshua.schema.comm_pb2" in registry.message_modules()
    assert "joshua.Serial" in registry.message_types()


def test_loading_imports_neither_numpy_nor_pydantic_nor_a_driver() -> None:
    code = (
        "import sys; from joshua.plugins import load_registry; load_registry(); "
        "heavy = {'numpy', 'pydantic', 'zenoh', 'rosbags', 'rich', 'joshua.devices'}; "
        "sys.exit(', '.join(sorted(heavy & set(sys.modules))) or 0)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert result.returncode == 0, result.stderr
