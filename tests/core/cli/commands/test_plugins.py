"""The command ``joshua plugins``: the list, its reasons, and that it imports no driver."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from joshua.cli.commands import plugins


def run(*arguments: str) -> int:
    parser = argparse.ArgumentParser()
    plugins.add_arguments(parser)
    return plugins.run(parser.parse_args(arguments))


def install(folder: Path, distribution: str, source: str) -> None:
    module = distribution.replace("-", "_") + "_plugin"
    header = "from joshua.plugins import SensorSpec, hookimpl\n"
    (folder / f"{module}.py").write_text(header + source, encoding="utf-8")
    info = folder / f"{module}-1.5.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.5\n", encoding="utf-8"
    )
    (info / "entry_points.txt").write_text(f"[joshua.plugins]\nmain = {module}\n", encoding="utf-8")


LIDAR = """
@hookimpl
def joshua_specs():
    return [SensorSpec(block="lidar_config", implementation="IMPLEMENTATION",
                       enum_values=("PERCEPTION_LIDAR",), summary="a scanner")]
"""


def joshua(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "200"}
    return subprocess.run(
        [sys.executable, "-m", "joshua.cli.main", *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=environment,
    )


def test_the_core_is_listed_with_what_it_provides(capsys: pytest.CaptureFixture[str]) -> None:
    assert run() == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["NAME", "VERSION", "STATUS", "PROVIDES"]
    assert any(line.startswith("joshua-core") and " ok " in line for line in lines)
    assert any(
        line.strip() == "sensor mock_lidar_config: laser scanner in a rectangular room" for line in lines
    )
    assert any(
        line.strip() == "for ACTION_LEADER, ACTION_FOLLOWER, ACTION_SINGLE, ACTION_MOCK" for line in lines
    )


def test_the_list_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--json") == 0
    mock = next(row for row in json.loads(capsys.readouterr().out) if row["name"] == "joshua-mock")
    assert mock["status"] == "ok"
    camera = next(item for item in mock["provides"] if item["block"] == "mock_camera_config")
    assert camera["kind"] == "sensor"
    assert camera["enum_values"] == ["PERCEPTION_CAMERA"]
    assert camera["data_types"][0] == "sensor_msgs/msg/Image"


def test_a_blocked_plugin_is_a_row_without_specs(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--block-plugin", "joshua-core") == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("joshua-core"))
    assert line.endswith("blocked  ! blocked on request; its module was not imported")


def test_what_the_core_names_passes_the_deep_check(capsys: pytest.CaptureFixture[str]) -> None:
    run("--check", "--json")
    core = next(row for row in json.loads(capsys.readouterr().out) if row["name"] == "joshua-core")
    assert core["status"] == "ok"
    assert core["reasons"] == []


def test_the_real_program_lists_third_parties_without_importing_their_drivers(tmp_path: Path) -> None:
    (tmp_path / "acme_driver.py").write_text(
        "raise RuntimeError('the driver was imported')", encoding="utf-8"
    )
    install(tmp_path, "acme-lidar", LIDAR.replace("IMPLEMENTATION", "acme_driver:Lidar"))
    install(tmp_path, "acme-broken", "import acme_does_not_exist\n")
    result = joshua(tmp_path, "plugins", "--block-plugin", "joshua-lidar")
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    row = next(line for line in lines if line.startswith("acme-lidar"))
    assert row.split()[1:] == ["1.5", "ok", "sensor", "lidar_config:", "a", "scanner"]
    broken = next(line for line in lines if line.startswith("acme-broken"))
    assert "broken" in broken
    assert "! acme_broken_plugin cannot be imported: ModuleNotFoundError" in broken

    checked = joshua(tmp_path, "plugins", "--check", "--block-plugin", "joshua-lidar")
    assert checked.returncode == 1
    assert "lidar_config: implementation: acme_driver:Lidar cannot be imported" in checked.stdout
    assert "the driver was imported" in checked.stdout
    assert checked.stdout.splitlines()[-1].endswith("plugins checked: problems in acme-broken, acme-lidar")

    blocked = joshua(tmp_path, "--block-plugin", "acme-lidar", "plugins", "--json")
    status = {row["name"]: row["status"] for row in json.loads(blocked.stdout)}
    assert status["acme-lidar"] == "blocked"


def test_a_conflict_names_both(tmp_path: Path) -> None:
    for name in ("acme-one", "acme-two"):
        install(tmp_path, name, LIDAR.replace("IMPLEMENTATION", "a:B"))
    result = joshua(tmp_path, "plugins", "--block-plugin", "joshua-lidar")
    text = "! acme-one and acme-two both provide PERCEPTION_LIDAR with lidar_config; neither is used for it"
    assert result.stdout.count(text) == 2


def test_a_plugin_cannot_steer_the_terminal(tmp_path: Path) -> None:
    install(tmp_path, "acme-evil", "raise RuntimeError('\\x1b[2J gone')\n")
    result = joshua(tmp_path, "plugins")
    assert "\\x1b[2J gone" in result.stdout
    assert "\x1b" not in result.stdout


def test_the_list_imports_neither_drivers_nor_numpy() -> None:
    code = (
        "import sys; from joshua.cli.main import main; main(['plugins']); "
        "heavy = {'numpy', 'cv2', 'torch', 'zenoh', 'joshua.devices.actuator'}; "
        "sys.exit(', '.join(sorted(heavy & set(sys.modules))) or 0)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert result.returncode == 0, result.stderr


def test_the_check_imports_commands_too(tmp_path: Path) -> None:
    install(tmp_path, "acme-tool", "@hookimpl\ndef joshua_specs():\n    return []\n")
    entry_points = tmp_path / "acme_tool_plugin-1.5.dist-info/entry_points.txt"
    entry_points.write_text(entry_points.read_text() + "[joshua.commands]\nacme = acme_no_such_module\n")
    result = joshua(tmp_path, "plugins", "--check")
    assert result.returncode == 1
    assert "! the command acme of acme-tool cannot be loaded (ModuleNotFoundError" in result.stdout
    assert result.stdout.splitlines()[-1].endswith("plugins checked: problems in acme-tool")
