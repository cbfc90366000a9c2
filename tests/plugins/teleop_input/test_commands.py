"""``joshua find-gamepads`` and ``joshua share-gamepad``."""

from __future__ import annotations

import json
import subprocess
import sysconfig
from pathlib import Path

import pytest
from gamepads import wait_until, wait_until_reported
from joshua.cli.main import main
from joshua_emulator import EmulatedGamepad
from joshua_teleop_input import discovery
from joshua_teleop_input.errors import InputDeviceError
from joshua_teleop_input.remote_device import RemoteDevice
from joshua_teleop_input.sharing import GamepadShare
from watched import Watched

JOSHUA = str(Path(sysconfig.get_path("scripts")) / "joshua")


def test_no_gamepad(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(discovery, "DEVICE_FOLDER", tmp_path)
    assert main(["find-gamepads"]) == 4
    assert "no gamepad was found" in capsys.readouterr().out
    assert main(["find-gamepads", "--format", "json"]) == 4
    assert json.loads(capsys.readouterr().out) == []


def test_watching_shows_our_name_and_the_kernels(pad: EmulatedGamepad) -> None:
    command = [JOSHUA, "find-gamepads", "--watch", pad.device]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        watched = Watched(process)
        try:
            watched.wait("press a control to see its name; stop with Ctrl-C")
            pad.fault("dirty")
            watched.wait("ABS_RX               used as right_x")
            watched.wait("BTN_TL               used as left_bumper")
        finally:
            process.kill()
            watched.end()


def test_watching_ends_after_its_time(pad: EmulatedGamepad, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["find-gamepads", "--watch", pad.device, "--duration", "0.1"]) == 0
    assert "Emulated Xbox Controller" in capsys.readouterr().out


def test_watching_what_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["find-gamepads", "--watch", str(tmp_path / "pad.sock")]) == 4
    assert "no gamepad is shared at" in capsys.readouterr().err


def test_a_shared_gamepad_is_the_gamepad(pad: EmulatedGamepad, tmp_path: Path) -> None:
    path = tmp_path / "pad.sock"
    pad.set(left_bumper=1)
    wait_until_reported(pad)
    command = [JOSHUA, "share-gamepad", str(path), "--device", pad.device]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("sharing Emulated Xbox Controller at ")
        assert path.stat().st_mode & 0o777 == 0o600
        device = RemoteDevice(str(path))
        assert device.capabilities.name == "Emulated Xbox Controller"
        assert device.capabilities.held == {0x136}
        pad.set(a=1)
        seen = []
        wait_until(lambda: seen.extend(device.read(0.2)) or any(event.code == 0x130 for event in seen))
        with pytest.raises(InputDeviceError, match="is in use: another program shares a gamepad there"):
            GamepadShare(path)
        device.close()
    finally:
        process.terminate()
        process.communicate()


def test_a_path_that_cannot_be_made(
    pad: EmulatedGamepad, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "none" / "pad.sock"
    assert main(["share-gamepad", str(path), "--device", pad.device]) == 4
    assert "cannot be created: no such file or directory; name another path" in capsys.readouterr().err
