"""Commands at their rate while a model takes 0.3 s a chunk, and what the loop adds to the model's own time.

A toy policy drives a mock arm, with one camera of 640 by 480: once it sleeps for its 0.3 s, once it computes
on every core. A subscription notes the stamp of each command; a command is in its budget if it is published
at most a quarter of a period after its place on the grid. The bare loop in the same run calls the same policy
and nothing else.
Run: python tests/benchmarks/inference_loop.py [SECONDS [RATE_HZ [granted]]]
With ``granted`` the run takes the system for one whose limits grant real-time priority; for a user who may
take it.
"""

from __future__ import annotations

import json
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1] / "support/toy_policy"))

import numpy as np
from joshua.api import JointSpace, Observation
from joshua.messages import decode
from joshua.plan import QosProfile
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from joshua.testing.transport import transport_settings
from joshua.transport import open_transport
from toy_policy.model import ToyPolicy
from toy_policy.settings import ToySettings

TOY = Path(__file__).resolve().parents[1] / "support/toy_policy"
LATENCY_S = 0.3
BUDGET = 0.25  # of a period
JOINT_STATE = "sensor_msgs/msg/JointState"
FILE = """
general {{ mode: MODE_INFERENCE robot_type: "toy" name: "toy" id: "toy" }}
robot {{
  actions {{
    node {{
      node_name: "arm" node_id: 1
      publishers {{ data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 }}
      subscriptions {{ data_type: JOINT_STATE topic_name: "/ai/actions" }}
    }}
    action_type: ACTION_MOCK
    mock_motor_config {{ num_motors: 6 position_max: 4095 }}
  }}
  perceptions {{
    node {{
      node_name: "camera_top" node_id: 2
      publishers {{ data_type: IMAGE topic_name: "/camera/top/image_raw" publish_rate_hz: 30 }}
    }}
    perception_type: PERCEPTION_CAMERA
    mock_camera_config {{ width: 640 height: 480 fps: 30 }}
  }}
}}
ai {{
  models {{
    model_type: MODEL_PLUGIN
    node {{
      node_name: "policy" node_id: 3
      publishers {{ data_type: JOINT_STATE topic_name: "/ai/actions" publish_rate_hz: {rate_hz} }}
      subscriptions {{ data_type: IMAGE topic_name: "/camera/top/image_raw" }}
    }}
    plugin_config {{ [type.example.org/toy.PolicyConfig] {{ latency_s: {latency_s} work: "{work}" }} }}
    compute {{ threads: 0 }}
  }}
}}
"""


#: Imported by Python at its start: the limit that an administrator would set.
GRANTED = """
import resource
real = resource.getrlimit
resource.getrlimit = lambda which: (1, 1) if which == resource.RLIMIT_RTPRIO else real(which)
"""


def main() -> None:
    """Measures both kinds of work."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    rate_hz = float(sys.argv[2]) if len(sys.argv) > 2 else 30.0
    granted = sys.argv[3:] == ["granted"]
    how = "real-time priority as granted, " if granted else ""
    load = os.getloadavg()[0]
    print(f"{LATENCY_S:g} s a chunk, commands at {rate_hz:g} Hz, {seconds:g} s each, {how}load {load:.1f}")
    print("work      in budget  gaps     rate  model p50  bare p50  added p50")
    for work in ("sleep", "compute"):
        bare_s = bare(work, rounds=10)
        stamps_ns, figures = run(work, seconds, rate_hz, granted=granted)
        rate, share = in_budget(stamps_ns, rate_hz)
        print(
            f"{work:<9}{100 * share:>8.2f} %{figures['gaps']:>6}{rate:>6.2f} Hz"
            f"{1e3 * figures['latency_p50_s']:>8.1f} ms{1e3 * bare_s:>7.1f} ms"
            f"{1e3 * figures['overhead_p50_s']:>8.2f} ms"
        )


def bare(work: str, rounds: int) -> float:
    """Median time of a chunk of the policy alone, in this process."""
    settings = ToySettings(
        work=work,
        latency_s=LATENCY_S,
        chunk_steps=50,
        fault="",
        camera="",
        reads_task=False,
        joints="",
        rate_hz=30.0,
    )
    names = tuple(f"joint_{number}" for number in range(1, 7))
    model = ToyPolicy(settings, JointSpace(names, np.full(6, -1.0), np.full(6, 1.0)))
    model.load()
    took_s = []
    for _ in range(rounds):
        began_s = time.monotonic()
        model.act(Observation(time.time_ns()))
        took_s.append(time.monotonic() - began_s)
    return statistics.median(took_s)


def run(
    work: str, seconds: float, rate_hz: float, *, granted: bool = False
) -> tuple[list[int], dict[str, Any]]:
    """Stamps of the commands of a run, from two seconds after its start on, and the figures of the loop."""
    stamps_ns: list[int] = []

    def note(sample: Any) -> None:
        stamp = decode(JOINT_STATE, sample.cdr).header.stamp
        stamps_ns.append(stamp.sec * 1_000_000_000 + stamp.nanosec)

    with tempfile.TemporaryDirectory() as folder, reserved_domain() as domain_id:
        file = Path(folder) / "toy.pbtxt"
        file.write_text(FILE.format(rate_hz=rate_hz, latency_s=LATENCY_S, work=work))
        if granted:
            (Path(folder) / "sitecustomize.py").write_text(GRANTED)
        path = os.pathsep.join([folder, str(TOY)])
        program = JoshuaProgram(Path(folder), domain_id, {"PYTHONPATH": path})
        process = program.start("--config", str(file), "--duration", str(seconds + 120))
        assert process.stdout is not None
        assert any(" ready after " in line for line in process.stdout)
        time.sleep(2.0)
        settings = transport_settings("zenoh", domain_id=domain_id, listen_endpoints=(program.router,))
        transport = open_transport(settings)
        node = transport.create_node("stopwatch")
        node.create_subscription("/ai/actions", JOINT_STATE, QosProfile(), note)
        time.sleep(seconds)
        transport.close()
        figures = json.loads(program("call", "policy", "figures", "--format", "json").stdout)
        program.stop(process)
        program.close()
    return stamps_ns, figures


def in_budget(stamps_ns: list[int], rate_hz: float) -> tuple[float, float]:
    """Achieved rate, and the share of the places of the grid with a command within the budget."""
    stamps_s = (np.array(stamps_ns) - stamps_ns[0]) / 1e9
    period_s = 1 / rate_hz
    # the grid is the one that most commands stand on: ticks come late and never early
    phase_s = np.quantile((stamps_s + period_s / 2) % period_s, 0.1) - period_s / 2
    places = np.round((stamps_s - phase_s) / period_s)
    late_s = stamps_s - phase_s - places * period_s
    wanted = places[-1] - places[0] + 1
    good = len(set(places[np.abs(late_s) <= BUDGET * period_s - 1e-9]))
    return float((len(stamps_s) - 1) / (stamps_s[-1] - stamps_s[0])), float(good / wanted)


if __name__ == "__main__":
    main()
