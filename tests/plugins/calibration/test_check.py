from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import broken_targets as broken
import pytest
from joshua.testing import ConformanceError
from joshua_calibration.target import CalibrationTarget
from joshua_calibration.testing import check, check_calibration_target


@pytest.fixture(autouse=True)
def quick_hand(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The toy needs no second for its range."""
    monkeypatch.setattr(check, "HAND_S", 0.3)
    yield
    while broken.left_handles:
        os.close(broken.left_handles.pop())


def unplug(target: Any) -> None:
    target.device.unplugged = True


@pytest.mark.parametrize("kind", [broken.Target, broken.KeepsNothing])
def test_a_target_that_keeps_the_contract_passes(kind: type[broken.Target]) -> None:
    devices: list[broken.Device] = [broken.Device()]

    def make() -> CalibrationTarget:
        return kind(devices[0])

    check_calibration_target(make, unplug=unplug)
    assert devices[0].kept == [broken.FACTORY, broken.FACTORY], "what the motors kept is put back"


BROKEN: list[tuple[type[Any], str, str]] = [
    (broken.OpensInConstructor, "constructor", "the constructor opened 1 file handle (/dev/null)"),
    (broken.MotorsNeedConnection, "description", "DeviceError: the toy is not open"),
    (broken.NamesTwice, "description", "two motors have the name ['shoulder']"),
    (broken.TooFine, "description", "shoulder has 16384 ticks a turn"),
    (broken.SmallOffset, "description", "shoulder has a largest_offset of 1000"),
    (broken.RangeInDegrees, "description", "shoulder has a typical range of -180 ticks"),
    (broken.ReadsWhenClosed, "order", "raw_positions() before connect returned (1, 2)"),
    (broken.NeverCloses, "connection", "connected is true after disconnect"),
    (broken.NewIdentityEachTime, "identity", "identity is 'usb:0' at first and 'usb:1' after the device was"),
    (broken.ReleasesOnce, "release", "DeviceError: there is no torque to take off"),
    (broken.LeavesOut, "raw positions", "for 2 motors"),
    (broken.CountsTurns, "raw positions", ", allowed 0 to 4095"),
    (broken.RepeatsTheFirstReading, "motion", "the positions of shoulder changed by 0 ticks while it was"),
    (broken.MovesBoth, "motion", "another joint moved by "),
    (broken.HandBlocks, "motion", "hand(0, 0.3) returned after "),
    (broken.HidesASign, "stored", "shoulder stores StoredMotor(homing_offset=65535"),
    (broken.ResetsAtConnect, "connect writes nothing", "after the device was reopened"),
    (broken.DropsTheRange, "store", "after store of shoulder, the motors store"),
    (broken.ForgetsAtClose, "store", "after reopening, the device stores"),
    (broken.ReportsWithOffset, "store", "before store of shoulder and"),
    (
        broken.CutsTheOffset,
        "refused values",
        "after an offset of 2048 was accepted or refused, the motors store (StoredMotor(homing_offset=2047",
    ),
    (
        broken.ChecksTooLate,
        "refused values",
        "after an offset of 2048 was accepted or refused, the motors store",
    ),
    (broken.OneText, "misfits", "misfits() returned 'nothing fits'"),
    (
        broken.ClosesOnce,
        "close",
        "the first disconnect raised OSError: bad file descriptor (never connected)",
    ),
    (broken.LeavesAHandle, "nothing left", "disconnect left 1 file handle (/dev/null)"),
    (broken.SharesStateOnTheClass, "instances", "opening one opened the other"),
    (broken.RepeatsAfterUnplug, "disconnection", "still returned 0.2 s after unplugging"),
]


@pytest.mark.parametrize(("kind", "clause", "observed"), BROKEN)
def test_each_violated_clause_is_found(kind: type[Any], clause: str, observed: str) -> None:
    device = broken.Device()
    with pytest.raises(ConformanceError) as caught:
        check_calibration_target(lambda: kind(device), unplug=unplug, timeout_s=0.2, only=(clause,))
    (violation,) = caught.value.violations
    assert violation.clause == clause
    assert observed in violation.observed, str(caught.value)
    assert violation.why
    assert violation.cause


def test_every_clause_has_a_target_that_breaks_it() -> None:
    source = Path(check.__file__).read_text(encoding="utf-8")
    lines = [line.partition("checklist.run(")[2] for line in source.splitlines()]
    clauses = {line.split('"')[1] for line in lines if '"' in line}
    assert clauses | {"disconnection"} == {clause for _, clause, _ in BROKEN}
