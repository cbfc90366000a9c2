"""The calibration file of a run, and the detection of an interrupted write."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.config.loading import calibration_path, journal_path
from joshua.plan import Diagnostic, Severity

if TYPE_CHECKING:
    from joshua.config import LoadedConfig
    from joshua.schema.calibration_pb2 import ArmCalibration

Place = Callable[[str, str], str]


class FileRefused(Exception):
    """A calibration file cannot be read or written. The message says why and what to do."""


def calibration_place(state_home: str | os.PathLike[str], *, emulate: bool, simulate: bool = False) -> Place:
    """The rule for the calibration file: beside the configuration, or in the state folder if virtual.

    Args:
        state_home: folder for state files of this user's programs.
    """
    if not (emulate or simulate):
        return calibration_path
    kind = "emulated" if emulate else "simulated"

    def kept(config_path: str, robot_id: str) -> str:
        del config_path  # a real arm's file is there
        return calibration_path(str(state_folder(state_home, robot_id, kind) / "robot.pbtxt"), robot_id)

    return kept


def state_folder(state_home: str | os.PathLike[str], robot_id: str, kind: str = "emulated") -> Path:
    """Folder for the memory of a robot's emulated or simulated devices, such as their EEPROM."""
    safe = "".join(c if c.isalnum() or c in "-_." else "_" for c in robot_id).strip(".") or "robot"
    return Path(state_home) / kind / safe


def kept_calibrations(path: str | os.PathLike[str]) -> dict[str, ArmCalibration]:
    """The calibrations of a file by node name; {} if there is no such file. Raises FileRefused."""
    from joshua.config.loading import load

    if not os.path.exists(path):  # noqa: PTH110
        return {}
    loaded = load(path)
    for item in loaded.diagnostics:
        if item.severity is Severity.ERROR:
            place = item.position or path
            raise FileRefused(f"{place}: {item.message} Correct the calibration file, or move it away")
    return {arm.node_name: arm for arm in reversed(loaded.config.calibration.arms)}


def interrupted_calibrations(
    loaded: LoadedConfig, *, emulate: bool, state_home: str = ""
) -> list[Diagnostic]:
    """Arms whose servos and file may disagree, and must not be driven. A calibration run recovers them.

    Simulated arms store nothing that could disagree, and are skipped.
    """
    config = loaded.config
    path = calibration_place(state_home, emulate=emulate)(loaded.path, config.general.id)
    if not path:
        return []
    names = [entry.node.node_name for entry in loaded.graph.actuators]
    return [
        Diagnostic(
            "calibration-interrupted",
            Severity.ERROR,
            f"A calibration of {name} was interrupted during writing, so servos and file may disagree",
            field_path="calibration",
            found=journal_path(path, name),
            remedy=f"Run joshua calibrate --recover --config {shlex.quote(str(loaded.path))}"
            + (" --emulate" if emulate else "")
            + ", which restores the old calibration",
        )
        for name in names
        if name and Path(journal_path(path, name)).exists()
    ]
