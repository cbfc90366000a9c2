"""With ``display`` a window shows the scans, on a virtual screen whose memory is read back."""

from __future__ import annotations

import importlib.util
import os
import shutil
import signal
import struct
import subprocess
import sysconfig
import time
from pathlib import Path

import numpy as np
import pytest
from joshua.testing.port import free_port

JOSHUA = Path(sysconfig.get_path("scripts")) / "joshua"
PRESET = Path(__file__).parents[2] / "configs" / "test_lidar.pbtxt"
TINT = (226, 238, 250)  # of what the beams passed through


def pixels_of(memory: Path, colour: tuple[int, int, int]) -> int:
    """How many pixels of the screen have a colour (X window dump format, 32 bits a pixel)."""
    data = memory.read_bytes()
    header = struct.unpack(">25I", data[:100])
    start = header[0] + 12 * header[19]
    pixels = np.frombuffer(data, np.uint8, 4 * header[4] * header[5], start).reshape(-1, 4)
    return int((pixels[:, 2::-1] == colour).all(axis=1).sum())


@pytest.mark.skipif(
    shutil.which("Xvfb") is None or importlib.util.find_spec("tkinter") is None,
    reason="a window needs a screen: Xvfb and tkinter (apt install xvfb python3-tk)",
)
def test_the_window_shows_the_room(tmp_path: Path, joshua_domain_id: int) -> None:
    screen = subprocess.Popen(
        ["Xvfb", "-displayfd", "1", "-screen", "0", "800x700x24", "-fbdir", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    runtime = tmp_path / "run"
    runtime.mkdir(mode=0o700)
    try:
        assert screen.stdout is not None
        environment = os.environ | {
            "DISPLAY": f":{screen.stdout.readline().strip()}",
            "ROS_DOMAIN_ID": str(joshua_domain_id),
            "XDG_RUNTIME_DIR": str(runtime),
            "XDG_STATE_HOME": str(tmp_path / "state"),
            "JOSHUA_LOG_DIR": str(tmp_path / "log"),
        }
        command = [str(JOSHUA), "--config", str(PRESET), "--emulate", "--duration", "200"]
        command += ["--set", f'transport.listen_endpoints="tcp/localhost:{free_port()}"']
        run = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=environment,
        )
        deadline_s = time.monotonic() + 150
        most = 0
        while run.poll() is None and most < 20_000 and time.monotonic() < deadline_s:
            most = max(most, pixels_of(tmp_path / "Xvfb_screen0", TINT))
            time.sleep(0.1)
        run.send_signal(signal.SIGINT)
        output = run.communicate(timeout=60)[0].decode()
        assert most >= 20_000, output
        deadline_s = time.monotonic() + 60
        while pixels_of(tmp_path / "Xvfb_screen0", TINT):  # closed with the run
            assert time.monotonic() < deadline_s
            time.sleep(0.05)
    finally:
        screen.terminate()
        screen.communicate()
