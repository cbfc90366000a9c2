"""A calibration among the running systems."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from joshua.cli.calibration.arms import Refused
from joshua.cli.calibration.presence import Presence
from joshua.generator.run_bases import base_directory
from joshua.generator.run_directory import running_systems
from joshua.plan import NodeKind, NodeSpec, Plan

ARM = NodeSpec(name="arm", kind=NodeKind.ACTUATOR, behaviour="b:B", implementation="c:C")
PLAN = Plan(source="robot.pbtxt", mode="MODE_CALIBRATION", nodes=(ARM,))


def test_its_exit_codes_are_those_of_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    arms: Any = [SimpleNamespace(node_name="arm")]
    with ExitStack() as stack:
        Presence(PLAN, arms, lambda: None, stack)
        ((_, info),) = running_systems(base_directory({"XDG_RUNTIME_DIR": str(tmp_path)}))
        assert (info.source, info.nodes) == (str(tmp_path / "robot.pbtxt"), ("/arm",))
        with pytest.raises(Refused, match="held by process") as held:
            Presence(PLAN, arms, lambda: None, stack)
        assert held.value.code == 4
    (tmp_path / "joshua").chmod(0o755)
    with ExitStack() as stack, pytest.raises(Refused, match="chmod 700") as unusable:
        Presence(PLAN, arms, lambda: None, stack)
    assert unusable.value.code == 1
