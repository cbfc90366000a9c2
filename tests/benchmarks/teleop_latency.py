"""From the motion of a leader to the goal on the follower's wire, both arms emulated, by the shipped preset.

The leader's joints move by a known function of time. Each goal that the follower's bus receives belongs to
one moment of that motion; the latency is how long ago that was, by the monotonic clock of the emulators. It
holds the leader's bus, two nodes, one ROS 2 topic, and the follower's bus. The baseline in the same run is a
single loop as LeRobot has it, on the same two emulators: read the leader's positions, write them to the
follower. At 50 Hz two mock cameras of 30 Hz run beside the arms.
Run: python tests/benchmarks/teleop_latency.py [SECONDS [RATE_HZ…]]
"""

from __future__ import annotations

import math
import os
import re
import signal
import statistics
import subprocess
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
# What the nodes transfer from the first servo's position to the goals: six replies of 15 bytes
# and a sync write of two bytes for each servo, at 1 Mbit/s.
BUS_S = (6 * (6 + 15) + 8 + 6 * 3) * 10 / 1e6

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
        # a position is known to half a tick, in which the joint moves for a millisecond
        turns = math.floor((pulse * (heard_s + 0.005) - phase) / math.tau)
        moments.append((phase + math.tau * turns) / pulse)
    return max(moments)


def main() -> None:
    """Runs the rates that the command line names, else three."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    for rate_hz in [float(text) for text in sys.argv[2:]] or (50.0, 100.0, 200.0):
        measure(seconds, rate_hz, cameras=2 if rate_hz <= 50 else 0)


def latencies_s(follower: EmulatedBus, start_s: float, begin_s: float) -> list[float]:
    """The age of the leader's position in each goal that the follower's bus received after a time."""
    found = []
    for entry in follower.ask("log", events=["sync_write"], limit=50_000)["entries"]:
        row = bytes.fromhex(entry["parameters"])
        heard_s = entry["wire_end_ns"] / 1e9
        if row[0] == GOAL_ADDRESS and heard_s >= begin_s:
            moment_s = leader_time_s(int.from_bytes(row[3:5], "little"), heard_s - start_s)
            if moment_s is not None:
                found.append(heard_s - start_s - moment_s)
    if len(found) < 50:
        sys.exit(f"only {len(found)} goals reached the follower's wire")
    return found


def figures(values_s: list[float]) -> str:
    """Median, p90, p99 and maximum in ms."""
    parts = statistics.quantiles(values_s, n=100)
    return (
        f"median {statistics.median(values_s) * 1e3:.2f} ms, p90 {parts[89] * 1e3:.2f} ms, "
        f"p99 {parts[98] * 1e3:.2f} ms, max {max(values_s) * 1e3:.1f} ms ({len(values_s)} goals)"
    )


def measure(seconds: float, rate_hz: float, cameras: int) -> None:
    """Prints the latencies of a single loop and of the two nodes, and the share of ticks in time."""
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
        begin_s = time.monotonic() + 2.0  # the leader approaches its motion first
        loop = Path(__file__).with_name("_single_loop.py")
        command = [sys.executable, str(loop), leader.port, follower.port, str(rate_hz), str(seconds + 2.0)]
        subprocess.run(command, check=True)
        single_s = latencies_s(follower, start_s, begin_s)
        follower.ask("log", clear=True, limit=1)
        with teleoperation(leader, follower, Path(folder), domain_id, overrides=rates, text=text) as process:
            follower.wait_for(["torque"], timeout_s=60.0)
            begin_s = time.monotonic() + SETTLED_S
            time.sleep(SETTLED_S + seconds)
            process.send_signal(signal.SIGINT)
            output, _ = process.communicate(timeout=60)
        if process.returncode != 0:
            sys.exit(f"the run ended with {process.returncode}:\n{output}")
        ours_s = latencies_s(follower, start_s, begin_s)
    load = os.getloadavg()[0]
    print(f"teleoperation at {rate_hz:g} Hz over {seconds:g} s, {cameras} cameras, load average {load:.1f}:")
    print("  leader motion to follower write:")
    print(f"    single loop (baseline)  {figures(single_s)}")
    print(f"    two nodes               {figures(ours_s)}")
    above = [(statistics.median(ours_s) - other) * 1e3 for other in (statistics.median(single_s), BUS_S)]
    print(f"    above the baseline: median {above[0]:.2f} ms, although it reads a seventh of the bytes")
    print(f"    above the bus time of {BUS_S * 1e3:.2f} ms: median {above[1]:.2f} ms; target at most 2 ms")
    for node, overruns, count in re.findall(r"^/(\w+) +timer control .* (\d+) +(\d+)$", output, re.MULTILINE):
        share = 100 * (1 - int(overruns) / (int(count) + int(overruns)))
        print(f"  {node}: {share:.2f} % of {count} ticks in time; target 99.9 %")


if __name__ == "__main__":
    main()
