"""What the plugin tells the host, and what the plan makes of it."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
from joshua_spike.client import DEAD_MAN_S, OPEN_TIMEOUT_S, STATE_TIMEOUT_S

CONFIGS = Path(__file__).parents[3] / "configs"


def test_the_plan_grants_the_times_that_a_radio_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RMW_IMPLEMENTATION", raising=False)
    plan = examine(Request(str(CONFIGS / "test_spike_ble.pbtxt"))).plan
    assert plan is not None
    (hub,) = [node for node in plan.nodes if node.name == "spike_hub"]
    assert hub.plugin == "joshua-spike"
    assert hub.facts.hang_after_s > STATE_TIMEOUT_S > DEAD_MAN_S
    assert hub.facts.ready_timeout_s > OPEN_TIMEOUT_S
    assert hub.facts.safe_state == "HOLD"
    assert hub.facts.safe_stop is None  # the hub's own dead man's switch is the bound


def test_parking_is_refused_with_what_is_allowed(tmp_path: Path) -> None:
    text = (CONFIGS / "test_spike_ble.pbtxt").read_text(encoding="utf-8")
    path = tmp_path / "park.pbtxt"
    path.write_text(
        text.replace("action_type: ACTION_SPIKE", "action_type: ACTION_SPIKE safe_state: PARK_THEN_RELEASE")
    )
    found = examine(Request(str(path))).diagnostics
    (finding,) = [item for item in found if item.code == "safe-state-unfit"]
    assert finding.allowed == ("HOLD", "RELEASE")
