from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import broken_bus_tools as broken
import pytest
from joshua.testing import ConformanceError
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
from joshua_servo import testing as bus_tools_check
from joshua_servo.bus_tools import BusTools
from joshua_servo.testing import check_bus_tools


@pytest.fixture
def port_path() -> Iterator[str]:
    master, slave = os.openpty()
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)
    while broken.handles:
        os.close(broken.handles.pop())


def factory(kind: type[broken.Tools], path: str) -> Any:
    fresh = type(kind.__name__, (kind,), {"bus": broken.Bus()})

    def make() -> BusTools:
        port = SerialPort(Endpoint(path), 57_600)
        port.open()
        tools = fresh(port)
        assert isinstance(tools, BusTools)
        return tools

    return make


def unplug(tools: Any) -> None:
    tools.bus.unplugged = True


def test_tools_that_keep_the_contract_pass(port_path: str) -> None:
    check_bus_tools(factory(broken.Tools, port_path), unplug=unplug)


BROKEN: list[tuple[type[Any], str, str]] = [
    (broken.ClosesThePort, "constructor", "the port is closed after the constructor"),
    (broken.OpensAHandle, "constructor", "the constructor opened 1 file handle (/dev/null)"),
    (broken.NoFamily, "description", "family is ''"),
    (broken.SpeedCodes, "description", "baudrates (115200, 57600, 115200) lists a speed twice"),
    (broken.FactoryIdMissing, "description", "ids is range(0, 10) and factory_id 11"),
    (broken.NoModels, "description", "expected_models is ()"),
    (broken.CollectsFirst, "scan", "scan() returned list"),
    (broken.FindsOne, "scan", "scan() found ['1 (Toy)']"),
    (broken.YieldsIds, "scan", "scan() yielded int"),
    (broken.ModelNumber, "scan", "the motor 1 is a 'model 777'; expected Toy"),
    (broken.TenthsOfVolts, "scan", "voltage_v of motor 1 is 120.0"),
    (broken.Shared, "scan", "several motors answer to id 1"),
    (broken.OtherOrder, "scan", "scan() yielded [(2, 115200), (1, 115200)] (id, bit/s)"),
    (broken.MovesAMotorAtScan, "chosen speeds", "found [(2, 115200), (5, 115200)] (id, bit/s); expected [(1"),
    (broken.LooksEverywhere, "chosen speeds", "scan((57600,)) found [(1, 115200), (2, 115200)]"),
    (broken.LeavesTheSpeed, "line speed", "the port runs at 57600 bit/s after scan; it ran at 115200 before"),
    (broken.LeavesTheSpeedHalfWay, "line speed", "after a scan that ended early; it ran at 57600 before"),
    (broken.WritesToAll, "assign", "returned 9, and scan finds [(9, 115200), (9, 115200)] (id, bit/s)"),
    (broken.OwnIdIsTaken, "assign again", "AssignmentFailed: id 1 is taken"),
    (broken.KeepsItsSpeed, "assign speed", "assign(1, 57600) returned 1 at 115200, and scan finds"),
    (broken.TakesATakenId, "refused", "assign of the id 2, which another motor has returned FoundMotor("),
    (broken.TakesAnything, "refused", "assign of the id 10 returned FoundMotor("),
    (
        broken.WritesBeforeItRefuses,
        "refused",
        "but scan finds [(2, 115200), (7, 115200)] (id, bit/s) instead of",
    ),
    (
        broken.IgnoresSilence,
        "refused",
        "assign of an id to a motor that does not reply returned FoundMotor(",
    ),
    (broken.FindsNobodyAfterUnplug, "disconnection", "after unplugging, scan() returned []"),
]


@pytest.mark.parametrize(("kind", "clause", "observed"), BROKEN)
def test_each_violated_clause_is_found(kind: type[Any], clause: str, observed: str, port_path: str) -> None:
    with pytest.raises(ConformanceError) as caught:
        check_bus_tools(factory(kind, port_path), unplug=unplug, only=(clause,))
    (violation,) = caught.value.violations
    assert violation.clause == clause
    assert observed in violation.observed, str(caught.value)
    assert violation.why
    assert violation.cause


def test_every_clause_has_tools_that_break_it() -> None:
    source = Path(bus_tools_check.__file__).read_text(encoding="utf-8")
    lines = [line.partition("checklist.run(")[2] for line in source.splitlines()]
    clauses = {line.split('"')[1] for line in lines if '"' in line}
    assert clauses == {clause for _, clause, _ in BROKEN}
