"""Where the calibration of a robot is kept: one file beside its configuration, named by ``general.id``."""

from __future__ import annotations

import os.path
import re

_FOLDER = "calibration"
_ROBOT_ID = r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}"
_INTERRUPTED = ".interrupted.json"


def calibration_path(config_path: str, robot_id: str) -> str:
    """Path of a robot's calibration file; "" for an id that can name none.

    Args:
        config_path: of the configuration that it stands beside.
    """
    if not re.fullmatch(_ROBOT_ID, robot_id):
        return ""
    folder = os.path.dirname(config_path)  # noqa: PTH120 - keeps the path as the user wrote it
    return os.path.join(folder, _FOLDER, f"{robot_id}.pbtxt")  # noqa: PTH118


def journal_path(calibration_file: str, node_name: str) -> str:
    """Path of the note that an arm's calibration is being written; it stays where that was interrupted."""
    return f"{calibration_file.removesuffix('.pbtxt')}.{node_name}{_INTERRUPTED}"
