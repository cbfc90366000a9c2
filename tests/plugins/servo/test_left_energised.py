"""An arm that keeps its torque after its run: what its servos say, and how it is released without a run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from joshua.cli.energised import left_energised, left_lines, release_recorded
from joshua.guardian.energised import EnergisedFolder, EnergisedNote, EnergisedRecord
from joshua.guardian.latch import Latch
from joshua.supervisor.starting import starting
from joshua_emulator import EmulatedBus
from servo_families import Kind
from servo_fixtures import MakeArm

LATCH = Latch("1", "robot", "", 0, (), "", 0)


@pytest.fixture
def left(tmp_path: Path, arm_emulator: EmulatedBus, make_arm: MakeArm) -> EnergisedRecord:
    """The record of an arm that its driver has left with torque."""
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    request = arm.safe_stop_request("RELEASE")
    kind = type(request)
    record = EnergisedRecord(
        node="/arm",
        robot="robot",
        source=str(tmp_path / "my robot.pbtxt"),
        domain_id=3,
        run="ended",
        implementation=f"{kind.__module__}:{kind.__qualname__}",
        request=request.to_values(),
        options=("--set", "general.id=my robot"),
    )
    note = EnergisedNote(str(tmp_path / "energised"), str(tmp_path / "spare"), record)
    note.prepare()
    note.energising()
    arm.disconnect()
    return record


def records(folder: Path) -> list[EnergisedRecord]:
    return [replace(record, since="") for record in EnergisedFolder(folder / "energised").all()]


def test_it_is_named_with_the_command_that_releases_it(
    tmp_path: Path, left: EnergisedRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert left_lines(left_energised([tmp_path])) == [
        "/arm holds its position with torque. To release it, which lets it sink: "
        "joshua estop 'my robot.pbtxt' --set 'general.id=my robot'"
    ]
    assert records(tmp_path) == [left]


def test_joints_that_have_torque_are_named(
    tmp_path: Path, left: EnergisedRecord, arm_emulator: EmulatedBus, kind: Kind, open_bus
) -> None:
    torque = kind.driver(arm_emulator).family.torque_enable
    with open_bus(arm_emulator) as bus:
        bus.sync_write(torque.address, torque.width, {2: torque.encode(0), 3: torque.encode(0)})
    (found,) = left_energised([tmp_path])
    assert found.state == "/arm has torque at 1, 4, 5, 6"


def test_the_record_of_an_arm_without_torque_goes(
    tmp_path: Path, left: EnergisedRecord, arm_emulator: EmulatedBus, make_arm: MakeArm
) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.release()
    arm.disconnect()
    assert left_energised([tmp_path]) == []
    assert records(tmp_path) == []


@pytest.mark.parametrize(
    ("fault", "says"),
    [(("silent", 5), "ids 5 do not report their torque"), (("unplug",), "serial_number ARM1")],
    ids=["silent", "unplugged"],
)
def test_what_is_known_of_an_arm_that_cannot_be_read(
    tmp_path: Path, left: EnergisedRecord, arm_emulator: EmulatedBus, fault: tuple, says: str
) -> None:
    arm_emulator.fault(*fault)
    (line,) = left_lines(left_energised([tmp_path]))
    assert line.startswith("/arm got torque at 2")
    assert " and was not released since; it cannot be read: " in line
    assert says in line
    assert records(tmp_path) == [left], "it may hold all the same"


def test_a_run_that_is_starting_is_not_disturbed(
    tmp_path: Path, left: EnergisedRecord, arm_emulator: EmulatedBus
) -> None:
    """It would find the port in use."""
    with starting(tmp_path):
        requests = arm_emulator.log()[-1]["sequence"]
        (found,) = left_energised([tmp_path])
        assert found.state.endswith("it cannot be read: a run is starting or does not answer")
        assert arm_emulator.log()[-1]["sequence"] == requests
    assert left_energised([tmp_path])[0].joints == 6


def test_it_is_released_without_its_driver(
    tmp_path: Path, left: EnergisedRecord, arm_emulator: EmulatedBus
) -> None:
    (known,) = EnergisedFolder(tmp_path / "energised").all()
    (report,) = release_recorded([tmp_path], LATCH, [known])
    assert (report.complete, report.verified, len(report.joints)) == (True, True, 6)
    assert {servo["energised"] for servo in arm_emulator.servos()} == {False}
    assert records(tmp_path) == []


def test_a_release_that_is_not_confirmed_keeps_the_record(
    tmp_path: Path, left: EnergisedRecord, arm_emulator: EmulatedBus
) -> None:
    arm_emulator.fault("unplug")
    (known,) = EnergisedFolder(tmp_path / "energised").all()
    (report,) = release_recorded([tmp_path], LATCH, [known])
    assert not report.complete
    assert records(tmp_path) == [left]
