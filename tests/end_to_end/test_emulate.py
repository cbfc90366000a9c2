"""Presets of real hardware with every device emulated."""

from __future__ import annotations

import os
import signal
import subprocess
import sysconfig
from pathlib import Path

import pytest

JOSHUA = Path(sysconfig.get_path("scripts")) / "joshua"
CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.fixture
def environment(tmp_path: Path, joshua_domain_id: int) -> dict[str, str]:
    runtime = tmp_path / "run"
    runtime.mkdir(mode=0o700)
    return {
        **os.environ,
        "ROS_DOMAIN_ID": str(joshua_domain_id),
        "XDG_RUNTIME_DIR": str(runtime),
        "XDG_STATE_HOME": str(tmp_path / "state"),
    }


def joshua(environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(JOSHUA), *arguments],
        capture_output=True,
        text=True,
        timeout=100,
        stdin=subprocess.DEVNULL,
        env=environment,
    )


def preset(name: str) -> str:
    return str(CONFIGS / f"{name}.pbtxt")


def test_arms_and_cameras_run_without_hardware(environment: dict[str, str]) -> None:
    result = joshua(
        environment, "--config", preset("teleop_so_arm100_camera"), "--emulate", "--duration", "2"
    )
    assert result.returncode == 0, result.stdout + result.stderr
    for name in ("leader_arm", "follower_arm", "camera_top", "camera_wrist"):
        assert f"emulated: {name} at " in result.stdout
    assert "all 5 nodes ready" in result.stdout
    assert "ended with 0" in result.stdout


def test_the_eeprom_of_an_emulated_arm_outlives_the_run(environment: dict[str, str]) -> None:
    result = joshua(environment, "--config", preset("teleop_so_arm100"), "--emulate", "--duration", "1")
    assert result.returncode == 0, result.stdout + result.stderr
    kept = sorted(Path(environment["XDG_STATE_HOME"]).rglob("eeprom.json"))
    assert [path.parent.name for path in kept] == ["follower_arm", "leader_arm"]


def test_a_device_without_an_emulator_is_never_opened(environment: dict[str, str]) -> None:
    result = joshua(
        environment, "--config", preset("teleop_so_arm100"), "--emulate", "--block-plugin", "joshua-emulator"
    )
    assert result.returncode == 3
    text = " ".join(result.stderr.split())
    assert "leader_arm, follower_arm: no plugin in use emulates sts3215_config" in text
    assert "nothing was started" in result.stderr


def test_a_fault_of_an_unknown_node_names_the_devices(environment: dict[str, str]) -> None:
    result = joshua(
        environment, "--config", preset("teleop_so_arm100"), "--emulate", "--fault", "arm:drop=0.01"
    )
    assert result.returncode == 2
    assert "leader_arm, follower_arm" in result.stderr


@pytest.mark.parametrize("fault", ["drop=0.01", "follower_arm", ":drop=0.01", "follower_arm:"])
def test_a_fault_needs_a_node(environment: dict[str, str], fault: str) -> None:
    result = joshua(environment, "--config", preset("teleop_so_arm100"), "--emulate", "--fault", fault)
    assert result.returncode == 2
    assert "expected NODE:FAULT, such as follower_arm:drop=0.01" in result.stderr


@pytest.mark.parametrize(
    ("fault", "problem"),
    [
        ("leader_arm:melt", "--fault leader_arm: unknown fault 'melt'; allowed: drop, "),
        ("follower_arm:unplug=3", "--fault follower_arm: unplug takes no value, found 3; "),
    ],
)
def test_a_fault_that_the_emulator_does_not_know_stops_the_start(
    environment: dict[str, str], fault: str, problem: str
) -> None:
    result = joshua(environment, "--config", preset("teleop_so_arm100"), "--emulate", "--fault", fault)
    assert result.returncode == 2
    assert problem in result.stderr
    assert "nothing was started" in result.stderr
    assert "torque" not in result.stdout + result.stderr


def test_an_arm_that_is_unplugged_is_named_and_the_leader_goes_on(environment: dict[str, str]) -> None:
    result = joshua(
        environment,
        *("--config", preset("teleop_so_arm100"), "--emulate", "--duration", "6"),
        *("--fault", "follower_arm:unplug,at_s=5"),
    )
    text = result.stdout + result.stderr
    # On a slow machine the adapter may vanish before the driver opens it.
    assert "the adapter is gone" in text or "no such serial port" in text, text
    assert "follower_arm" in text
    assert result.returncode in (1, 4), text
    if "all 2 nodes ready" in text:
        assert "/leader_arm    timer control" in text or "/leader_arm  timer control" in text, text


def test_the_emulators_run_alone_until_ctrl_c(environment: dict[str, str]) -> None:
    process = subprocess.Popen(
        [str(JOSHUA), "emulate", preset("teleop_so_arm100")],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment,
    )
    try:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(3)]
        ports = [line.split(" at ")[1].strip() for line in lines[:2]]
        assert all(Path(port).exists() for port in ports)
        assert lines[2] == "stop with Ctrl-C\n"
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=30) == 0
        assert not any(Path(port).exists() for port in ports)
    finally:
        process.kill()
        process.communicate()
