"""The gamepad as a sensor, at an emulated one in a process of its own."""

from __future__ import annotations

import errno
import os
import socket
import threading
import time
from pathlib import Path

import pytest
from gamepads import STICK, gamepad_settings, wait_until, wait_until_reported
from joshua.devices.errors import DeviceDisconnected
from joshua.devices.sensor import Sensor
from joshua.guardian.silence import AwakeClock
from joshua.testing import check_sensor
from joshua_emulator import EmulatedGamepad
from joshua_teleop_input.errors import InputDeviceError
from joshua_teleop_input.gamepad import Gamepad
from joshua_teleop_input.pad_state import PadState
from joshua_teleop_input.remote_device import RemoteDevice
from joshua_teleop_input.settings import GamepadSettings


def settings_for(pad: EmulatedGamepad, block: str = STICK) -> GamepadSettings:
    return gamepad_settings(f'device: "{pad.device}" {block}')


def read_until(gamepad: Gamepad, condition: object, timeout_s: float = 60.0) -> PadState:
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        reading = gamepad.read(0.2)
        if reading is not None and condition(reading.data):  # type: ignore[operator]
            state = reading.data
            assert isinstance(state, PadState)
            return state
    raise AssertionError("no such state came")


def test_it_keeps_the_contract_of_sensors(pad: EmulatedGamepad) -> None:
    pad.ask("motion", kind="demonstration")
    settings = settings_for(pad)
    pad.ask("state")

    def unplug(_: Sensor) -> None:
        pad.fault("unplug")

    check_sensor(lambda: Gamepad(settings), unplug=unplug, timeout_s=30)


def test_it_follows_sticks_and_buttons(pad: EmulatedGamepad) -> None:
    gamepad = Gamepad(settings_for(pad))
    gamepad.connect()
    try:
        pad.set(left_x=0.5, left_y=1.0, a=1)
        state = read_until(gamepad, lambda state: state.pressed("a"))
        assert state.value("left_x") == pytest.approx(0.5, abs=0.001)
        assert state.value("left_y") == pytest.approx(1.0, abs=0.001)
        pad.set(a=0)
        read_until(gamepad, lambda state: not state.pressed("a"))
    finally:
        gamepad.disconnect()


def test_it_says_how_it_was_found(pad: EmulatedGamepad) -> None:
    pad.fault("dirty")
    wait_until_reported(pad)
    gamepad = Gamepad(settings_for(pad))
    gamepad.connect()
    try:
        first = gamepad.read(30.0)
        assert first is not None
        assert first.data.pressed("left_bumper")
        assert first.data.value("left_x") == pytest.approx(1.0)
    finally:
        gamepad.disconnect()


def test_a_silent_sender_is_not_trusted(pad: EmulatedGamepad) -> None:
    gamepad = Gamepad(settings_for(pad))
    gamepad.connect()
    try:
        pad.set(left_x=1.0)
        read_until(gamepad, lambda state: state.value("left_x") > 0.9)
        pad.fault("stall")
        assert read_until(gamepad, lambda state: not state.live).value("left_x") == 0.0
        pad.ask("clear_faults")
        assert read_until(gamepad, lambda state: state.live).value("left_x") == pytest.approx(1.0)
    finally:
        gamepad.disconnect()


def test_a_sender_that_stays_silent_is_lost(pad: EmulatedGamepad) -> None:
    gamepad = Gamepad(settings_for(pad))
    gamepad.connect()
    try:
        pad.fault("stall")
        with pytest.raises(DeviceDisconnected, match="no data from the sender"):
            read_until(gamepad, lambda _: False)
    finally:
        gamepad.disconnect()


def test_a_machine_that_gives_nobody_its_time_is_no_loss(pad: EmulatedGamepad) -> None:
    path = pad.device
    device = RemoteDevice(path)
    try:
        pad.fault("stall")
        while device.read(0.2):
            pass
        held_up_s = 0.0
        device._awake = AwakeClock(lambda: time.monotonic() + held_up_s)
        device._heard_s = device._awake.now_s()
        held_up_s = 30.0  # the sender has shown no sign of life meanwhile, for it was held up, too
        assert device.read(0.0) == []
        pad.ask("clear_faults")
        wait_until(lambda: device.read(0.2), "a sign of life")
    finally:
        device.close()


def test_lost_records_end_the_connection(pad: EmulatedGamepad) -> None:
    gamepad = Gamepad(settings_for(pad))
    gamepad.connect()
    try:
        pad.set(left_x=1.0)
        read_until(gamepad, lambda state: state.value("left_x") > 0.9)
        pad.fault("drop")
        with pytest.raises(DeviceDisconnected, match="the sender has lost records"):
            read_until(gamepad, lambda _: False)
        pad.set(left_x=0.25)
        wait_until_reported(pad)
        gamepad.connect()
        first = gamepad.read(30.0)
        assert first is not None
        assert first.data.value("left_x") == pytest.approx(0.25, abs=0.001)
    finally:
        gamepad.disconnect()


def test_an_axis_that_the_device_lacks_is_named(pad: EmulatedGamepad) -> None:
    settings = settings_for(pad, 'controls { positive: "paddle_1" joint: "pan" speed_rad_s: 1 }')
    with pytest.raises(
        InputDeviceError, match=r"Emulated Xbox Controller .* has no paddle_1; it has .*left_x"
    ):
        Gamepad(settings).connect()


def test_nobody_shares_a_gamepad_there(tmp_path: Path) -> None:
    settings = gamepad_settings(f'device: "{tmp_path}/pad.sock"')
    with pytest.raises(InputDeviceError, match=r"no gamepad is shared at .*no such file.*share-gamepad"):
        Gamepad(settings).connect()


@pytest.mark.parametrize(
    ("said", "problem"),
    [
        (b"", "does not describe its gamepad"),
        (b"SSH-2.0-OpenSSH\n", "is not a shared gamepad: its data begin with"),
        (b"x" * 70_000, "is not a shared gamepad"),
    ],
)
def test_another_program_at_the_socket_is_named(tmp_path: Path, said: bytes, problem: str) -> None:
    path = tmp_path / "pad.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(str(path))
        listener.listen()

        def answer() -> None:
            client, _ = listener.accept()
            with client:
                client.sendall(said)

        thread = threading.Thread(target=answer)
        thread.start()
        with pytest.raises(InputDeviceError, match=problem):
            Gamepad(gamepad_settings(f'device: "{path}"')).connect()
        thread.join()


def test_a_socket_of_another_user(pad: EmulatedGamepad, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: socket.socket, address: str) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    gamepad = Gamepad(settings_for(pad))
    monkeypatch.setattr(socket.socket, "connect", refuse)
    with pytest.raises(InputDeviceError, match="may not be opened by this user: let the same user share it"):
        gamepad.connect()
