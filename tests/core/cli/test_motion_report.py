"""Files of a test beside the log: samples and a picture for each node that moved."""

from __future__ import annotations

import csv
import resource
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from joshua.cli.motion_report import COLUMNS, HINT, write_reports
from joshua.cli.run import draw
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


def node(name: str, *joints: str) -> NodeReport:
    return NodeReport(full_name=name, state="stopped", traces=tuple(trace(joint) for joint in joints))


def test_each_joint_has_a_column_of_panels(tmp_path: Path) -> None:
    widths = []
    for joints in (("pan",), ("a", "b", "c")):
        _, line = write_reports(report(tmp_path / "run.jsonl", node("/arm", *joints)))
        data = Path(line.partition(": ")[2]).read_bytes()
        assert data.startswith(b"\x89PNG\r\n\x1a\n")
        width, height = struct.unpack(">II", data[16:24])
        assert height == 900
        widths.append(width)
    assert widths == [1200, 1650]


def test_the_files_lie_beside_the_log(tmp_path: Path) -> None:
    moved = node("/left/servo", "pan")
    still = NodeReport(full_name="/camera", state="stopped")
    lines = list(write_reports(report(tmp_path / "run-1.jsonl", moved, still)))
    assert lines == [
        f"data: {tmp_path / 'run-1-left-servo.csv'}",
        f"picture: {tmp_path / 'run-1-left-servo.png'}",
    ]
    assert list(write_reports(RunReport(exit_code=0, nodes=(moved,)))) == []


def test_every_sample_is_a_row(tmp_path: Path) -> None:
    list(write_reports(report(tmp_path / "run.jsonl", node("/arm", "pan", "tilt"))))
    with (tmp_path / "run-arm.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["joint"] for row in rows] == ["pan"] * 202 + ["tilt"] * 202
    assert rows[0]["goal_rad"] == ""
    assert float(rows[1]["position_rad"]) == pytest.approx(np.sin(0.02 - 0.05))
    assert [rows[200][name] for name in COLUMNS] == ["pan", "1.0", "", "", "", "27.0"]


def test_without_the_extra_the_data_are_written_and_a_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    monkeypatch.chdir(Path(__file__).parents[3])
    draw(report(tmp_path / "run.jsonl", node("/arm", "pan"), node("/other", "pan")))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run-arm.csv", "run-other.csv"]
    output = capsys.readouterr().out.splitlines()
    hint = HINT.format("pip install -e './joshua-core[plots]'")
    assert output[-1] == hint
    assert output.count(hint) == 1


def test_half_a_file_is_not_left_on_a_full_disk(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))  # stands in for a disk that is full
    try:
        draw(report(tmp_path / "run.jsonl", node("/servo", "pan")))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert f"could be written beside {tmp_path / 'run.jsonl'}: File too large" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    draw(report(tmp_path / "file" / "run.jsonl", node("/servo", "pan")))
    assert "no files of the test could be written" in capsys.readouterr().err
