"""The example plugin, built as a wheel and installed into a folder, through the real program."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from steady_machine import while_steady

EXAMPLE = Path(__file__).resolve().parents[2] / "docs/examples/acme-gripper"
PACKAGE = EXAMPLE / "src/acme_gripper"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that pip has installed the plugin into, without a network."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    command += ["--no-index", "--no-deps", "--no-build-isolation", "--target", str(folder), str(EXAMPLE)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)
    assert result.returncode == 0, result.stderr
    return folder


@pytest.fixture
def joshua(installed: Path, tmp_path: Path) -> Iterator[JoshuaProgram]:
    with reserved_domain() as domain_id:
        program = JoshuaProgram(tmp_path, domain_id, {"PYTHONPATH": str(installed)})
        yield program
        program.close()


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    path = tmp_path / "robot.pbtxt"
    path.write_bytes((EXAMPLE / "robot.pbtxt").read_bytes())
    return path


def python(installed: Path, code: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    command = [sys.executable, "-c", code]
    result = subprocess.run(command, capture_output=True, text=True, timeout=90, check=False, env=environment)
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_it_is_listed(joshua: JoshuaProgram) -> None:
    rows = {row["name"]: row for row in json.loads(joshua("plugins", "--json").stdout)}
    row = rows["acme-gripper"]
    assert (row["version"], row["status"], row["reasons"]) == ("1.0.0", "ok", [])
    assert [item["block"] for item in row["provides"]] == ["acme.GripperConfig"]
    checked = {row["name"]: row for row in json.loads(joshua("plugins", "--check", "--json").stdout)}
    assert checked["acme-gripper"]["reasons"] == []


def test_the_registry_finds_it_and_imports_no_driver(installed: Path) -> None:
    code = """
import sys
from joshua.plugins import ActuatorSpec, load_registry
registry = load_registry()
found = registry.find(ActuatorSpec, "acme.GripperConfig", "ACTION_PLUGIN")
is_known = "acme.GripperConfig" in registry.message_types()
print(found.implementation, registry.owner(found).distribution, is_known)
print([name for name in ("numpy", "acme_gripper.actuator", "acme_gripper.settings") if name in sys.modules])
import acme_gripper
print(acme_gripper.__file__)
"""
    lines = python(installed, code).splitlines()
    assert lines[0] == "acme_gripper.actuator:Gripper acme-gripper True"
    assert lines[1] == "[]"
    assert Path(lines[2]).is_relative_to(installed)


def test_it_conforms_to_the_contract_of_actuators(installed: Path) -> None:
    code = """
from acme_gripper.actuator import Gripper
from acme_gripper.settings import GripperSettings
from joshua.testing import check_actuator
check_actuator(lambda: Gripper(GripperSettings(stroke_m=0.08, finger_length_m=0.1, speed_rad_s=2.0)))
"""
    python(installed, code)


@pytest.mark.timing
def test_its_robot_is_valid_and_passes_its_test(joshua: JoshuaProgram, robot: Path) -> None:
    valid = joshua("--config", str(robot), "--validate-only")
    assert valid.returncode == 0, valid.stderr
    result = while_steady(lambda: joshua("--config", str(robot)), lambda done: done.returncode == 0)
    said = result.stdout + result.stderr
    assert result.returncode == 0, said
    assert "follows /hand: joint_1 → gripper" in said
    rows = [line.split() for line in said.splitlines() if line.startswith("PASS")]
    assert ["PASS", "/gripper", "tracking", "error"] in [row[:4] for row in rows]
    assert "FAIL" not in said


VERB = """
from dataclasses import dataclass
from typing import Literal

from joshua.api import RefusedError, verb


@dataclass(frozen=True)
class Asked:
    unit: Literal["m", "mm"] = "m"


@dataclass(frozen=True)
class Width:
    value: float
    unit: str


class Gripper(Gripper):
    @verb(moves=False)
    def width(self, asked: Asked) -> Width:
        \"\"\"Says how far the fingers are apart.\"\"\"
        if not self.connected:
            raise RefusedError("the gripper is not connected")
        width_m = self.settings.stroke_m * self._position / float(self.limits.position_max_rad[0])
        return Width(width_m * (1000 if asked.unit == "mm" else 1), asked.unit)
"""


def test_a_verb_needs_nothing_but_the_drivers_own_file(
    joshua: JoshuaProgram, robot: Path, installed: Path, tmp_path: Path
) -> None:
    shutil.copytree(installed, tmp_path / "site")
    with (tmp_path / "site/acme_gripper/actuator.py").open("a", encoding="utf-8") as driver:
        driver.write(VERB)
    joshua.environment["PYTHONPATH"] = str(tmp_path / "site")
    text = robot.read_text(encoding="utf-8").replace("duration_s: 3.0", "duration_s: 120")
    robot.write_text(text, encoding="utf-8")
    run = joshua.start("--config", str(robot))
    assert run.stdout is not None
    assert any(" ready after " in line for line in run.stdout)
    listed = joshua("call", "gripper")
    assert '  width [unit:m|mm="m"]  Says how far the fingers are apart.\n' in listed.stdout, listed.stderr
    said = joshua("call", "gripper", "width", "unit=mm", "--format", "json")
    assert said.returncode == 0, said.stderr
    reply = json.loads(said.stdout)
    assert 0 <= reply["value"] <= 80
    assert reply["unit"] == "mm"
    wrong = joshua("call", "gripper", "width", "unit=inch")
    assert (wrong.returncode, wrong.stderr) == (
        2,
        "joshua call: /gripper: width: unit: Input should be 'm' or 'mm'\n",
    )
    joshua.stop(run)


@pytest.mark.parametrize(
    ("line", "message", "allowed"),
    [
        ("stroke_m: 0.9", "stroke_m must be above 0, at most 0.5 m", "above 0, at most 0.5 m"),
        ("stroke_m: 0.4", "The fingers are too short to open that wide", "at most 0.2"),
        ("strok_m: 0.4", "GripperConfig has no field strok_m", "stroke_m"),
    ],
)
def test_its_block_is_checked_like_a_built_in_one(
    joshua: JoshuaProgram, robot: Path, line: str, message: str, allowed: str
) -> None:
    text = robot.read_text(encoding="utf-8")
    robot.write_text(text.replace("stroke_m: 0.08", line), encoding="utf-8")
    number = next(i for i, content in enumerate(robot.read_text().splitlines(), 1) if line in content)
    result = joshua("--config", str(robot), "--validate-only", "--format", "json")
    assert result.returncode == 2, result.stdout
    items = [item for item in json.loads(result.stdout) if message in item["message"]]
    assert len(items) == 1, result.stdout
    assert items[0]["field_path"].startswith("robot.actions[1].plugin_config.")
    assert items[0]["line"] == number
    assert items[0]["allowed"][0] == allowed


def test_a_topic_that_it_cannot_serve_is_refused(joshua: JoshuaProgram, robot: Path) -> None:
    text = robot.read_text(encoding="utf-8")
    robot.write_text(text.replace("JOINT_STATE", "IMU").replace("IMU", "JOINT_STATE", 1), encoding="utf-8")
    result = joshua("--config", str(robot), "--validate-only", "--format", "json")
    (item,) = [item for item in json.loads(result.stdout) if item["message"].startswith("gripper (acme.")]
    assert item["code"] == "data-type-unfit"
    assert item["field_path"] == "robot.actions[1].node.publishers[0].data_type"
    assert (item["found"], item["allowed"]) == ("IMU", ["JOINT_STATE"])


def test_without_it_a_check_notes_what_is_missing_and_a_launch_is_refused(
    joshua: JoshuaProgram, robot: Path
) -> None:
    # another plugin of the same package would make the unknown type look misspelt
    block = ("--block-plugin", "acme-gripper", "--block-plugin", "acme-bench")
    check = joshua("--config", str(robot), "--validate-only", *block)
    assert check.returncode == 0, check.stderr
    launch = joshua("--config", str(robot), *block)
    assert launch.returncode == 3
    said = " ".join((launch.stdout + launch.stderr).split())
    assert "gripper: ACTION_FOLLOWER with acme.GripperConfig requires a plugin that provides it" in said
    assert "acme-gripper is blocked" in said


def test_it_is_short() -> None:
    own = [path for path in PACKAGE.glob("*.py") if not path.name.endswith("_pb2.py")]
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in own)
    assert len(own) == 4
    assert lines < 120
