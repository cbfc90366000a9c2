"""A program that holds nodes without starting them: what reaches it, and what is refused."""

from __future__ import annotations

import pytest
from joshua.cli.main import main
from joshua.ipc.client import CallError, RunningSystem
from joshua.plan import NodeKind, NodeSpec, Plan
from joshua.tools import foreground_job


def test_status_and_stop_reach_it_and_a_call_says_so(
    tmp_path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    arm = NodeSpec(name="arm", kind=NodeKind.ACTUATOR, behaviour="a:B", implementation="a:C")
    plan = Plan(source=str(tmp_path / "arm.pbtxt"), mode="MODE_CALIBRATION", nodes=(arm,))
    stopped: list[bool] = []
    with foreground_job(
        plan, "MODE_CALIBRATION", ["arm"], lambda _: ("ready", "measures"), lambda: stopped.append(True)
    ):
        (system,) = RunningSystem.all()
        (node,) = system.status().nodes
        assert (node.full_name, node.state, node.reason) == ("/arm", "ready", "measures")
        only = "MODE_CALIBRATION starts no nodes: only `joshua status` and `joshua stop` reach it"
        with pytest.raises(CallError, match="starts no nodes") as refused:
            system.call("arm", "resume")
        assert (refused.value.code, str(refused.value)) == ("refused", only)
        assert main(["call", "arm", "resume"]) == 1
        assert capsys.readouterr().err == f"joshua call: {only}\n"
        assert main(["call"]) == 0
        assert capsys.readouterr().out == f"/arm\n  {only}\n"
        with pytest.raises(CallError, match="starts no nodes"):
            list(system.events())
        system.request({"request": "stop"})
        assert stopped == [True]
