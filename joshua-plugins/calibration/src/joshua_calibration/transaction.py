"""Atomic write of a calibration: servos and file both end up with the new values, or both with the old ones.

The order: write the new file next to the old one; write a journal with both states; write the servos and read
them back; rename the file, which commits; remove the journal. An interruption, including a power cut or a
kill, leaves the journal, and ``recover`` makes servos and file agree again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from enum import Enum

from joshua.api import DeviceError
from joshua.api.calibration import ArmCalibration
from joshua.tools import FileRefused

from joshua_calibration.arm_file import ArmFile
from joshua_calibration.journal import Journal, JournalRefused, Record
from joshua_calibration.target import CalibrationTarget, StoredMotor

ROLLBACK_S = 3.0  # longest wait for a disconnected arm before recovery is left to a later start
PAUSE_S = 0.25


class NotWritten(Exception):
    """The calibration was not written. The message gives the reason and the present state.

    Attributes:
        restored: the servos are known to hold the old values.
    """

    def __init__(self, message: str, *, restored: bool) -> None:
        super().__init__(message)
        self.restored = restored


class Recovery(Enum):
    """Outcome of ``recover``."""

    NOTHING = "nothing was interrupted"
    RESTORED = "the servos hold the old calibration again"
    COMPLETED = "the servos hold the new calibration, as the file does"


def write(
    target: CalibrationTarget,
    node_name: str,
    calibration: ArmCalibration,
    file: ArmFile,
    journal: Journal,
    cancelled: Callable[[], bool] = lambda: False,
) -> None:
    """Write a calibration to the device and the file.

    Args:
        cancelled: polled before each motor; True undoes the write.

    Raises:
        NotWritten: the old calibration is still used, or will be after ``recover``.
    """
    new = values_of(calibration)
    try:
        target.release()
        kept = target.stored()
        prepared = file.prepare(node_name, calibration)
    except (DeviceError, FileRefused) as error:
        raise NotWritten(
            f"{error}\nNothing was written. The old calibration is still used.", restored=True
        ) from error
    old = {} if kept is None else {m.id: v for m, v in zip(target.motors, kept, strict=True)}
    try:
        if old:
            journal.write(
                Record(
                    node_name=node_name,
                    device_identity=target.identity,
                    calibrated_at=calibration.calibrated_at,
                    old=old,
                    new=new,
                )
            )
            _store(target, new, cancelled)
        if cancelled():
            raise _Cancelled("interrupted")
        prepared.commit()
    except (DeviceError, FileRefused, JournalRefused, _Cancelled) as error:
        prepared.discard()
        raise _undone(target, old, journal, error) from error
    except BaseException:
        prepared.discard()
        _undone(target, old, journal, None)
        raise
    journal.remove()


def recover(target: CalibrationTarget, file: ArmFile, journal: Journal) -> Recovery:
    """Make servos and file agree after an interrupted write of a calibration.

    Raises:
        NotWritten: the journal is another arm's, or the servos do not accept their values; it is kept.
    """
    try:
        file.sweep()
        record = journal.read()
        if record is None:
            journal.remove()
            return Recovery.NOTHING
        entry = file.arm(record.node_name)
    except (JournalRefused, FileRefused) as error:
        raise NotWritten(str(error), restored=False) from error
    if record.device_identity and target.identity and record.device_identity != target.identity:
        raise NotWritten(
            f"a calibration of {record.node_name} was interrupted while it was written to "
            f"{record.device_identity}, but this is {target.identity}. Connect that arm and run the command "
            "again",
            restored=False,
        )
    is_completed = entry is not None and entry.calibrated_at == record.calibrated_at
    is_completed = is_completed and entry is not None and values_of(entry) == record.new
    try:
        target.release()
        _store(target, record.new if is_completed else record.old, lambda: False)
    except DeviceError as error:
        raise NotWritten(
            f"{error}\n"
            f"The servos of {record.node_name} hold values of two calibrations. Run the command again once "
            "the arm responds",
            restored=False,
        ) from error
    journal.remove()
    return Recovery.COMPLETED if is_completed else Recovery.RESTORED


def values_of(calibration: ArmCalibration) -> dict[int, StoredMotor]:
    """Return the values of a calibration for the motors, by id."""
    return {m.id: StoredMotor(m.homing_offset, m.range_min, m.range_max) for m in calibration.motors}


class _Cancelled(Exception):
    """The user interrupted the write."""


def _store(
    target: CalibrationTarget, values: Mapping[int, StoredMotor], cancelled: Callable[[], bool]
) -> None:
    """Write all motors, then read all of them back."""
    for motor_id, value in values.items():
        if cancelled():
            raise _Cancelled("interrupted")
        target.store(motor_id, value)
    kept = target.stored()
    if kept is None:
        return
    for motor, found in zip(target.motors, kept, strict=True):
        if found != values.get(motor.id, found):
            raise DeviceError(
                f"{motor.joint_name} (id {motor.id}) holds {found} after {values[motor.id]} was written. "
                "Check the supply voltage and try again"
            )


def _undone(
    target: CalibrationTarget,
    old: Mapping[int, StoredMotor],
    journal: Journal,
    error: BaseException | None,
) -> NotWritten:
    """Restore the old values, with a short wait for a disconnected arm; return the error to raise."""
    reason = str(error) if error else "interrupted"
    failure = _roll_back(target, old)
    if failure is None:
        journal.remove()
        return NotWritten(
            f"{reason}\nThe old calibration is still used, in the servos and in the file.", restored=True
        )
    return NotWritten(
        f"{reason}\n"
        "The file still contains the old calibration, but the servos could not be restored yet: "
        f"{failure}\n"
        f"Torque of this arm stays off until they are. Connect it and run `{journal.recovery}`.",
        restored=False,
    )


def _roll_back(target: CalibrationTarget, old: Mapping[int, StoredMotor]) -> DeviceError | None:
    deadline_s = time.monotonic() + ROLLBACK_S
    while True:
        try:
            if not target.connected:
                target.connect()
            _store(target, old, lambda: False)
        except DeviceError as error:
            target.disconnect()
            if time.monotonic() >= deadline_s:
                return error
            time.sleep(PAUSE_S)
        else:
            return None
