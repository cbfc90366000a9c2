"""The example of the guide on emulated encoders: a test run that passes, and ones that do not."""

from __future__ import annotations

import os
import re
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from emulators_of_runs import bring_about
from steady_machine import while_steady
from watched import Watched, watched_run

JOSHUA = Path(sysconfig.get_path("scripts")) / "joshua"
# Rates that a busy machine holds too.
SLOW = (
    "--set",
    "robot.perceptions[0].node.publishers[0].publish_rate_hz=10",
    "--set",
    "robot.perceptions[1].node.publishers[0].publish_rate_hz=20",
)
EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "wheel_encoders.pbtxt"


@contextmanager
def start(folder: Path, domain_id: int, *arguments: str) -> Iterator[Watched]:
    runtime = folder / "run"
    runtime.mkdir(mode=0o700, exist_ok=True)
    environment = os.environ | {
        "ROS_DOMAIN_ID": str(domain_id),
        "XDG_RUNTIME_DIR": str(runtime),
        "XDG_STATE_HOME": str(folder / "state"),
        "JOSHUA_LOG_DIR": str(folder / "log"),
    }
    command = [str(JOSHUA), "--config", str(EXAMPLE), "--emulate", *SLOW, *arguments]
    with watched_run(command, environment) as watched:
        yield watched


def run(folder: Path, domain_id: int, *arguments: str) -> tuple[int, str]:
    with start(folder, domain_id, *arguments) as watched:
        return watched.end(100.0)


@pytest.mark.timing
def test_good_encoders_pass(tmp_path: Path, joshua_domain_id: int) -> None:
    code, text = while_steady(
        lambda: run(tmp_path, joshua_domain_id, "--duration", "5"), lambda done: done[0] == 0
    )
    assert code == 0, text
    assert re.search(r"PASS  /wheels +rate of /wheels/joint_states", text)
    assert re.search(r"PASS  /steering +rate of /steering/joint_states", text)
    assert re.search(r"PASS  /wheels +line whole +\d+ counts, 0 damaged", text)
    assert re.search(r"PASS  /wheels +joint right_wheel +[+-]\d+\.\d+ rad, [+-]\d+\.\d+ rad/s", text)


def test_a_line_that_damages_counts_fails(tmp_path: Path, joshua_domain_id: int) -> None:
    code, text = run(tmp_path, joshua_domain_id, "--duration", "4", "--fault", "steering:corrupt=0.02")
    assert code == 1, text
    assert re.search(r"FAIL  /steering +line whole +\d+ counts, \d+ damaged: check cable, ground", text)


@pytest.mark.timing
def test_an_encoder_without_its_magnet_fails_and_the_others_go_on(
    tmp_path: Path, joshua_domain_id: int
) -> None:
    def lose_the_magnet() -> tuple[int, str]:
        with start(tmp_path, joshua_domain_id, "--duration", "4") as watched:
            watched.wait("nodes ready")
            bring_about(watched.text, "steering", "no_magnet")
            return watched.end()

    rate = r"PASS  /wheels +rate of /wheels/joint_states"
    code, text = while_steady(lose_the_magnet, lambda done: re.search(rate, done[1]) is not None)
    assert code == 1, text
    assert "the AS5600 detects no magnet" in text
    assert re.search(r"FAIL  /steering +connection +lost 1 times", text)
    assert re.search(rate, text)


def test_a_wrong_address_is_named_before_anything_runs(tmp_path: Path, joshua_domain_id: int) -> None:
    code, text = run(tmp_path, joshua_domain_id, "--duration", "30", "--fault", "wheels:silent")
    assert code == 4, text
    assert "no AMT21 answers at address 84 (0x54), 88 (0x58), nor at any other" in " ".join(text.split())


def test_a_typing_error_is_found_before_anything_runs(tmp_path: Path, joshua_domain_id: int) -> None:
    code, text = run(
        tmp_path,
        joshua_domain_id,
        "--set",
        'robot.perceptions[1].encoder_config.protocol="as560"',
        "--validate-only",
    )
    assert code == 2, text
    assert '"as5600"' in text
