"""Emulated cameras to a subscriber in another process, by the real program: latency, losses, processor time.

The latency of a frame runs from its last byte at the emulator to the decoded message at the subscriber, all
by the monotonic clock; the frame's number is in its picture. As a reference bare OpenCV reads as many
emulated cameras in the same way, a process each, and passes nothing on.
Run: python tests/benchmarks/camera_latency.py [SECONDS [CAMERAS …]]
"""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

WIDTH, HEIGHT, FPS = 640, 480, 30
SECONDS, CAMERAS = 60.0, (1, 4)
WARM_UP_S = 3.0
TARGET_P50_MS, TARGET_PERCENT = 3.0, 8.0

NODE = """
  perceptions {{
    node {{
      node_name: "camera_{index}" node_id: {index}
      qos {{ reliability: BEST_EFFORT depth: 1 }}
      publishers {{ data_type: IMAGE topic_name: "/camera_{index}" publish_rate_hz: {fps} }}
    }}
    perception_type: PERCEPTION_CAMERA
    camera_config {{ width: {width} height: {height} fps: {fps} source: "{source}" }}
  }}
"""


@dataclass
class Figures:
    """Figures of one camera."""

    frames: int
    lost: int
    repeated: int
    reordered: int
    fps: float
    p50_ms: float
    p99_ms: float
    percent: float


def main() -> None:
    """Runs both ways for each number of cameras and prints the figures."""
    if "--receive" in sys.argv:
        receive(int(sys.argv[1]), int(sys.argv[2]))
        return
    if "--bare" in sys.argv:
        bare(sys.argv[1])
        return
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    for count in [int(text) for text in sys.argv[2:]] or CAMERAS:
        for name, measure in (("bare OpenCV", run_bare), ("joshua", run_joshua)):
            show(f"{count} × {WIDTH} × {HEIGHT} at {FPS} Hz, {name}", measure(count, seconds))


def run_joshua(count: int, seconds: float) -> list[Figures]:
    """The whole program, one node and one process for each camera, and a subscriber of all."""
    with ExitStack() as stack:
        cameras = emulators(count, stack)
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        blocks = "".join(
            NODE.format(index=index, source=camera.source, width=WIDTH, height=HEIGHT, fps=FPS)
            for index, camera in enumerate(cameras)
        )
        file = folder / "cameras.pbtxt"
        general = 'general { mode: MODE_TEST name: "bench" id: "camera-bench" }'
        general += " test { duration_s: 3600 }"  # the stop comes from here
        file.write_text(f"{general}\nrobot {{ {blocks} }}\n")
        domain = random.randrange(1, 100)
        environment = {**os.environ, "XDG_RUNTIME_DIR": str(folder), "JOSHUA_LOG_DIR": str(folder)}
        environment["ROS_DOMAIN_ID"] = str(domain)
        command = [sys.executable, "-m", "joshua.cli.main", "--config", str(file)]
        program = start(command, stack, environment)
        lines = read_until(program, " ready after ")
        processes = [int(match[1]) for line in lines if (match := re.match(r"/camera_\d+ +(\d+)", line))]
        receiver = start([sys.executable, __file__, str(domain), str(count), "--receive"], stack)
        assert receiver.stdout is not None
        receiver.stdout.readline()
        time.sleep(WARM_UP_S)
        busy_s, began_s = [processor_s(pid) for pid in processes], time.monotonic()
        time.sleep(seconds)
        span_s = time.monotonic() - began_s
        percents = [
            100 * (processor_s(pid) - before) / span_s for pid, before in zip(processes, busy_s, strict=True)
        ]
        received = json.loads(receiver.communicate("done\n", timeout=60)[0])
        program.send_signal(signal.SIGINT)
        program.communicate(timeout=30)
        frames = [after(received[index], began_s, span_s) for index in range(count)]
        return [
            figures(*item)
            for item in zip(frames, [camera.sent() for camera in cameras], percents, strict=True)
        ]


def run_bare(count: int, seconds: float) -> list[Figures]:
    """``VideoCapture.read`` in a process for each camera."""
    with ExitStack() as stack:
        cameras = emulators(count, stack)
        readers = [start([sys.executable, __file__, camera.source, "--bare"], stack) for camera in cameras]
        time.sleep(WARM_UP_S)
        busy_s, began_s = [processor_s(reader.pid) for reader in readers], time.monotonic()
        time.sleep(seconds)
        span_s = time.monotonic() - began_s
        percents = [
            100 * (processor_s(reader.pid) - before) / span_s
            for reader, before in zip(readers, busy_s, strict=True)
        ]
        received = [json.loads(reader.communicate("done\n", timeout=60)[0]) for reader in readers]
        frames = [after(entries, began_s, span_s) for entries in received]
        return [
            figures(*item)
            for item in zip(frames, [camera.sent() for camera in cameras], percents, strict=True)
        ]


def emulators(count: int, stack: ExitStack) -> list[Any]:
    """Starts the cameras."""
    from joshua_emulator import EmulatedCamera

    return [stack.enter_context(EmulatedCamera(WIDTH, HEIGHT, FPS)) for _ in range(count)]


def start(
    command: list[str], stack: ExitStack, environment: dict[str, str] | None = None
) -> subprocess.Popen[str]:
    """Starts a process that is killed at the end if it still runs."""
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment,
    )
    stack.callback(process.kill)  # does nothing to a process that has ended
    return process


def read_until(process: subprocess.Popen[str], text: str) -> list[str]:
    """Reads the output of a process up to the line that contains a text."""
    lines: list[str] = []
    assert process.stdout is not None
    for line in process.stdout:
        lines.append(line)
        if text in line:
            return lines
    raise SystemExit(f"the program ended: {''.join(lines)}")


def processor_s(pid: int) -> float:
    """Processor time of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def after(entries: list[list[int]], began_s: float, span_s: float) -> list[list[int]]:
    """The frames of the measured span."""
    return [entry for entry in entries if began_s <= entry[1] / 1e9 <= began_s + span_s]


def figures(frames: list[list[int]], sent: dict[int, int], percent: float) -> Figures:
    """Figures of one camera from (number, time of arrival in ns) and the emulator's times by number."""
    numbers = [number for number, _ in frames]
    steps = np.diff(numbers)
    latencies_ms = np.array([(at - sent[number]) / 1e6 for number, at in frames])
    span_s = (frames[-1][1] - frames[0][1]) / 1e9
    return Figures(
        frames=len(frames),
        lost=int(np.sum(steps[steps > 1] - 1)),
        repeated=int(np.sum(steps == 0)),
        reordered=int(np.sum(steps < 0)),
        fps=(len(frames) - 1) / span_s,
        p50_ms=float(np.percentile(latencies_ms, 50)),
        p99_ms=float(np.percentile(latencies_ms, 99)),
        percent=percent,
    )


def show(title: str, found: list[Figures]) -> None:
    """Prints the figures of one run."""
    print(f"{title}; load average {os.getloadavg()[0]:.1f}")
    for entry in found:
        print(
            f"  {entry.frames} frames, {entry.lost} lost, {entry.repeated} repeated, "
            f"{entry.reordered} reordered, {entry.fps:.2f} Hz, p50 {entry.p50_ms:.2f} ms, "
            f"p99 {entry.p99_ms:.2f} ms, {entry.percent:.1f} % of a core"
        )
    if title.endswith("joshua"):
        reached = all(
            entry.p50_ms <= TARGET_P50_MS
            and entry.percent <= TARGET_PERCENT
            and not entry.repeated
            and not entry.reordered
            for entry in found
        )
        verdict = "reached" if reached else "missed"
        print(f"  target p50 ≤ {TARGET_P50_MS:g} ms, ≤ {TARGET_PERCENT:g} %, in order: {verdict}")


def receive(domain: int, count: int) -> None:
    """The subscriber: notes number and arrival of each frame of each camera."""
    from joshua.messages import decode
    from joshua.messages.make import pixels
    from joshua.plan import QosProfile, TransportSettings
    from joshua.transport import open_transport
    from joshua_emulator.camera.frame_code import read_code

    transport = open_transport(TransportSettings(domain_id=domain))
    node = transport.create_node("bench_receiver")
    received: list[list[tuple[int, int]]] = [[] for _ in range(count)]

    def subscribe(index: int) -> None:
        def got(sample: Any) -> None:
            message = decode("sensor_msgs/msg/Image", sample.cdr)
            now_ns = time.monotonic_ns()
            code = read_code(pixels(message))
            assert code is not None
            received[index].append((code.number, now_ns))

        qos = QosProfile(reliability="BEST_EFFORT", depth=1)
        node.create_subscription(f"/camera_{index}", "sensor_msgs/msg/Image", qos, got)

    for index in range(count):
        subscribe(index)
    print("ready", flush=True)
    sys.stdin.readline()
    transport.close()
    print(json.dumps(received))


def bare(source: str) -> None:
    """The reference: OpenCV alone."""
    import cv2
    from joshua_emulator.camera.frame_code import read_code

    stop = threading.Event()

    def wait_for_line() -> None:
        sys.stdin.readline()
        stop.set()

    threading.Thread(target=wait_for_line, daemon=True).start()
    video = cv2.VideoCapture(source)
    received = []
    while not stop.is_set():
        _, picture = video.read()
        now_ns = time.monotonic_ns()
        code = read_code(np.asarray(picture, dtype=np.uint8))
        assert code is not None
        received.append((code.number, now_ns))
    video.release()
    print(json.dumps(received))


if __name__ == "__main__":
    main()
