"""A calibration among the running systems."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from joshua.ipc.client import SOCKET_NAME, ask, running_systems
from joshua.ipc.run_bases import base_directory
from joshua.plan import NodeKind, NodeSpec, Plan
from joshua_calibration import hardware
from joshua_calibration.arms import Refused, taken
from joshua_calibration.front_end import ArmState
from joshua_calibration.journal import Journal

ARM = NodeSpec(name="arm", kind=NodeKind.ACTUATOR, behaviour="b:B", implementation="c:C")
PLAN = Plan(source="robot.pbtxt", mode="MODE_CALIBRATION", nodes=(ARM,))


def test_it_answers_while_nobody_serves_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As during ``joshua calibrate --check``, which waits for its arms meanwhile."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    arms: Any = [SimpleNamespace(node_name="arm", state=ArmState.WAITING)]
    stopped = threading.Event()
    plan = PLAN.model_copy(update={"mode": "MODE_TELEOPERATE"})  # a check leaves the file's mode
    with ExitStack() as stack:
        taken(plan, arms, stopped.set, stack, "calibration is compared")
        ((path, _),) = running_systems(base_directory({"XDG_RUNTIME_DIR": str(tmp_path)}))
        status = ask(path / SOCKET_NAME, {"request": "status"}, timeout_s=20)["status"]
        assert (status["mode"], status["phase"]) == ("MODE_CALIBRATION", "running")
        ((name, state, reason),) = [(n["full_name"], n["state"], n["reason"]) for n in status["nodes"]]
        assert (name, state, reason) == ("/arm", "ready", "calibration is compared")
        assert not stopped.is_set()
        assert ask(path / SOCKET_NAME, {"request": "stop"}, timeout_s=20) == {"stopping": True}
        assert stopped.is_set()
    assert not path.exists()
    assert all(thread.name != "presence" for thread in threading.enumerate())


def test_a_check_that_is_told_to_stop_says_that_it_is_not_finished(monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped_at_once(_plan: Plan, _arms: Any, stop: Any, _stack: ExitStack, doing: str) -> None:
        assert doing == "calibration is compared"
        stop()

    arm = SimpleNamespace(node_name="arm", journal=Journal("nowhere.json"))
    monkeypatch.setattr(hardware, "plan_of", lambda *_: (PLAN, {}))
    monkeypatch.setattr(hardware, "find_arms", lambda *_, **__: [arm])
    monkeypatch.setattr(hardware, "open_arms", lambda *_, **__: None)
    monkeypatch.setattr(hardware, "taken", stopped_at_once)
    arguments: Any = SimpleNamespace(sim=False, nodes=(), recover=False)
    checked: Any = None
    with ExitStack() as stack, pytest.raises(Refused, match="stopped before every arm was compared") as ended:
        hardware._look(checked, arguments, None, stack)
    assert ended.value.code == 1


def test_its_exit_codes_are_those_of_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    arms: Any = [SimpleNamespace(node_name="arm", state=ArmState.WAITING)]
    with ExitStack() as stack:
        taken(PLAN, arms, lambda: None, stack)
        ((_, info),) = running_systems(base_directory({"XDG_RUNTIME_DIR": str(tmp_path)}))
        assert (info.source, info.nodes) == (str(tmp_path / "robot.pbtxt"), ("/arm",))
        with pytest.raises(Refused, match="held by process") as held:
            taken(PLAN, arms, lambda: None, stack)
        assert held.value.code == 4
    (tmp_path / "joshua").chmod(0o755)
    with ExitStack() as stack, pytest.raises(Refused, match="chmod 700") as unusable:
        taken(PLAN, arms, lambda: None, stack)
    assert unusable.value.code == 1
