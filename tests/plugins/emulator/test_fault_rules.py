"""Values and settings of faults that a device does not take: each is refused and none is misread."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from joshua.plugins.emulator import EmulatedDevice, FaultRefusedError
from joshua.schema import config_pb2
from joshua_emulator.camera import operations as camera_operations
from joshua_emulator.cli import parse_fault
from joshua_emulator.control import ControlError
from joshua_emulator.devices import ServoBusEmulator
from joshua_emulator.encoder import operations as encoder_operations
from joshua_emulator.fault_rules import FaultRule, check_fault
from joshua_emulator.gamepad import operations as gamepad_operations
from joshua_emulator.lidar import operations as lidar_operations
from joshua_emulator.lidar.models import MODELS
from joshua_emulator.servo_bus import operations as servo_operations
from joshua_emulator.spike import operations as spike_operations

BUS = servo_operations.FAULTS
CAMERA, PAD = camera_operations.FAULTS, gamepad_operations.FAULTS
LINE, AMT21 = (encoder_operations.fault_rules(name) for name in ("line", "amt21"))
LD19, A1 = (lidar_operations.fault_rules(MODELS[name]) for name in ("ld19", "rplidar_a1"))
HUB = spike_operations.fault_rules(("A", "C"))

REFUSED: list[tuple[dict[str, FaultRule], str, str]] = [
    (BUS, "unplug=3", "happen 3 s after the start, write unplug,at_s=3"),
    (BUS, "replug=ttyACM1", "replug takes no value, found 'ttyACM1'; to make it happen 5 s after"),
    (BUS, "unplug=", "unplug takes no value, found ''"),
    (BUS, "silent=", "silent is ''; allowed: a servo id"),
    (BUS, "silent=2.5", "silent is 2.5; allowed: a servo id"),
    (BUS, "duplicate,at_s=2", "duplicate needs a value, as in duplicate=…: a servo id"),
    (BUS, "break_after,at_s=2", "break_after needs a value"),
    (BUS, "drop", "drop needs a value, as in drop=…: a probability from 0 to 1"),
    (BUS, "drop=nan", "drop is nan; allowed: a probability from 0 to 1"),
    (BUS, "drop=0.1,late_by_s=0.1", "drop has no setting 'late_by_s'; allowed: at_s"),
    (BUS, "late=0.1,late_by_s=3", "late: late_by_s is 3; allowed: seconds from 0 to 1"),
    (BUS, "unplug,at=5", "unplug has no setting 'at'; allowed: at_s, "),
    (BUS, "unplug,replug_after=5", "no setting 'replug_after'; allowed: replug_after_s, at_s, name"),
    (BUS, "unplug,replug_after_s=0", "unplug: replug_after_s is 0; allowed: seconds above 0, at most 86400"),
    (BUS, "unplug,at_s=-1", "unplug: at_s is -1; allowed: seconds from 0 to 86400"),
    (BUS, "unplug,at_s=nan", "unplug: at_s is nan; allowed: seconds from 0 to 86400"),
    (BUS, "unplug,at_s=soon", "unplug: at_s is 'soon'; allowed: seconds from 0 to 86400"),
    (BUS, "replug,name=../up", "replug: name is '../up'; allowed: a device name, such as ttyACM3"),
    (CAMERA, "unplug=3", "unplug takes no value, found 3"),
    (CAMERA, "dirty=0.5", "dirty takes no value, found 0.5"),
    (CAMERA, "stall=-1", "stall is -1; allowed: seconds above 0, at most 86400"),
    (CAMERA, "size=1", "size is 1; allowed: WIDTHxHEIGHT, such as 800x600"),
    (CAMERA, "stall=1,replug_after_s=1", "stall has no setting 'replug_after_s'; allowed: at_s"),
    (PAD, "drop=0.1", "drop takes no value, found 0.1"),
    (PAD, "rate=0", "rate is 0; allowed: above 0, at most 1000 Hz"),
    (LINE, "rate=0", "rate is 0; allowed: a line speed of 300 to 4000000 bit/s"),
    (LINE, "rate=9600.5", "rate is 9600.5; allowed: a line speed"),
    (LINE, "no_magnet", "line encoders do not say whether they see a magnet; allowed here: drop, "),
    (AMT21, "freeze", "freeze: amt21 encoders only answer, they send no lines to repeat; allowed here: drop"),
    (LD19, "health=1", "health: ld19 scanners report no health; allowed here: drop, corrupt"),
    (LD19, "old_firmware", "old_firmware: ld19 scanners have one kind of scan only"),
    (A1, "health=1.5", "health is 1.5; allowed: 0 (good), 1 (warning), 2 (error)"),
    (HUB, "stall=B", "stall is 'B'; allowed: A, C"),
    (HUB, "stall", "stall needs a value, as in stall=…: A, C"),
    (HUB, "corrupt=5", "corrupt is 5; allowed: a probability from 0 to 1"),
    (HUB, "battery=7.4", "battery is 7.4; allowed: 0 to 9000 mV"),
    (HUB, "button=2", "button takes no value, found 2"),
    (HUB, "stall=A,replug_after_s=2", "stall has no setting 'replug_after_s'; allowed: at_s"),
]  # fmt: skip


@pytest.mark.parametrize(("rules", "text", "message"), REFUSED, ids=[text for _, text, _ in REFUSED])
def test_what_a_fault_does_not_take_is_refused(rules: dict[str, FaultRule], text: str, message: str) -> None:
    with pytest.raises(ControlError, match=re.escape(message)):
        check_fault(parse_fault(text), rules)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("unplug,op=quit", "fault 'unplug,op=quit': 'op' is not a setting"),
        ("silent,value=3", "'value' is not a setting; write the fault as KIND=VALUE,at_s=5"),
        ("unplug,at_s=1,at_s=5", "at_s is set twice; leave one of them out"),
        ("unplug,at_s=", "'at_s=' needs a value, as in at_s=5"),
    ],
)
def test_what_is_no_fault_is_refused_while_it_is_read(text: str, message: str) -> None:
    with pytest.raises(ControlError, match=re.escape(message)):
        parse_fault(text)


@pytest.mark.parametrize(
    ("rules", "text"),
    [
        (BUS, "unplug,at_s=5,replug_after_s=2,name=ttyACM7"),
        (BUS, "late=0.05,late_by_s=0.03"),
        (BUS, "silent"),
        (BUS, "overload=3,at_s=2"),
        (CAMERA, "stall=1,at_s=2"),
        (CAMERA, "size=800x600"),
        (LINE, "dirty=300"),
        (AMT21, "rate=9600"),
        (A1, "old_firmware"),
        (HUB, "out_of_range,at_s=5,replug_after_s=3"),
        (HUB, "firmware=old"),
    ],
)
def test_the_faults_of_the_guides_are_taken(rules: dict[str, FaultRule], text: str) -> None:
    check_fault(parse_fault(text), rules)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("unplug=3", "--fault arm: unplug takes no value, found 3"),
        ("overload=9,at_s=2", "no servo has the id 9; there are 1, 2"),
    ],
)
def test_an_arm_is_not_started_with_a_fault_that_does_not_fit(
    tmp_path: Path, fault: str, message: str
) -> None:
    block = config_pb2.STS3215Config(motor_ids=[1, 2])
    emulator = ServoBusEmulator(EmulatedDevice("arm", "ACTION_FOLLOWER", block, tmp_path, (fault,)))
    with pytest.raises(FaultRefusedError, match=re.escape(message)):
        emulator.start()
    emulator.close()
