from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest
from joshua.plugins import PluginRow, PluginStatus, ProvisionKind, load_registry

LIDAR = """
@hookimpl
def joshua_provisions():
    return [Provision(kind=ProvisionKind.SENSOR, block="lidar_config", enum_values=("PERCEPTION_LIDAR",),
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
    assert {p.block for p in row.provisions} == {
        "mock_motor_config",
        "mock_camera_config",
        "mock_encoder_config",
        "mock_lidar_config",
        "random_noise_config",
    }


def test_an_installed_plugin_is_found_by_block_and_enum_value(plugin_folder: Any) -> None:
    plugin_folder.add("acme-lidar", LIDAR, version="2.5")
    registry = load_registry(blocked=OURS)
    found = registry.find(ProvisionKind.SENSOR, "lidar_config", "PERCEPTION_LIDAR")
    assert found is not None
    assert found.implementation == "acme_lidar.driver:Lidar"
    assert registry.owner(found).version == "2.5"
    assert registry.find(ProvisionKind.SENSOR, "lidar_config") is found
    assert registry.find(ProvisionKind.SENSOR, "lidar_config", "PERCEPTION_CAMERA") is None
    assert registry.find(ProvisionKind.ACTUATOR, "lidar_config", "PERCEPTION_LIDAR") is None


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
        ("def joshua_provisions(): return []", "declares no hook: mark the function joshua_provisions"),
        (
            "@hookimpl\ndef joshua_provision(): return []",
            "joshua_provision is no hook of this version of JOSHUA; allowed: joshua_provisions",
        ),
        (
            "@hookimpl\ndef joshua_provisions(robot): return []",
            "hookimpl definition: joshua_provisions(robot)",
        ),
        ("@hookimpl\ndef joshua_provisions(): 1 / 0", "joshua_provisions failed: ZeroDivisionError"),
        (
            "@hookimpl\ndef joshua_provisions():\n    yield 3\n    raise KeyError('x')",
            "failed: KeyError: 'x'",
        ),
        (
            "@hookimpl\ndef joshua_provisions(): return None",
            "returned NoneType, not an iterable of Provision",
        ),
        ("@hookimpl\ndef joshua_provisions(): return [{}]", "item 0 is dict, not joshua.plugins.Provision"),
        ("@hookimpl(wrapper=True)\ndef joshua_provisions(): return (yield)", "is a hook wrapper"),
    ],
)
def test_a_broken_plugin_is_a_row_with_its_reason(plugin_folder: Any, source: str, reason: str) -> None:
    plugin_folder.add("acme-broken", source)
    plugin_folder.add("acme-lidar", LIDAR)
    row = row_of("acme-broken")
    assert row.status is PluginStatus.BROKEN
    assert any(reason in text for text in row.reasons), row.reasons
    assert row.provisions == ()
    assert row_of("acme-lidar").status is PluginStatus.OK


def provision_source(arguments: str) -> str:
    return f"@hookimpl\ndef joshua_provisions(): return [Provision({arguments})]"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (
            "ProvisionKind.SENSOR, 'lidar_config', 'a.b:C', enum_values=('PERCEPTION_LIDER',)",
            "enum value 'PERCEPTION_LIDER' is unknown for sensor; allowed: PERCEPTION_LIDAR, ",
        ),
        (
            "ProvisionKind.SENSOR, 'lidar_config', 'a.b:C', enum_values=('PERCEPTION_UNSPECIFIED',)",
            "enum value 'PERCEPTION_UNSPECIFIED' is unknown",
        ),
        (
            "ProvisionKind.SENSOR, 'sts3215_config', 'a.b:C'",
            "block 'sts3215_config' is no block of sensor; allowed: ",
        ),
        ("ProvisionKind.SENSOR, 'lidar_confg', 'a.b:C'", "allowed: lidar_config, "),
        ("ProvisionKind.SENSOR, '', 'a.b:C'", "neither block nor enum_values says what asks for it"),
        ("ProvisionKind.SENSOR, 'lidar_config', 'a.b.C'", "implementation is 'a.b.C', not an import string"),
        ("ProvisionKind.SENSOR, 'lidar_config', 'a:B', settings='x y'", "settings is 'x y', not an import"),
        (
            "ProvisionKind.SENSOR, 'lidar_config', 'a:B', data_types=('sensor_msgs/LaserScan',)",
            "data type 'sensor_msgs/LaserScan' is unknown; allowed: sensor_msgs/msg/LaserScan, ",
        ),
        (
            "ProvisionKind.ENVIRONMENT, 'training', 'a:make'",
            "environments belong to a provision of kind ENVIRONMENT, which has at least one",
        ),
        (
            "ProvisionKind.ENVIRONMENT, 'training', 'a:make', environments=('acme/Reach-v0',)",
            "environments is not a tuple of joshua.plugins.Environment",
        ),
        (
            "ProvisionKind.ENVIRONMENT, 'training', 'a:make', environments=(Environment('a/Reach-v0', ()),)",
            "environment 'a/Reach-v0' offers no reward",
        ),
        (
            "ProvisionKind.SENSOR, 'lidar_config', 'a:B', data_types='sensor_msgs/msg/LaserScan'",
            "data_types is str, not a tuple of ROS 2 types",
        ),
        ("'sensor', 'lidar_config', 'a:B'", "kind is 'sensor', not a joshua.plugins.ProvisionKind"),
        (
            "ProvisionKind.SENSOR, 'lidar_config', 'a:B', enum_values='PERCEPTION_LIDAR'",
            "enum_values is str, not a tuple",
        ),
        (
            "ProvisionKind.ACTUATOR, 'sts3215_config', 'a:B', enum_values=('ACTION_MOCK',)",
            "ACTION_MOCK fits only mock_motor_config",
        ),
        (
            "ProvisionKind.ACTUATOR, 'sts3215_config', 'a:B', enum_values=('ACTION_PLUGIN',)",
            "ACTION_PLUGIN fits only a message of the plugin's own",
        ),
        ("ProvisionKind.ACTUATOR, 'acme.Nothing', 'a:B'", "block acme.Nothing needs message_module"),
        (
            "ProvisionKind.ACTUATOR, 'acme.Nothing', 'a:B', message_module='acme_no_such_pb2'",
            "message_module acme_no_such_pb2 fails at import: ModuleNotFoundError",
        ),
        (
            "ProvisionKind.ACTUATOR, 'acme.Nothing', 'a:B', message_module='joshua.schema.comm_pb2'",
            "message_module joshua.schema.comm_pb2 does not register the message acme.Nothing",
        ),
    ],
)
def test_each_declaration_is_verified(plugin_folder: Any, arguments: str, reason: str) -> None:
    plugin_folder.add("acme-broken", provision_source(arguments))
    row = row_of("acme-broken")
    assert row.status is PluginStatus.BROKEN
    assert any(reason in text for text in row.reasons), row.reasons


def test_all_faults_of_a_plugin_are_reported_together(plugin_folder: Any) -> None:
    plugin_folder.add(
        "acme-broken", provision_source("ProvisionKind.SENSOR, 'x', 'nowhere', enum_values=('Y', 'Z')")
    )
    assert len(row_of("acme-broken").reasons) == 4


def test_a_message_of_the_plugins_own_is_a_block(plugin_folder: Any) -> None:
    plugin_folder.add(
        "acme-arm",
        provision_source(
            "ProvisionKind.ACTUATOR, 'joshua.Serial', 'a:B', enum_values=('ACTION_PLUGIN',), "
            "message_module='joshua.schema.comm_pb2'"
        ),
    )
    registry = load_registry()
    assert registry.find(ProvisionKind.ACTUATOR, "joshua.Serial", "ACTION_PLUGIN") is not None
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
