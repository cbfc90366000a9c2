"""The serial example plugin: a sensor, an actuator with a safe stop and their emulators, as installed."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from steady_machine import while_steady

EXAMPLE = Path(__file__).resolve().parents[2] / "docs/examples/acme-bench"
PACKAGE = EXAMPLE / "src/acme_bench"


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


def python(installed: Path, code: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    command = [sys.executable, "-W", "error", "-c", code]
    result = subprocess.run(command, capture_output=True, text=True, timeout=200, env=environment)
    assert result.returncode == 0, result.stderr
    return result.stdout


CONFORMANCE = """
from pathlib import Path
from acme_bench import bench_pb2
from acme_bench.clamp import Clamp
from acme_bench.emulator import BenchEmulator
from acme_bench.range_finder import RangeFinder
from acme_bench.settings import ClampSettings, RangeSettings
from joshua.api.emulation import EmulatedDevice
from joshua.testing import check_actuator, check_sensor

emulators = []

def emulated(block):
    emulators.append(BenchEmulator(EmulatedDevice("bench", "", block, Path())))
    emulators[-1].start()
    return emulators[-1].endpoint

def clamp():
    return Clamp(ClampSettings(port=emulated(bench_pb2.ClampConfig()), opening_rad=1.5))

def finder():
    return RangeFinder(RangeSettings(port=emulated(bench_pb2.RangeConfig()), max_m=4))

def unplug(device):
    emulators[-1].close()

check_actuator(clamp, unplug=unplug, timeout_s=30)
check_sensor(finder, unplug=unplug, timeout_s=30)
for emulator in emulators:
    emulator.close()
"""


def test_both_devices_conform_with_an_emulator_of_the_factory_for_each(installed: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    command = [sys.executable, "-W", "error", "-c", CONFORMANCE]
    result = subprocess.run(
        command, capture_output=True, text=True, timeout=200, check=False, env=environment
    )
    assert result.returncode == 0, result.stderr


def test_the_safe_stop_is_light(installed: Path) -> None:
    heavy = "{'numpy', 'pydantic', 'google.protobuf'}"
    code = f"import sys, acme_bench.safe_stop; print({heavy} & set(sys.modules))"
    assert python(installed, code) == "set()\n"


@pytest.mark.timing
def test_its_robot_runs_on_emulators_and_passes(joshua: JoshuaProgram) -> None:
    robot = str(EXAMPLE / "robot.pbtxt")
    valid = joshua("--config", robot, "--validate-only")
    assert valid.returncode == 0, valid.stderr
    result = while_steady(lambda: joshua("--config", robot, "--emulate"), lambda done: done.returncode == 0)
    said = result.stdout + result.stderr
    assert result.returncode == 0, said
    assert "FAIL" not in said
    rows = [line.split() for line in said.splitlines() if line.startswith("PASS")]
    assert ["PASS", "/clamp", "tracking", "error"] in [row[:4] for row in rows]
    assert ["PASS", "/range", "readings", "plausible"] in [row[:4] for row in rows]
    assert "no safe stop" not in said
    refused = joshua("--config", robot, "--emulate", "--fault", "clamp:drop=0.1")
    assert refused.returncode == 2
    assert "this emulator has no faults" in " ".join(refused.stderr.split())
