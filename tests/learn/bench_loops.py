"""The loop here beside LeRobot's synchronous and asynchronous inference, in turn: one policy, one arm.

An ACT with random weights, on one thread, sees one camera and moves an emulated SO-ARM100 on a
pseudo-terminal. All clocks are the monotonic one of this machine; the first seconds of a run are left out.

- Ticks in budget: actions handed to the arm at most 1.25 periods after the one before, of those that the time
  should have had. On the wire: the same of the goals on the bus, by the emulator's clock; here the arm's own
  loop writes them, at 50 Hz.
- Model: ACT's network, nothing else. Added: from the observation to its chunk in the queue (synchronous: to
  its action handed to the arm), without the network; what decodes and processes counts as added.
- Reaction: from the measurement of the arm's state to the end, on the wire, of the first goal that answers
  it. Age: the same of every goal, from the newest observation that it answers.
- Bare is LeRobot's policy with its processors, on an observation in memory, and nothing else.

What is not alike: here the camera is a process whose pictures are decoded, and the arm is a process; in
LeRobot the picture lies in memory. LeRobot's asynchronous client mixes 0.3 of the old chunk into the new one.
Each loop decides itself when it wants the next chunk, so they predict at different rates. LeRobot would end
at the first late reply of the arm: for this it asks up to five times more.
Run: ./test -s learn -- bench, or in that environment: python tests/learn/bench_loops.py [SECONDS [ROUNDS]]
"""

from __future__ import annotations

import bisect
import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import astuple, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1] / "support"))

import tiny_policies
from google.protobuf import text_format
from joshua.devices.calibration import ArmCalibration
from joshua.messages import decode
from joshua.plan import QosProfile
from joshua.schema import config_pb2
from joshua.testing.domain import reserved_domain
from joshua.testing.port import free_port
from joshua.testing.program import JoshuaProgram
from joshua.testing.transport import transport_settings
from joshua.transport import open_transport
from joshua_emulator import EmulatedBus

HERE = Path(__file__).parent
RATE_HZ, ARM_HZ, CHUNK, HEIGHT, WIDTH = 30.0, 50.0, 50, 240, 320
SETTLED_S, BUDGET = 4.0, 0.25
CARRIED_S = 0.001  # transport, and the goal's packet at 1 Mbaud
GOAL_ADDRESS = 42
JOINT_STATE = "sensor_msgs/msg/JointState"
FILE = """
include: "calibration.pbtxt"
general {{ mode: MODE_INFERENCE robot_type: "SO-ARM100" name: "loops" id: "loops" }}
robot {{
  actions {{
    node {{
      node_name: "follower_arm" node_id: 1
      publishers {{ data_type: JOINT_STATE topic_name: "/follower/joint_states" publish_rate_hz: 50 }}
      subscriptions {{ data_type: JOINT_STATE topic_name: "/ai/actions" }}
    }}
    action_type: ACTION_SINGLE
    sts3215_config {{
      comm {{ serial {{ port: "{port}" baudrate: 1000000 }} }}
      motor_ids: [1, 2, 3, 4, 5, 6] position_max: 4095 velocity: 1000 acceleration: 200
    }}
  }}
  perceptions {{
    node {{
      node_name: "camera_top" node_id: 2
      qos {{ reliability: BEST_EFFORT depth: 1 }}
      publishers {{ data_type: IMAGE topic_name: "/camera/top/image_raw" publish_rate_hz: 30 }}
    }}
    perception_type: PERCEPTION_CAMERA
    mock_camera_config {{ width: {width} height: {height} fps: 30 }}
  }}
}}
ai {{
  models {{
    model_type: MODEL_PLUGIN
    pretrained_model_name_or_path: "{checkpoint}"
    node {{
      node_name: "policy" node_id: 3
      publishers {{ data_type: JOINT_STATE topic_name: "/ai/actions" publish_rate_hz: {rate_hz} }}
      subscriptions {{ data_type: IMAGE topic_name: "/camera/top/image_raw" }}
    }}
    plugin_config {{ [joshua/joshua.LeRobotPolicy] {{ }} }}
  }}
}}
"""


def main(seconds: int = 20, rounds: int = 2) -> None:
    """Measures all of them, in turn."""
    ways = {"bare": bare, "joshua": ours, "LeRobot sync": lerobot_sync, "LeRobot async": lerobot_async}
    found: dict[str, list[Figures]] = {name: [] for name in ways}
    loads = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        tiny_policies.make_act(folder / "act", ("top",), height=HEIGHT, width=WIDTH, chunk=CHUNK)
        for number in range(rounds):
            for name, loop in ways.items():
                place = folder / f"{name.split()[-1]}-{number}"
                place.mkdir(mode=0o700)
                with EmulatedBus(arm="so_arm100", calibrated=True, identity=f"LOOPS{number}") as arm:
                    found[name].append(loop(arm, folder / "act", place, seconds))
                loads.append(os.getloadavg()[0])
    print(
        f"commands at {RATE_HZ:g} Hz, {rounds} rounds of {seconds} s in turn, "
        f"load {min(loads):.1f} to {max(loads):.1f}; medians:"
    )
    print(
        "loop         ticks in budget on the wire   ticks/s  chunks     model     added  reaction       age"
    )
    for name, runs in found.items():
        row = [statistics.median(values) for values in zip(*map(astuple, runs), strict=True)]
        in_budget, on_wire, ticks_hz, chunks, *times_s = row
        first = (
            f"{100 * in_budget:>13.2f} %{100 * on_wire:>10.2f} %{ticks_hz:>10.2f}" if ticks_hz else " " * 37
        )
        times = (f"{1e3 * time_s:>7.{2 if k == 1 else 1}f} ms" for k, time_s in enumerate(times_s) if time_s)
        print(f"{name:<13}{first}{chunks:>8.0f}{''.join(times)}")


@dataclass(frozen=True)
class Figures:
    """What a loop reached; the module says what each means."""

    in_budget: float
    in_budget_on_wire: float
    ticks_hz: float
    chunks: int
    model_s: float
    added_s: float
    reaction_s: float = 0.0
    age_s: float = 0.0


def bare(arm: EmulatedBus, checkpoint: Path, folder: Path, seconds: int) -> Figures:
    """The policy alone; its arm lies still."""
    process = lerobot(("alone", str(checkpoint), str(max(2.0, seconds / 4))), folder, "alone")
    chunks = noted(process, folder, "alone")["chunks"]
    return Figures(0.0, 0.0, 0.0, len(chunks), *spent(chunks))


def ours(arm: EmulatedBus, checkpoint: Path, folder: Path, seconds: int) -> Figures:
    """A run of this program."""
    calibration = config_pb2.Config()
    calibration.calibration.arms.append(
        ArmCalibration.model_validate(arm.calibration()).to_block("follower_arm")
    )
    (folder / "calibration.pbtxt").write_text(text_format.MessageToString(calibration))
    file = folder / "loops.pbtxt"
    file.write_text(
        FILE.format(port=arm.port, width=WIDTH, height=HEIGHT, checkpoint=checkpoint, rate_hz=RATE_HZ)
    )
    site, times = folder / "site", folder / "times"
    site.mkdir()
    (site / "sitecustomize.py").write_text("import _loop_times\n")
    stamps_ns: list[int] = []

    def note(sample: Any) -> None:
        stamp = decode(JOINT_STATE, sample.cdr).header.stamp
        stamps_ns.append(stamp.sec * 1_000_000_000 + stamp.nanosec)

    with reserved_domain() as domain_id:
        program = JoshuaProgram(folder, domain_id, {**environment(site), "LOOP_TIMES": str(times)})
        process = program.start("--config", str(file), "--duration", str(seconds + 120))
        assert process.stdout is not None
        said = []
        for line in process.stdout:
            said.append(line)
            if " ready after " in line:
                break
        else:
            sys.exit("".join(said) + (process.stderr.read() if process.stderr else ""))
        time.sleep(SETTLED_S)
        settings = transport_settings("zenoh", domain_id=domain_id, listen_endpoints=(program.router,))
        transport = open_transport(settings)
        transport.create_node("stopwatch").create_subscription("/ai/actions", JOINT_STATE, QosProfile(), note)
        goals_s = goals(arm, seconds)
        offset_s = time.time() - time.monotonic()
        transport.close()
        program.stop(process)
        program.close()
    chunks = [json.loads(line) for line in times.read_text().splitlines()]
    return figures([stamp_ns / 1e9 - offset_s for stamp_ns in stamps_ns], chunks, goals_s, ARM_HZ, CARRIED_S)


def lerobot_sync(arm: EmulatedBus, checkpoint: Path, folder: Path, seconds: int) -> Figures:
    """The loop of ``lerobot-record``."""
    calibrate(arm, folder)
    words = (arm.port, str(folder), str(checkpoint), str(RATE_HZ), str(seconds + 2 * SETTLED_S))
    return watched(arm, lerobot(("sync", *words), folder, "sync"), folder, "sync", seconds)


def lerobot_async(arm: EmulatedBus, checkpoint: Path, folder: Path, seconds: int) -> Figures:
    """A policy server and a robot client on this machine."""
    calibrate(arm, folder)
    port, times = free_port(), folder / "times"
    times.touch()
    server = lerobot(("server", str(port), str(RATE_HZ), str(times)), folder, "server")
    try:
        while not listens(port):
            if server.poll() is not None:
                sys.exit((folder / "server.err").read_text())
            time.sleep(0.2)
        words = (arm.port, str(folder), str(checkpoint), str(RATE_HZ), str(seconds + 2 * SETTLED_S))
        process = lerobot(("client", *words, f"127.0.0.1:{port}", str(times)), folder, "client")
        return watched(arm, process, folder, "client", seconds)
    finally:
        server.kill()
        server.wait()


def listens(port: int) -> bool:
    """Whether a server on this machine takes connections."""
    with socket.socket() as caller:
        return caller.connect_ex(("127.0.0.1", port)) == 0


def watched(
    arm: EmulatedBus, process: subprocess.Popen[bytes], folder: Path, name: str, seconds: int
) -> Figures:
    """What a loop of LeRobot notes, and what comes over the wire."""
    while process.poll() is None and len(logged(arm)) < 10:
        time.sleep(0.2)
    time.sleep(SETTLED_S)
    goals_s = goals(arm, seconds)
    found = noted(process, folder, name)
    return figures(found["ticks"], found["chunks"], goals_s, RATE_HZ, 0.0)


def noted(process: subprocess.Popen[bytes], folder: Path, name: str) -> dict[str, Any]:
    """What a process of LeRobot prints at its end."""
    if process.wait(timeout=180):
        sys.exit((folder / f"{name}.err").read_text())
    found: dict[str, Any] = json.loads((folder / f"{name}.out").read_text().splitlines()[-1])
    return found


def figures(
    ticks_s: list[float],
    chunks: list[list[float]],
    goals_s: list[float],
    wire_hz: float,
    carried_s: float,
) -> Figures:
    """The figures of the time in which the wire was watched.

    Args:
        ticks_s: when actions were handed to the arm.
        chunks: as ``_loop_times.py`` writes them.
        goals_s: when goals had ended on the wire.
        wire_hz: rate of the loop that writes them.
        carried_s: the least time that an action needs from there to the wire's end.
    """
    ticks_s = [tick_s for tick_s in ticks_s if goals_s[0] - 1 / RATE_HZ < tick_s <= goals_s[-1]]
    reactions_s, ages_s = [], []
    began = [bisect.bisect_left(ticks_s, queued_s) for *_, queued_s in chunks]
    for (observed_s, *_), first, last in zip(chunks, began, [*began[1:], len(ticks_s)], strict=True):
        to_wire_s = []
        for tick_s in ticks_s[first:last]:
            place = bisect.bisect_left(goals_s, tick_s + carried_s)
            to_wire_s += [goals_s[place] - observed_s] if place < len(goals_s) else []
        ages_s += to_wire_s
        reactions_s += to_wire_s[:1] if first else []  # else it began before
    seen = [chunk for chunk in chunks if ticks_s[0] <= chunk[-1] <= ticks_s[-1]]
    return Figures(
        share(ticks_s, RATE_HZ),
        share(goals_s, wire_hz),
        (len(ticks_s) - 1) / (ticks_s[-1] - ticks_s[0]),
        len(seen),
        *spent(seen),
        statistics.median(reactions_s),
        statistics.median(ages_s),
    )


def spent(chunks: list[list[float]]) -> tuple[float, float]:
    """Median time of the network, and what was added to it."""
    added_s = [queued_s - taken_s - network_s for _, taken_s, network_s, queued_s in chunks]
    return statistics.median(network_s for *_, network_s, _ in chunks), statistics.median(added_s)


def share(moments_s: list[float], rate_hz: float) -> float:
    """The share in budget, of the moments that the time should have had."""
    steps = [later - earlier for earlier, later in pairwise(moments_s)]
    wanted = max(len(steps), round((moments_s[-1] - moments_s[0]) * rate_hz))
    return sum(step <= (1 + BUDGET) / rate_hz for step in steps) / wanted


def lerobot(words: tuple[str, ...], folder: Path, name: str) -> subprocess.Popen[bytes]:
    """Starts a loop of LeRobot; what it says goes into files, its logs into the folder."""
    command = [sys.executable, str(HERE / "_lerobot_loops.py"), *words]
    variables = {**os.environ, **environment()}
    with (folder / f"{name}.out").open("wb") as output, (folder / f"{name}.err").open("wb") as errors:
        return subprocess.Popen(command, stdout=output, stderr=errors, cwd=folder, env=variables)


def environment(*folders: Path) -> dict[str, str]:
    """Variables in which LeRobot computes on one thread, and Python imports from ``folders`` first."""
    path = os.pathsep.join([*map(str, folders), str(HERE), os.environ.get("PYTHONPATH", "")])
    return {"PYTHONPATH": path, "HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1"}


def calibrate(arm: EmulatedBus, folder: Path) -> None:
    """Writes the calibration of the arm as LeRobot keeps it."""
    entries = {
        motor.joint_name: {
            "id": motor.id,
            "drive_mode": int(motor.inverted),
            "homing_offset": motor.homing_offset,
            "range_min": motor.range_min,
            "range_max": motor.range_max,
        }
        for motor in ArmCalibration.model_validate(arm.calibration()).motors
    }
    (folder / "arm.json").write_text(json.dumps(entries))


def goals(arm: EmulatedBus, seconds: float) -> list[float]:
    """When the goals of so many seconds from now on have ended on the wire, monotonic."""
    began_s = time.monotonic()
    time.sleep(seconds)
    return [goal_s for goal_s in logged(arm) if goal_s > began_s]


def logged(arm: EmulatedBus) -> list[float]:
    """When the goals that the emulator remembers have ended on the wire."""
    entries = arm.ask("log", events=["sync_write"], limit=50_000)["entries"]
    return [
        entry["wire_end_ns"] / 1e9
        for entry in entries
        if bytes.fromhex(entry["parameters"])[0] == GOAL_ADDRESS
    ]


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
