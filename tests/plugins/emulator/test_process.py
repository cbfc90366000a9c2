"""The emulator as a process: names of the port, unplugging, the control channel, its end."""

import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from joshua_emulator import EmulatedBus, EmulatorError


def is_running(number: int) -> bool:
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:  # gone, perhaps between two looks
        return False


def wait_gone(path: str) -> None:
    deadline_s = time.monotonic() + 60
    while os.path.lexists(path):
        assert time.monotonic() < deadline_s
        time.sleep(0.005)


def test_the_names_are_those_of_a_linux_host() -> None:
    with EmulatedBus(ids=(1,), identity="SN42", name="ttyUSB7") as bus:
        assert bus.port == str(bus.root / "dev" / "ttyUSB7")
        assert Path(bus.by_id).resolve() == Path(bus.port).resolve()
        usb = (bus.root / "sys/class/tty/ttyUSB7/device").resolve().parent
        assert (usb / "serial").read_text().strip() == "SN42"
        assert (usb / "idVendor").read_text().strip() == "1a86"


def test_unplug_hangs_up_and_replug_takes_another_name() -> None:
    with EmulatedBus(ids=(1,)) as bus:
        port = os.open(bus.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        bus.fault("unplug", replug_after_s=0.05, name="ttyACM5")
        wait_gone(bus.port)
        assert select.select([port], [], [], 60)[0] == [port]
        with pytest.raises(OSError, match="Input/output error"):
            os.write(port, b"x")
        os.close(port)
        bus.wait_for(["plug"], since=bus.log("unplug")[-1]["sequence"])
        assert bus.ask("state")["port"].endswith("ttyACM5")
        assert Path(bus.by_id).resolve() == (bus.root / "dev/ttyACM5").resolve()


@pytest.mark.parametrize("options", [{"identity": "../../a"}, {"name": "../a"}])
def test_a_name_that_leads_out_of_the_folder_is_refused(options: dict[str, str]) -> None:
    bus = EmulatedBus(ids=(1,), **options)
    with pytest.raises(EmulatorError, match=f"{next(iter(options.values()))}' cannot be a file name"):
        bus.start()


def test_a_fault_can_wait_for_its_time() -> None:
    with EmulatedBus(ids=(1,), fault=["unplug,at_s=0.1"]) as bus:
        bus.wait_for(["unplug"])
        wait_gone(bus.port)


def test_a_motion_of_the_hand_shows_in_the_positions() -> None:
    with EmulatedBus(ids=(1, 2), motion="sine,amplitude_rad=1,frequency_hz=5") as bus:
        seen = set()
        deadline_s = time.monotonic() + 60
        while len(seen) < 5 and time.monotonic() < deadline_s:
            seen.add(bus.servo(1)["present_position"])
        assert len(seen) >= 5
        bus.ask("motion", kind="none")
        assert bus.servo(1)["present_position"] == bus.servo(1)["present_position"]


def test_a_calibrated_arm_has_the_middle_of_each_range_at_2048() -> None:
    with EmulatedBus(arm="so_arm100", calibrated=True, identity="SN1") as bus:
        servos = bus.servos()
        assert [servo["joint"] for servo in servos][:2] == ["shoulder_pan", "shoulder_lift"]
        assert {servo["present_position"] for servo in servos} == {2048}
        assert len({servo["homing_offset"] for servo in servos}) > 3


@pytest.mark.parametrize(
    ("operation", "values", "message"),
    [
        ("dance", {}, "unknown operation 'dance'; allowed: state, registers"),
        ("hand", {"id": 9, "ticks": 1}, "no servo has the id 9; there are 1, 2"),
        ("hand", {"id": 1}, "'radians' is missing or unknown"),
        ("fault", {"kind": "melt"}, "unknown fault 'melt'; allowed: drop, drop_request"),
        ("fault", {"kind": "silent", "value": 7, "at_s": 1}, "no servo has the id 7"),
        ("fault", {"kind": "drop", "value": 2}, "a probability from 0 to 1"),
        ("motion", {"kind": "waltz"}, "unknown motion 'waltz'; allowed: none, sine, sweep, file"),
        ("set", {"volts": "many"}, "a value is wrong"),
        ("set", {"volts": float("nan")}, "NaN is no finite number"),
        ("set_register", {"name": "goal_position", "value": 1 << 40}, "a number is too large"),
        ("set_register", {"name": "baudrate", "value": 99}, "no line speed has the code 99; allowed: 0, 1"),
    ],
)
def test_wrong_requests_are_answered_with_a_reason(
    operation: str, values: dict[str, object], message: str
) -> None:
    with EmulatedBus(ids=(1, 2)) as bus, pytest.raises(EmulatorError, match=message):
        bus.ask(operation, **values)


def test_a_wrong_start_is_reported(tmp_path: Path) -> None:
    (tmp_path / "eeprom.json").write_text("no json")
    with pytest.raises(
        EmulatorError, match=r"did not start: joshua-emulator: .*eeprom\.json: is not an EEPROM file"
    ):
        EmulatedBus(eeprom=tmp_path / "eeprom.json").start()


def test_the_process_ends_with_its_parent_even_by_sigkill(tmp_path: Path) -> None:
    program = (
        "import sys, time\nfrom joshua_emulator import EmulatedBus\n"
        "bus = EmulatedBus(ids=(1,)); bus.start(); print(bus.pid, bus.root, flush=True); time.sleep(60)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    pid, root = parent.stdout.readline().split()
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    deadline_s = time.monotonic() + 60
    while is_running(int(pid)):
        assert time.monotonic() < deadline_s
        time.sleep(0.01)
    assert not Path(root).exists()


@pytest.mark.parametrize("device", ["feetech", "camera", "gamepad", "spike"])
def test_a_stop_before_the_loop_begins_is_not_lost(tmp_path: Path, device: str) -> None:
    program = (
        "import gc, os, signal, sys\nfrom joshua_emulator.cli import main\n"
        "gc.freeze = lambda: os.kill(os.getpid(), signal.SIGTERM)\n"  # the last step before the loop
        "sys.exit(main(sys.argv[1:]))\n"
    )
    command = [sys.executable, "-c", program, device, "--root", str(tmp_path)]
    stopped = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)
    assert stopped.returncode == 0, stopped.stderr


def test_closing_twice_leaves_nothing() -> None:
    bus = EmulatedBus(ids=(1,))
    bus.start()
    root = bus.root
    bus.close()
    bus.close()
    assert not root.exists()
