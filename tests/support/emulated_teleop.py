"""Teleoperation of two emulated arms, by the shipped preset for two SO-ARM100, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from google.protobuf import text_format
from joshua.devices.calibration import ArmCalibration
from joshua.schema import config_pb2
from joshua_emulator import EmulatedBus

JOSHUA = Path(sysconfig.get_path("scripts")) / "joshua"
PRESET = Path(__file__).parents[2] / "configs" / "teleop_so_arm100.pbtxt"
PORT = "robot.actions[{}].{}.comm.serial.port={}"


@contextmanager
def teleoperation(
    leader: EmulatedBus,
    follower: EmulatedBus,
    folder: Path,
    domain_id: int,
    *,
    overrides: tuple[str, ...] = (),
    text: str = "",
    blocks: tuple[str, str] = ("sts3215_config", "sts3215_config"),
    options: tuple[str, ...] = (),
) -> Iterator[subprocess.Popen[str]]:
    """Runs the preset on two emulated arms, with the calibrations that their servos hold.

    Args:
        folder: for the configuration and the run directory.
        domain_id: ROS 2 domain of this run.
        overrides: further values for ``--set``.
        text: of a file in place of the preset's; blocks: of leader and follower in it.
        options: further words of the command line.
    """
    calibration = config_pb2.Config()
    for name, arm in (("leader_arm", leader), ("follower_arm", follower)):
        entry = ArmCalibration.model_validate(arm.calibration()).to_block(name)
        calibration.calibration.arms.append(entry)
    (folder / "calibration.pbtxt").write_text(text_format.MessageToString(calibration))
    config = folder / "teleop.pbtxt"
    config.write_text('include: "calibration.pbtxt"\n' + (text or PRESET.read_text()))
    runtime = folder / "run"
    runtime.mkdir(mode=0o700)
    values = (
        PORT.format(0, blocks[0], leader.port),
        PORT.format(1, blocks[1], follower.port),
        *overrides,
    )
    process = subprocess.Popen(
        [
            str(JOSHUA),
            "--config",
            str(config),
            *(argument for value in values for argument in ("--set", value)),
            *options,
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
        text=True,
        env={
            **os.environ,
            "ROS_DOMAIN_ID": str(domain_id),
            "XDG_RUNTIME_DIR": str(runtime),
            "JOSHUA_LOG_DIR": str(folder / "log"),
        },
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()
