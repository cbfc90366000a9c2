"""From the motion of a leader to the goal on the follower's wire, both arms emulated, by the shipped preset.

The leader's joints move by a known function of time. Each goal that the follower's bus hears belongs to one
moment of that motion; the latency is how long ago that was, by the monotonic clock of the emulators. It holds
the leader's sampling, two nodes, one ROS 2 topic, and the follower's cycle.
At 50 Hz two mock cameras of 30 Hz run beside the arms, at 200 Hz none.
Run: python tests/benchmarks/teleop_latency.py [SECONDS [RATE_HZ]]
"""

from __future__ import annotations

import math
import os
import re
import signal
import statistics
import sys
import tempfile
import time
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "support"))

from emulated_teleop import PRESET, teleoperation
from joshua.testing.domain import reserved_domain
from joshua_emulator import EmulatedBus

AMPLITUDE_RAD, FREQUENCY_HZ = 0.4, 0.4  # at most 1.0 rad/s, below the preset's speed limit
SETTLED_S = 6.0  # from here on the follower has finished its approach
GOAL_ADDRESS = 42

CAMERA = """
  perceptions {{
    node {{
      node_name: "camera_{index}" node_id: {index}
      qos {{ reliability: BEST_EFFORT depth: 1 }}
      publishers {{ data_type: IMAGE topic_name: "/camera_{index}/image_raw" publish_rate_hz: 30 }}
    }}
    perception_type: PERCEPTION_CAMERA
    mock_camera_config {{ width: 640 height: 480 fps: 30 }}
  }}
"""


def leader_time_s(goal_ticks: int, heard_s: float) -> float | None:
    """When the first joint of the leader last stood at a position; None near its turning points."""
    share = (goal_ticks - 2048) * math.tau / 4096 / AMPLITUDE_RAD
    if abs(share) > 0.8:
        return None
    pulse = math.tau * FREQUENCY_HZ
    moments = []
    for phase in (math.asin(share), math.pi - math.asin(share)):
        turns = math.floor((pulse * heard_s - phase) / math.tau)
        moments.append((phase + math.tau * turns) / pulse)
    return max(moments)


def main() -> None:
    """Runs the rates that the command line names, else both."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    for rate_hz in [float(text) for text in sys.argv[2:]] or (50.0, 200.0):
        measure(seconds, rate_hz, cameras=2 if rate_hz <= 50 else 0)


def measure(seconds: float, rate_hz: float, cameras: int) -> None:
    """Prints median, p99 and maximum, and the share of ticks in time."""
    more = "".join(CAMERA.format(index=100 + number) for number in range(cameras))
    text = PRESET.read_text().replace("robot {", f"robot {{{more}", 1)
    rates = tuple(f"robot.actions[{arm}].node.publishers[0].publish_rate_hz={rate_hz}" for arm in (0, 1))
    motion = f"sine,amplitude_rad={AMPLITUDE_RAD},frequency_hz={FREQUENCY_HZ}"
    with (
        reserved_domain() as domain_id,
        tempfile.TemporaryDirectory() as folder,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="LEADER", motion=motion) as leader,
        EmulatedBus(arm="so_arm100", calibrated=True, identity="FOLLOWER") as follower,
    ):
        start_s = leader.log("motion")[-1]["t_ns"] / 1e9
        with teleoperation(leader, follower, Path(folder), domain_id, overrides=rates, text=text) as process:
            follower.wait_for(["torque"], timeout_s=60.0)
            begin_s = time.monotonic() + SETTLED_S
            time.sleep(SETTLED_S + seconds)
            process.send_signal(signal.SIGINT)
            output, _ = process.communicate(timeout=60)
        latencies = []
        for entry in follower.ask("log", events=["sync_write"], limit=50_000)["entries"]:
            row = bytes.fromhex(entry["parameters"])
            heard_s = entry["wire_end_ns"] / 1e9
            if row[0] != GOAL_ADDRESS or heard_s < begin_s:
                continue
            moment_s = leader_time_s(int.from_bytes(row[3:5], "little"), heard_s - start_s)
            if moment_s is not None:
                latencies.append(heard_s - start_s - moment_s)
    if process.returncode != 0 or len(latencies) < 100:
        sys.exit(f"the run ended with {process.returncode}:\n{output}")
    figures = (
        f"median {statistics.median(latencies) * 1e3:.1f} ms, "
        f"p99 {statistics.quantiles(latencies, n=100)[98] * 1e3:.1f} ms, max {max(latencies) * 1e3:.1f} ms"
    )
    load = os.getloadavg()[0]
    print(f"teleoperation at {rate_hz:g} Hz over {seconds:g} s, {cameras} cameras, load average {load:.1f}:")
    period_ms = 1e3 / rate_hz
    targets = f"target: median at most {period_ms + 3:g} ms, p99 at most {2 * period_ms:g} ms"
    print(f"  leader motion to follower write: {figures} ({len(latencies)} goals); {targets}")
    for node, overruns, count in re.findall(r"^/(\w+) +timer control .* (\d+) +(\d+)$", output, re.MULTILINE):
        share = 100 * (1 - int(overruns) / (int(count) + int(overruns)))
        print(f"  {node}: {share:.2f} % of {count} ticks in time; target 99.9 %")


if __name__ == "__main__":
    main()
