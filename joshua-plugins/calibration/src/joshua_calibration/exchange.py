"""``joshua calibrate import-lerobot`` and ``export-lerobot``: exchange of LeRobot's calibration files."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from joshua.api.calibration import ArmCalibration
from joshua.tools import (
    Checked,
    ExitCode,
    FileRefused,
    Purpose,
    calibration_place,
    check_file,
    device_block,
    exit_code_of,
    request_of,
    show_findings,
)

from joshua_calibration.arm_file import ArmFile
from joshua_calibration.lerobot import CalibrationError, from_lerobot, to_lerobot

if TYPE_CHECKING:
    import argparse

MAX_BYTES = 1 << 20


class _Refused(Exception):
    """The command line or a file is invalid. The message gives reason and remedy."""


def home() -> Path:
    """Return the folder of LeRobot's calibrations; may not exist for a user without a home."""
    given = os.environ.get("HF_LEROBOT_CALIBRATION")
    cache = os.environ.get("HF_HOME") or os.path.expanduser("~/.cache/huggingface")  # noqa: PTH111
    lerobot = os.environ.get("HF_LEROBOT_HOME") or Path(cache) / "lerobot"
    return Path(given) if given else Path(lerobot) / "calibration"


def list_files() -> int:
    """List LeRobot's calibrations on this machine. Exit code 2: nothing was imported."""
    files = sorted(home().rglob("*.json"))
    for path in files:
        try:
            calibration = from_lerobot(_read(path), source=str(path))
            text = f"{len(calibration.motors)} joints: {', '.join(m.joint_name for m in calibration.motors)}"
        except (CalibrationError, _Refused) as error:
            text = str(error)
        sys.stdout.write(f"{path}\n  {text}\n")
    what = "name one for each arm" if files else f"no calibration of LeRobot below {home()}: name a file"
    sys.stderr.write(
        f"joshua calibrate import-lerobot: {what}: "
        "joshua calibrate import-lerobot leader_arm=PATH --config robot.pbtxt\n"
    )
    return ExitCode.INVALID


def import_files(arguments: argparse.Namespace) -> int:
    """Import LeRobot files into the robot's calibration file; the servos are not changed."""
    if not arguments.items:
        return list_files()
    return _with_file(arguments, is_import=True)


def export(arguments: argparse.Namespace) -> int:
    """Write LeRobot files, or one to standard output."""
    return _with_file(arguments, is_import=False)


def _with_file(arguments: argparse.Namespace, *, is_import: bool) -> int:
    checked = check_file(request_of(arguments, Purpose.SHOW))
    errors = [
        item  # problems of the calibration that will be replaced do not matter
        for item in checked.result.errors
        if not (is_import and item.code.startswith("calibration-"))
    ]
    if errors:
        show_findings(checked.result, arguments.format)
        return exit_code_of(checked.result)
    try:
        (_import if is_import else _export)(checked, arguments)
    except (_Refused, CalibrationError, FileRefused) as error:
        sys.stderr.write(f"joshua calibrate {arguments.action}: {error}\n")
        return ExitCode.INVALID
    return ExitCode.OK


def _import(checked: Checked, arguments: argparse.Namespace) -> None:
    place = calibration_place(arguments.emulate)
    path = place(checked.loaded.path, checked.loaded.config.general.id)
    if not path:
        raise _Refused(
            'the file has no general.id to name the calibration after: add id: "my-robot" to general'
        )
    actuators = _actuators(checked)
    chosen = [(*_pair(item, list(actuators)), item) for item in arguments.items]
    read = []
    for node, source, _ in chosen:
        adds = _adds_offset(checked, node)
        calibration = from_lerobot(_read(Path(source)), source=source, servo_adds_offset=adds)
        _require_ids(node, actuators[node], calibration, source)
        read.append((node, calibration))
    nodes = [node for node, _ in read]
    if len(set(nodes)) != len(nodes):
        raise _Refused("one arm is named twice; give each arm one file")
    file = ArmFile(path)
    for node, calibration in read:  # all files are valid here, so either all or none are imported
        file.prepare(node, calibration).commit()
        sys.stdout.write(f"{node}: {len(calibration.motors)} joints written to {path}\n")
    source = shlex.quote(str(checked.loaded.path))
    sys.stdout.write(
        f"The servos are unchanged. Run joshua calibrate --check --config {source} to compare them with the "
        "file.\n"
    )


def _export(checked: Checked, arguments: argparse.Namespace) -> None:
    known = _known(checked, arguments)
    if not known:
        raise _Refused("the file contains no calibration: calibrate the arms first")
    items = arguments.items or list(known)
    pairs = [(node, path) for node, _, path in (item.partition("=") for item in items)]
    for node, path in pairs:
        if node not in known:
            raise _Refused(f"no calibration of {node}; allowed: {', '.join(known)}")
        if not path and len(pairs) > 1:
            raise _Refused(f"several arms need a file each: {node}=PATH, such as {node}={node}.json")
        if path and Path(path).exists() and not arguments.force:
            raise _Refused(f"{path} exists already: choose another name, or add --force to replace it")
    for node, path in pairs:
        text = to_lerobot(known[node], servo_adds_offset=_adds_offset(checked, node)) + "\n"
        if not path:
            sys.stdout.write(text)
            continue
        try:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            Path(path).write_text(text, encoding="utf-8")
        except OSError as error:
            raise _Refused(
                f"{path}: cannot be written ({error.strerror}); name a folder of your own"
            ) from error
        sys.stdout.write(f"{node}: written to {path}\n")


def _known(checked: Checked, arguments: argparse.Namespace) -> dict[str, ArmCalibration]:
    """Return the calibrations that ``--check`` compares with the servos: loaded, or else from the file.

    Raises FileRefused.
    """
    loaded = checked.loaded
    found = {block.node_name: ArmCalibration.from_block(block) for block in loaded.config.calibration.arms}
    path = calibration_place(arguments.emulate)(loaded.path, loaded.config.general.id)
    for entry in loaded.graph.actuators if path else ():
        name = entry.node.node_name
        kept = None if name in found else ArmFile(path).arm(name)
        if kept is not None:
            found[name] = kept
    return found


def _actuators(checked: Checked) -> dict[str, list[int]]:
    """Return the motor ids of each actuator, [] if the block lists none."""
    found = {}
    for entry in checked.loaded.graph.actuators:
        block = getattr(entry.owner, entry.owner.WhichOneof("actuator_config") or "", None)
        found[entry.node.node_name] = list(getattr(block, "motor_ids", ()))
    return found


def _adds_offset(checked: Checked, node: str) -> bool:
    """Return whether the motors of an actuator add their homing offset, as its block declares."""
    return any(
        entry.node.node_name == node and device_block(entry.owner)[2].adds_homing_offset
        for entry in checked.loaded.graph.actuators
    )


def _pair(item: str, nodes: list[str]) -> tuple[str, str]:
    node, equals, path = item.partition("=")
    if not equals and len(nodes) == 1:
        return nodes[0], item
    if not equals or node not in nodes:
        raise _Refused(
            f"{item!r}: expected NODE=PATH with an actuator of the file; allowed: {_list(nodes)}, "
            f"such as {nodes[0] if nodes else 'leader_arm'}=PATH"
        )
    return node, path


def _require_ids(node: str, ids: list[int], calibration: ArmCalibration, source: str) -> None:
    found = sorted(motor.id for motor in calibration.motors)
    if ids and found != sorted(ids):
        raise _Refused(
            f"{source}: contains motors {_list(found)}, but {node} has {_list(sorted(ids))}: it belongs to "
            "another arm"
        )


def _read(path: Path) -> str:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise _Refused(f"{path}: is too large for a calibration; name a calibration file of LeRobot")
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise _Refused(
            f"{path}: cannot be read ({error.strerror}); joshua calibrate import-lerobot lists the files "
            "that exist"
        ) from error
    except UnicodeDecodeError as error:
        raise _Refused(f"{path}: is not a text file; name a calibration file of LeRobot") from error


def _list(items: Iterable[object]) -> str:
    return ", ".join(str(item) for item in items) or "none"
