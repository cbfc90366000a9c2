"""What ``joshua status`` shows of a run, laid out for a terminal."""

from __future__ import annotations

import pytest
from joshua.cli.commands import status
from joshua.ipc.client import RunInfo
from joshua.plan.events import NodeStatus, RunStatus
from joshua.supervisor.tables import Screen

FILE = "/srv/robots/the_first/teleop_so_arm100_camera.pbtxt"
COMMANDS = {"/follower_arm/joint_states": 80.0, "/follower_arm/applied_command": 100.0}
NODES = (
    NodeStatus("/leader_arm", "ready", 1234, 0, published_hz={"/leader/joint_states": 100.0}),
    NodeStatus(
        "/follower_arm",
        "ready",
        1235,
        0,
        shown="follows /leader_arm",
        published_hz=COMMANDS,
        target_hz=dict.fromkeys(COMMANDS, 100.0),
    ),
    NodeStatus("/camera_top", "fault", 1236, 1, reason="the camera at /dev/v4l/by-id/usb-C920 is gone"),
    NodeStatus("/sim", "starting", 1237, 0, doing="waiting for the model"),
)


def lines(monkeypatch: pytest.MonkeyPatch, columns: int) -> list[str]:
    monkeypatch.setattr(Screen, "of", lambda stream: Screen(columns))
    answer = RunStatus(FILE, "MODE_TELEOPERATE", "running", 12.0, 4711, NODES)
    return status._lines(RunInfo("run", 4711, FILE, "2026-11-22 16:40:00", 7, ()), answer)


@pytest.mark.parametrize("columns", [60, 72, 80])
def test_a_narrow_terminal_breaks_no_rate_and_no_path(monkeypatch: pytest.MonkeyPatch, columns: int) -> None:
    text = lines(monkeypatch, columns)
    assert max(map(len, text)) <= columns
    whole = ["/leader/joint_states 100.0 Hz", "~/joint_states 80.0 of 100 Hz!", "~/applied_command 100.0 Hz"]
    for piece in (*whole, "[1 restart]", "/dev/v4l/by-id/usb-C920"):
        assert sum(piece in line for line in text) == 1, (piece, text)


def test_reasons_follow_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    assert lines(monkeypatch, 0)[-2:] == [
        "  /camera_top: the camera at /dev/v4l/by-id/usb-C920 is gone",
        "  /sim: waiting for the model",
    ]
