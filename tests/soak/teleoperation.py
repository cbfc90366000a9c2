"""Teleoperation on lines that lose, damage and delay replies: nothing wrong is believed, nothing jumps.

Both arms are emulated; 1 % of the replies are dropped, 0.5 % corrupt, 0.5 % late. The leader moves by a known
function of time, so that every position that its driver publishes can be compared with the truth.
Run: python tests/soak/teleoperation.py [SECONDS]
"""

from __future__ import annotations

import math
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "support"))

from emulated_teleop import teleoperation
from joshua.messages import decode
from joshua.plan import QosProfile, TransportSettings
from joshua.testing.domain import reserved_domain
from joshua.transport import open_transport
from joshua_emulator import EmulatedBus

JOINT_STATE = "sensor_msgs/msg/JointState"
TOPICS = ("/leader/joint_states", "/follower/joint_states", "/follower_arm/applied_command")
FAULTS = ["drop=0.01", "corrupt=0.005", "late=0.005"]
AMPLITUDE_RAD, FREQUENCY_HZ, PHASE_RAD = 0.4, 0.4, 0.7

#: The preset's speed limit of the follower: 1000 ticks/s.
SPEED_LIMIT_RAD_S = 1000 * math.tau / 4096

#: The leader's fastest motion in 40 ms: a joint that was asked again is that much younger than the stamp of
#: its reading, or older where the machine was busy. One wrong bit from the fifth on is more than this.
TRUTH_TOLERANCE_RAD = AMPLITUDE_RAD * math.tau * FREQUENCY_HZ * 0.04

#: How far a step may seem to go beyond the speed limit: by those 40 ms in what servos report, by one tick and
#: the spread of a timer in what they are told.
STEP_TOLERANCE_RAD = {
    "/leader/joint_states": TRUTH_TOLERANCE_RAD,
    "/follower/joint_states": TRUTH_TOLERANCE_RAD,
    "/follower_arm/applied_command": 0.01,
}


@dataclass
class Track:
    """What one topic said.

    Attributes:
        count: messages; worst_step_rad: largest step beyond what the speed limit allows.
        worst_error_rad: largest distance from the truth; wrong: messages beyond the tolerance.
    """

    count: int = 0
    worst_step_rad: float = -math.inf
    worst_error_rad: float = 0.0
    wrong: int = 0
    _last: Any = field(default=None, repr=False)

    def step(self, stamp_s: float, position: Any) -> None:
        """Compares a position with the one before."""
        self.count += 1
        if self._last is not None:
            last_s, last = self._last
            excess = np.abs(position - last) - SPEED_LIMIT_RAD_S * (stamp_s - last_s)
            self.worst_step_rad = max(self.worst_step_rad, float(excess.max()))
        self._last = (stamp_s, position)

    def compare(self, position: Any, truth: Any) -> None:
        """Compares a position with the truth."""
        error = float(np.abs(position - truth).max())
        self.worst_error_rad = max(self.worst_error_rad, error)
        self.wrong += error > TRUTH_TOLERANCE_RAD


def main() -> None:
    """Prints what was seen; exit code 1 where a requirement is broken."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 600.0
    motion = f"sine,amplitude_rad={AMPLITUDE_RAD},frequency_hz={FREQUENCY_HZ}"
    tracks = {name: Track() for name in TOPICS}
    with (
        reserved_domain() as domain_id,
        tempfile.TemporaryDirectory() as folder,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="L", motion=motion, fault=FAULTS) as leader,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="F", fault=FAULTS, seed=1) as follower,
    ):
        start_s = leader.log("motion")[-1]["t_ns"] / 1e9
        with teleoperation(leader, follower, Path(folder), domain_id) as process:
            follower.wait_for(["torque"], timeout_s=60.0)
            transport = listen(tracks, domain_id, start_s)
            time.sleep(seconds)
            transport.close()
            process.send_signal(signal.SIGINT)
            output, _ = process.communicate(timeout=60)
    problems = judge(tracks, process.returncode, output)
    for name, track in tracks.items():
        step = f"largest step beyond the speed limit {track.worst_step_rad:+.4f} rad"
        error = f", largest error {track.worst_error_rad:.4f} rad" if track.worst_error_rad else ""
        print(f"{name}: {track.count} messages, {step}{error}")
    verdict = "; ".join(problems) or "nothing wrong"
    print(f"{seconds:g} s, load average {os.getloadavg()[0]:.1f}: {verdict}")
    sys.exit(1 if problems else 0)


def listen(tracks: dict[str, Track], domain_id: int, start_s: float) -> Any:
    """Subscribes to the topics; returns the transport."""
    transport = open_transport(TransportSettings(domain_id=domain_id))
    while not transport.connected:
        time.sleep(0.05)
    node = transport.create_node("soak")
    epoch_s = time.time() - time.monotonic()

    def take(name: str) -> Callable[[Any], None]:
        track = tracks[name]

        def on_sample(sample: Any) -> None:
            message = decode(JOINT_STATE, sample.cdr)
            stamp_s = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9 - epoch_s
            position = np.array(message.position)
            track.step(stamp_s, position)
            if name.startswith("/leader"):
                track.compare(position, truth_rad(stamp_s - start_s, len(position)))

        return on_sample

    for name in tracks:
        node.create_subscription(name, JOINT_STATE, QosProfile(), take(name))
    return transport


def truth_rad(time_s: float, joints: int) -> Any:
    """Where the hand has the leader's joints."""
    phases = PHASE_RAD * np.arange(joints)
    return min(1.0, time_s) * AMPLITUDE_RAD * np.sin(math.tau * FREQUENCY_HZ * time_s + phases)


def judge(tracks: dict[str, Track], exit_code: int, output: str) -> list[str]:
    """What broke a requirement."""
    problems = [f"{name} was silent" for name, track in tracks.items() if track.count < 10]
    problems += [f"{track.wrong} wrong positions on {name}" for name, track in tracks.items() if track.wrong]
    problems += [
        f"{name} jumped by {track.worst_step_rad:.3f} rad beyond the speed limit"
        for name, track in tracks.items()
        if track.worst_step_rad > STEP_TOLERANCE_RAD[name]
    ]
    if "restarted" in output or "starts again" in output:
        problems.append("a node was restarted")
    if exit_code != 0:
        problems.append(f"the run ended with {exit_code}:\n{output}")
    return problems


if __name__ == "__main__":
    main()
