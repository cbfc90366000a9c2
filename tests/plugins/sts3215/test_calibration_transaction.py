"""Writing a calibration is all or nothing, wherever it is interrupted: servos and file, old or new."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import calibration_writer
import pytest
from calibration_writer import NODE, SteppedTarget, new_calibration, open_target, parts
from joshua_calibration import transaction
from joshua_calibration.arm_file import PreparedFile
from joshua_calibration.journal import JournalRefused
from joshua_calibration.transaction import NotWritten, Recovery, recover, values_of, write
from joshua_emulator import EmulatedBus
from joshua_servo.bus import REPLY_MARGIN_S
from patience import BRISK_S

STEPS = 24  # 2 for the note, 18 for six servos, 2 for the file, 2 for the end of the note
OLD_STAMP = "2025-01-01T00:00:00Z"


class Rig:
    """An emulated arm that was calibrated before, with its file."""

    def __init__(self, emulator: EmulatedBus, folder: Path) -> None:
        self.emulator = emulator
        self.path = folder / "calibration" / "rig.pbtxt"
        self.file, self.journal = parts(self.path)
        self.target = self.open()
        self.old = new_calibration(OLD_STAMP, offset=-300)
        write(self.target, NODE, self.old, self.file, self.journal)

    def open(self) -> SteppedTarget:
        return open_target(self.emulator.port, str(self.emulator.root))

    def holds(self, calibration: Any) -> bool:
        """Whether servos and file hold a calibration, and nothing else lies in the folder."""
        truth = {
            servo_id: (r["homing_offset"], r["min_position_limit"], r["max_position_limit"])
            for servo_id in range(1, 7)
            for r in [self.emulator.ask("registers", id=servo_id)["registers"]]
        }
        wanted = {i: (v.homing_offset, v.range_min, v.range_max) for i, v in values_of(calibration).items()}
        return truth == wanted and self.file.arm(NODE) == calibration and self.leftovers() == []

    def leftovers(self) -> list[str]:
        return [name for name in os.listdir(self.path.parent) if name != "rig.pbtxt"]


@pytest.fixture
def rig(arm_emulator: EmulatedBus, tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(arm_emulator, tmp_path)
    yield rig
    rig.target.disconnect()


def test_both_hold_the_new_calibration(rig: Rig):
    assert rig.holds(rig.old)
    write(rig.target, NODE, new_calibration(), rig.file, rig.journal)
    assert rig.holds(new_calibration())
    assert not [entry for entry in rig.emulator.log("torque") if entry["on"]]


def test_a_bus_that_is_silent_for_a_moment_costs_no_calibration(rig: Rig):
    rig.target._bus.reply_margin_s = REPLY_MARGIN_S  # as the program has it
    silence_s = 0.25  # a control loop gives a servo up after a tenth of a second
    os.kill(rig.emulator.pid, signal.SIGSTOP)
    end = threading.Timer(silence_s, os.kill, (rig.emulator.pid, signal.SIGCONT))
    end.start()
    began_s = time.monotonic()
    rig.target.store(1, values_of(new_calibration())[1])
    end.join()
    assert time.monotonic() - began_s > silence_s
    write(rig.target, NODE, new_calibration(), rig.file, rig.journal)
    assert rig.holds(new_calibration())


@pytest.mark.parametrize("step", range(STEPS))
def test_a_kill_at_any_step_leaves_what_recovery_puts_right(rig: Rig, step: int):
    rig.target.disconnect()
    program = [sys.executable, calibration_writer.__file__]
    arguments = [rig.emulator.port, str(rig.emulator.root), str(rig.path), str(step)]
    killed = subprocess.run([*program, *arguments], capture_output=True, text=True, timeout=60)
    assert killed.returncode == -9, killed.stderr
    was_committed = rig.file.arm(NODE) == new_calibration()
    had_note = rig.journal.read() is not None
    rig.target = rig.open()
    found = recover(rig.target, rig.file, rig.journal)
    if had_note:
        assert found is (Recovery.COMPLETED if was_committed else Recovery.RESTORED)
    else:
        assert found is Recovery.NOTHING
    assert rig.leftovers() == []
    assert rig.holds(new_calibration() if was_committed else rig.old)
    assert recover(rig.target, rig.file, rig.journal) is Recovery.NOTHING


def test_there_are_no_more_steps_than_those(rig: Rig):
    rig.target.disconnect()
    arguments = [rig.emulator.port, str(rig.emulator.root), str(rig.path), "-1"]
    done = subprocess.run(
        [sys.executable, calibration_writer.__file__, *arguments], capture_output=True, text=True, timeout=60
    )
    assert done.stdout == f"steps {STEPS}\n", done.stderr
    assert rig.holds(new_calibration())


@pytest.mark.parametrize("motor", range(6))
def test_a_cancelled_write_is_undone(rig: Rig, motor: int):
    asked = iter(range(100))
    with pytest.raises(NotWritten) as refused:
        write(rig.target, NODE, new_calibration(), rig.file, rig.journal, lambda: next(asked) == motor)
    assert str(refused.value) == (
        "interrupted\nThe old calibration is still used, in the servos and in the file."
    )
    assert refused.value.restored
    assert rig.holds(rig.old)


@pytest.mark.parametrize("motor", [1, 4])
def test_an_arm_that_is_unplugged_and_comes_back_is_put_back(
    rig: Rig, motor: int, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(transaction, "ROLLBACK_S", 60.0)  # the machine may take long to replug

    def unplug() -> bool:
        nonlocal motor
        motor -= 1
        if motor == 0:
            rig.emulator.ask("fault", kind="unplug", replug_after_s=0.8)
        return False

    with pytest.raises(NotWritten, match="The old calibration is still used, in the servos and in the file"):
        write(rig.target, NODE, new_calibration(), rig.file, rig.journal, unplug)
    assert rig.holds(rig.old)


def test_an_arm_that_stays_away_leaves_a_note(rig: Rig):
    asked = iter(range(100))

    def unplug() -> bool:
        if next(asked) == 3:
            rig.emulator.ask("fault", kind="unplug")
        return False

    with pytest.raises(NotWritten, match="run `joshua calibrate --recover --config FILE`") as refused:
        write(rig.target, NODE, new_calibration(), rig.file, rig.journal, unplug)
    assert not refused.value.restored
    assert rig.file.arm(NODE) == rig.old
    rig.emulator.ask("fault", kind="replug")
    rig.target.connect()
    assert recover(rig.target, rig.file, rig.journal) is Recovery.RESTORED
    assert rig.holds(rig.old)


@pytest.mark.parametrize("asked_times", range(6))
def test_a_power_cut_of_the_servos_is_undone(rig: Rig, asked_times: int):
    rig.target._bus.reply_margin_s = BRISK_S  # servos that boot do not answer, and one never does
    asked = iter(range(100))

    def cut() -> bool:
        if next(asked) == asked_times:
            rig.emulator.fault("brown_out")
            rig.emulator.fault("silent", 5)
        return False

    with pytest.raises(NotWritten, match=r"could not be restored yet"):
        write(rig.target, NODE, new_calibration(), rig.file, rig.journal, cut)
    rig.emulator.ask("clear_faults")
    rig.target.connect()
    assert recover(rig.target, rig.file, rig.journal) is Recovery.RESTORED
    assert rig.holds(rig.old)


def test_a_file_that_cannot_be_renamed_undoes_the_servos(rig: Rig, monkeypatch: pytest.MonkeyPatch):
    def fail(self: PreparedFile) -> None:
        assert self._temporary is not None
        os.unlink(self._temporary)
        os.mkdir(self._temporary)
        try:
            commit(self)
        finally:
            os.rmdir(self._temporary)

    commit = PreparedFile.commit
    monkeypatch.setattr(PreparedFile, "commit", fail)
    with pytest.raises(NotWritten, match="cannot be replaced"):
        write(rig.target, NODE, new_calibration(), rig.file, rig.journal)
    assert rig.holds(rig.old)


def test_a_folder_that_is_full_stops_it_before_the_servos(rig: Rig):
    rig.path.write_text("calibration { broken")
    with pytest.raises(NotWritten, match=r"Nothing was written\. The old calibration is still used"):
        write(rig.target, NODE, new_calibration(), rig.file, rig.journal)
    assert not [e for e in rig.emulator.log("eeprom") if e]


def test_a_servo_that_does_not_keep_its_values_undoes_it(rig: Rig):
    asked = iter(range(100))

    def wear_out() -> bool:
        if next(asked) == 2:  # the lock that is on again drops the write without a word
            rig.target._bus.write = _locked(rig.target._bus.write, 3)  # type: ignore[method-assign]
        return False

    with pytest.raises(NotWritten, match="id 3 keeps homing_offset at"):
        write(rig.target, NODE, new_calibration(), rig.file, rig.journal, wear_out)
    assert rig.holds(rig.old)


def _locked(inner: Any, servo_id: int) -> Any:
    def write_register(target_id: int, register: Any, value: int) -> None:
        inner(target_id, register, 1 if target_id == servo_id and register.name == "lock" else value)

    return write_register


def test_another_arm_is_not_touched_by_recovery(rig: Rig, monkeypatch: pytest.MonkeyPatch):
    asked = iter(range(100))

    def unplug() -> bool:
        if next(asked) == 3:
            rig.emulator.ask("fault", kind="unplug")
        return False

    with pytest.raises(NotWritten):
        write(rig.target, NODE, new_calibration(), rig.file, rig.journal, unplug)
    with EmulatedBus(arm="so_arm100", calibrated=True, identity="ARM2") as other:
        target = open_target(other.port, str(other.root))
        before = target.stored()
        with pytest.raises(NotWritten, match=r"written to usb:ARM1, but this is usb:ARM2\. Connect that arm"):
            recover(target, rig.file, rig.journal)
        assert target.stored() == before
        target.disconnect()


def test_a_note_that_cannot_be_read_is_named(rig: Rig):
    rig.journal.path.write_text("{}")
    with pytest.raises(JournalRefused, match="Remove it, then calibrate the arm again"):
        rig.journal.read()
    with pytest.raises(NotWritten, match="Remove it, then calibrate the arm again"):
        recover(rig.target, rig.file, rig.journal)
