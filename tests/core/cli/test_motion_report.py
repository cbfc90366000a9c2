"""Pictures of a test: one file for each node that moved, beside the log."""

from __future__ import annotations

import resource
import struct
from pathlib import Path

import numpy as np
import pytest
from joshua.cli.motion_report import NARROW, PANEL_HEIGHT, WIDE, draw_node, draw_report
from joshua.cli.run import draw
from joshua.devices.chart import BLUE, ORANGE, RED
from joshua.plan import JointTrace, NodeReport, RunReport


def trace(joint: str) -> JointTrace:
    time_s = np.arange(200) * 0.02
    return JointTrace(
        joint=joint,
        time_s=tuple(time_s),
        goal_rad=(None, *np.sin(time_s)[1:]),
        position_rad=tuple(np.sin(time_s - 0.05)),
        effort=tuple(0.2 * np.cos(time_s)),
        temperature_c=((1.0, 27.0), (2.0, 28.0)),
    )


def report(log: Path, *nodes: NodeReport) -> RunReport:
    return RunReport(exit_code=0, nodes=nodes, log=str(log))


def test_each_joint_has_a_column_of_panels() -> None:
    one = draw_node(NodeReport(full_name="/servo", state="stopped", traces=(trace("pan"),)))
    assert one.shape == (4 * PANEL_HEIGHT, WIDE, 3)
    top = one[:PANEL_HEIGHT]
    for color in (BLUE, ORANGE):
        assert (top == color).all(axis=2).sum() > 500
    assert not (top == RED).all(axis=2).any()
    assert (one[PANEL_HEIGHT : 2 * PANEL_HEIGHT] == RED).all(axis=2).sum() > 500
    two = draw_node(NodeReport(full_name="/arm", state="stopped", traces=(trace("a"), trace("b"))))
    assert two.shape == (4 * PANEL_HEIGHT, 2 * NARROW, 3)


def test_the_picture_lies_beside_the_log(tmp_path: Path) -> None:
    moved = NodeReport(full_name="/left/servo", state="stopped", traces=(trace("pan"),))
    still = NodeReport(full_name="/camera", state="stopped")
    (path,) = draw_report(report(tmp_path / "run-1.jsonl", moved, still))
    assert path == tmp_path / "run-1-left-servo.png"
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    assert struct.unpack(">II", data[16:24]) == (WIDE, 4 * PANEL_HEIGHT)
    assert list(draw_report(RunReport(exit_code=0, nodes=(moved,)))) == []


def test_half_a_picture_is_not_left_on_a_full_disk(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    moved = NodeReport(full_name="/servo", state="stopped", traces=(trace("pan"),))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))  # stands in for a disk that is full
    try:
        draw(report(tmp_path / "run.jsonl", moved))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert f"could be written beside {tmp_path / 'run.jsonl'}: File too large" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    moved = NodeReport(full_name="/servo", state="stopped", traces=(trace("pan"),))
    draw(report(tmp_path / "file" / "run.jsonl", moved))
    assert "no picture of the test could be written" in capsys.readouterr().err
