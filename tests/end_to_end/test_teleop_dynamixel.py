"""A Koch arm (Dynamixel) leads an SO-ARM100 (STS3215), and follows it: the documented file, emulated arms."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sysconfig
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from emulated_teleop import teleoperation
from joshua_emulator import EmulatedBus

JOSHUA = Path(sysconfig.get_path("scripts")) / "joshua"
EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "koch_leads_so_arm100.pbtxt"
BLOCKS = ("dynamixel_config", "sts3215_config")


def exchanged(text: str) -> str:
    """The file with the blocks of both arms in each other's place."""
    koch, so_arm = (
        re.search(rf"^    {name} \{{\n.*?^    \}}\n", text, re.MULTILINE | re.DOTALL) for name in BLOCKS
    )
    assert koch is not None
    assert so_arm is not None
    return (
        text[: koch.start()]
        + so_arm[0].replace("ACM1", "ACM0").replace("      velocity: 1000\n      acceleration: 200\n", "")
        + text[koch.end() : so_arm.start()]
        + koch[0].replace("ACM0", "ACM1")
        + text[so_arm.end() :]
    )


def wait(condition: Callable[[], bool], process: subprocess.Popen[str], timeout_s: float = 60.0) -> None:
    """Waits until something holds; says what the program printed where it does not come to that."""
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        if process.poll() is not None or time.monotonic() > deadline_s:
            process.kill()
            pytest.fail(f"exit code {process.poll()}; output:\n{process.communicate()[0]}")
        time.sleep(0.05)


def energised(arm: EmulatedBus) -> set[bool]:
    return {servo["energised"] for servo in arm.servos()}


def fractions(arm: EmulatedBus) -> list[float]:
    """Where each joint stands in its calibrated range, from 0 to 1."""
    return [
        (servo["present_position"] - motor["range_min"]) / (motor["range_max"] - motor["range_min"])
        for servo, motor in zip(arm.servos(), arm.calibration()["motors"], strict=True)
    ]


@pytest.mark.timing
@pytest.mark.parametrize("direction", ["koch leads", "koch follows"])
def test_each_arm_follows_the_other_in_its_own_range(
    direction: str, tmp_path: Path, joshua_domain_id: int
) -> None:
    with (
        EmulatedBus("dynamixel", arm="koch", calibrated=True, identity="KOCH1") as koch,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="ARM1") as so_arm,
    ):
        text, leader, follower, blocks = EXAMPLE.read_text(), koch, so_arm, BLOCKS
        if direction == "koch follows":
            text, leader, follower, blocks = exchanged(text), so_arm, koch, BLOCKS[::-1]
        ranges = leader.calibration()["motors"]
        with teleoperation(leader, follower, tmp_path, joshua_domain_id, text=text, blocks=blocks) as process:
            wait(lambda: energised(follower) == {True}, process)
            assert energised(leader) == {False}
            for share in (0.65, 0.4):
                pose = {m["id"]: m["range_min"] + share * (m["range_max"] - m["range_min"]) for m in ranges}
                leader.hand(pose, duration_s=0.5)
                wait(
                    lambda share=share: all(  # type: ignore[misc]
                        abs(found - share) < 0.01 for found in fractions(follower)
                    ),
                    process,
                )
                assert fractions(leader) == pytest.approx([share] * 6, abs=0.002)
            process.send_signal(signal.SIGINT)
            output, _ = process.communicate(timeout=60)
            assert process.returncode == 0, output
        assert energised(follower) == {True}  # held, so that the arm does not fall
        assert energised(leader) == {False}


def test_the_documented_file_runs_with_emulated_arms(tmp_path: Path, joshua_domain_id: int) -> None:
    """Then with the arms exchanged: what the emulated servos of one family remember is not the other's."""
    runtime = tmp_path / "run"
    runtime.mkdir(mode=0o700)
    other = tmp_path / "exchanged.pbtxt"
    other.write_text(exchanged(EXAMPLE.read_text()))
    for config in (EXAMPLE, other):
        result = subprocess.run(
            [str(JOSHUA), "--config", str(config), "--emulate", "--duration", "1"],
            capture_output=True,
            text=True,
            timeout=100,
            stdin=subprocess.DEVNULL,
            env={
                **os.environ,
                "ROS_DOMAIN_ID": str(joshua_domain_id),
                "XDG_RUNTIME_DIR": str(runtime),
                "XDG_STATE_HOME": str(tmp_path / "state"),
            },
        )
        assert result.returncode == 0, result.stdout + result.stderr
        for name in ("leader_arm", "follower_arm"):
            assert f"emulated: {name} at " in result.stdout
        assert "all 2 nodes ready" in result.stdout


def test_an_arm_whose_driver_is_killed_is_released_by_its_guardian(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with (
        EmulatedBus("dynamixel", arm="koch", calibrated=True, identity="KOCH1") as koch,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="ARM1") as so_arm,
        teleoperation(
            so_arm, koch, tmp_path, joshua_domain_id,
            text=exchanged(EXAMPLE.read_text()), blocks=BLOCKS[::-1],
            overrides=("robot.actions[1].safe_state=RELEASE",),
        ) as process,
    ):  # fmt: skip
        wait(lambda: energised(koch) == {True}, process)
        assert process.stdout is not None
        line = ""
        while not line.startswith("/follower_arm "):
            line = process.stdout.readline()
        os.kill(int(line.split()[1]), signal.SIGKILL)
        wait(lambda: energised(koch) == {False}, process)


def test_an_overloaded_servo_is_rebooted_when_a_person_resumes_the_arm(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    with (
        EmulatedBus("dynamixel", arm="koch", calibrated=True, identity="KOCH1") as koch,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="ARM1") as so_arm,
        teleoperation(
            so_arm, koch, tmp_path, joshua_domain_id,
            text=exchanged(EXAMPLE.read_text()), blocks=BLOCKS[::-1],
        ) as process,
    ):  # fmt: skip
        wait(lambda: energised(koch) == {True}, process)
        koch.fault("overload", 3)
        wait(lambda: energised(koch) == {False}, process)
        assert koch.servo(3)["hardware_error"] != 0
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(joshua_domain_id),
            "XDG_RUNTIME_DIR": str(tmp_path / "run"),
        }
        result = subprocess.run(
            [str(JOSHUA), "resume", "follower_arm"],
            capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL, env=environment,
        )  # fmt: skip
        assert result.returncode == 0, result.stdout + result.stderr
        wait(lambda: energised(koch) == {True}, process)
        assert [entry["id"] for entry in koch.log("reboot")] == [3]
        assert koch.servo(3)["hardware_error"] == 0
        stopped = subprocess.run(
            [str(JOSHUA), "estop"],
            capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL, env=environment,
        )  # fmt: skip
        assert stopped.returncode == 0, stopped.stdout + stopped.stderr
        assert energised(koch) == {False}
        assert "read back from 6 joints" in stopped.stdout
