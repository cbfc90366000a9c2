"""An emulated hub as a process: its options, its refusals, and its end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from joshua_emulator.emulator_process import EmulatorError
from joshua_emulator.spike.process import EmulatedHub


def wait_until(reached: Callable[[], object], timeout_s: float = 60.0) -> None:
    end_s = time.monotonic() + timeout_s
    while not reached():
        assert time.monotonic() < end_s, "it did not come about"
        time.sleep(0.01)


def test_what_is_no_fault_is_refused_with_what_is_allowed() -> None:
    with EmulatedHub(("A", "C")) as hub:
        with pytest.raises(EmulatorError, match="unknown fault 'explode'; allowed: stall, motor_off"):
            hub.fault("explode")
        with pytest.raises(EmulatorError, match="stall is 'B'; allowed: A, C"):
            hub.ask("fault", kind="stall", value="B")
        with pytest.raises(EmulatorError, match="firmware is 'dos'; allowed: lego, old, pybricks"):
            hub.ask("fault", kind="firmware", value="dos")
        with pytest.raises(EmulatorError, match="slot is 2; allowed: 0 to 1"):
            hub.guide(2, 1.0)
        with pytest.raises(EmulatorError, match="unknown operation 'dance'"):
            hub.ask("dance")


def test_ports_are_letters_each_once() -> None:
    command = [sys.executable, "-m", "joshua_emulator", "spike", "--ports", "A,A"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert result.returncode == 2
    assert "expected letters of A to F, each once" in result.stderr


def test_without_bumble_the_message_says_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "bumble.py").write_text('raise ModuleNotFoundError("No bumble", name="bumble")\n')
    result = subprocess.run(
        [sys.executable, "-m", "joshua_emulator", "spike"],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
    )
    assert result.returncode == 2
    assert "needs bumble" in result.stderr
    assert "run --with 'emulator[spike]'" in result.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_program_does_not_outlive_its_hub(number: signal.Signals) -> None:
    hub = EmulatedHub(("A",))
    hub.start()
    hub.ask("fault", kind="other_program")
    children = Path(f"/proc/{hub.pid}/task/{hub.pid}/children")
    wait_until(lambda: children.read_text().split())
    programs = [int(word) for word in children.read_text().split()]
    os.kill(hub.pid, number)
    wait_until(lambda: not any(_runs(program) for program in programs))
    hub.close()


def _runs(number: int) -> bool:
    try:
        return ") Z " not in Path(f"/proc/{number}/stat").read_text()
    except OSError:
        return False
