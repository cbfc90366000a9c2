"""From an event of a gamepad to the joint command on the wire, by the real program.

An emulated gamepad reports at 50 Hz and notes when each report has left it. Its stick goes from rest to full
deflection and back, at moments that have nothing to do with the control period. Two times are taken at a
subscriber in another process, by the monotonic clock: from the report to the first command whose goal moves,
and from the report of the release to the last command whose goal moved. The reference is the control period
of the same run, the median distance of two commands while the stick rests.
Run: python tests/benchmarks/gamepad_latency.py [STROKES]
"""

from __future__ import annotations

import os
import random
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from joshua.messages import decode
from joshua.plan import QosProfile, TransportSettings
from joshua.testing.program import JoshuaProgram
from joshua.transport import open_transport
from joshua_emulator import EmulatedGamepad

STROKES = 100
RATE_HZ = 50
JOINT_STATE = "sensor_msgs/msg/JointState"
ROBOT = """
general { mode: MODE_TELEOPERATE id: "bench" }
robot {
  actions {
    node {
      node_name: "arm" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: @HZ@ }
      subscriptions { data_type: JOINT_STATE topic_name: "/command" }
    }
    action_type: ACTION_SINGLE
    mock_motor_config { num_motors: 1 position_max: 4095 }
  }
  perceptions {
    node {
      node_name: "gamepad" node_id: 2
      publishers { data_type: JOINT_STATE topic_name: "/command" publish_rate_hz: @HZ@ }
      subscriptions { data_type: JOINT_STATE topic_name: "/arm/joint_states" }
    }
    perception_type: PERCEPTION_GAMEPAD
    gamepad_config {
      device: "DEVICE"
      dead_man_button: "left_bumper"
      controls { positive: "left_x" joint: "joint_1" speed_rad_s: 0.5 }
    }
  }
}
"""


def main() -> None:
    """Prints both times beside the control period."""
    strokes = int(sys.argv[1]) if len(sys.argv) > 1 else STROKES
    with tempfile.TemporaryDirectory() as name, EmulatedGamepad(RATE_HZ) as pad:
        folder, domain_id = Path(name), random.randrange(102, 220)
        text = ROBOT.replace("DEVICE", pad.device).replace("@HZ@", str(RATE_HZ))
        (folder / "robot.pbtxt").write_text(text)
        program = JoshuaProgram(folder, domain_id)
        run = program.start("--config", "robot.pbtxt")
        try:
            spec = TransportSettings(domain_id=domain_id, listen_endpoints=(program.router,))
            commands: list[tuple[int, float]] = []
            transport = connect(spec, commands)
            move(pad, strokes)
            transport.close()
        finally:
            output, errors = program.stop(run)
        if run.returncode != 0 or not commands:
            sys.exit(f"the run ended with {run.returncode}:\n{output}{errors}")
        show(pad.log("report"), commands)


def connect(spec: TransportSettings, commands: list[tuple[int, float]]) -> Any:
    """Hears every command with the time of its arrival, once the run hosts its router."""

    def hear(sample: Any) -> None:
        commands.append((time.monotonic_ns(), float(decode(JOINT_STATE, sample.cdr).position[0])))

    deadline_s = time.monotonic() + 60
    while time.monotonic() < deadline_s:
        transport = open_transport(spec)
        if transport.connected:
            transport.create_node("ear").create_subscription("/command", JOINT_STATE, QosProfile(), hear)
            return transport
        transport.close()
        time.sleep(0.1)
    sys.exit("the run hosts no router")


def move(pad: EmulatedGamepad, strokes: int) -> None:
    """Deflects the stick to one side after the other, at random moments."""
    time.sleep(2.0)
    pad.set(left_bumper=1)
    time.sleep(1.0)
    for stroke in range(strokes):
        pad.set(left_x=1.0 if stroke % 2 else -1.0)
        time.sleep(random.uniform(0.15, 0.25))
        pad.set(left_x=0.0)
        time.sleep(random.uniform(0.15, 0.25))


def show(reports: list[dict[str, Any]], commands: list[tuple[int, float]]) -> None:
    """Pairs reports of the stick with commands."""
    sticks = [(entry["t_ns"], value) for entry in reports for code, value in entry["changes"] if code == 0]
    moved = [at for (at, goal), (_, before) in zip(commands[1:], commands, strict=False) if goal != before]
    rests = [
        (at - before) / 1e6
        for (at, goal), (before, old) in zip(commands[1:], commands, strict=False)
        if goal == old and at - before > 0.5e9 / RATE_HZ
    ]
    period_ms = statistics.median(rests)
    begins, ends = [], []
    for (at, value), (following, _) in zip(sticks, [*sticks[1:], (10**20, 0)], strict=True):
        between = [moment for moment in moved if at <= moment < following]
        if value:
            begins.append((between[0] - at) / 1e6)
        else:
            ends.append((between[-1] - at) / 1e6 if between else 0.0)
    load = os.getloadavg()[0]
    print(f"gamepad at {RATE_HZ} Hz, load average {load:.1f}; the control period is {period_ms:.2f} ms")
    for title, times in (("deflection to moving goal", begins), ("release to resting goal", ends)):
        times.sort()
        p99, worst = times[int(0.99 * (len(times) - 1))], times[-1]
        print(
            f"  {title}: median {statistics.median(times):.2f} ms, p99 {p99:.2f} ms, max {worst:.2f} ms; "
            f"p99 is {p99 / period_ms:.2f} of the period (target 1.00), {len(times)} events"
        )


if __name__ == "__main__":
    main()
