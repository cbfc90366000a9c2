"""Cadence of a 100 Hz timer whose node receives two 30 Hz streams of 640×480 images meanwhile.

Three cases: the timer alone, the images from processes of their own, and everything in one process. Beside
each a bare loop of ``time.sleep`` runs in a process of its own: what it misses is the machine's share.
Run: python tests/benchmarks/timer_cadence.py [SECONDS]
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "behaviours"))

from joshua.supervisor import fork_server  # noqa: E402

DEFAULT_S = 60.0
WITHIN_S = 0.002

BARE_LOOP = """
import sys, time
count, due, late = int(float(sys.argv[1]) * 100), time.monotonic(), []
for _ in range(count):
    due += 0.01
    time.sleep(max(0.0, due - time.monotonic()))
    late.append(time.monotonic() - due)
late.sort()
print(late[int(count * 0.999)])
"""


def main() -> None:
    """Runs the cases and prints one line for each."""
    server = fork_server.start()
    duration_s = float(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT_S
    print(f"100 Hz timer over {duration_s:g} s; load average {os.getloadavg()[0]:.1f}")
    try:
        for kind in ("zenoh", "dds"):
            for case in ("alone", "own processes", "one process"):
                print(measure(server, kind, case, duration_s), flush=True)
    finally:
        server.close()


def measure(server: fork_server.ForkServer, kind: str, case: str, duration_s: float) -> str:
    """Runs one case and returns its line."""
    from joshua.plan import NodeKind, NodeSpec, Plan, TopicSpec
    from joshua.supervisor.policies import SupervisorOptions
    from joshua.supervisor.supervisor import Supervisor
    from joshua.testing.transport import transport_settings

    topics = tuple(
        TopicSpec(name=f"/camera_{side}", type_name="sensor_msgs/msg/Image", rate_hz=30.0)
        for side in ("left", "right")
    )
    group = "all" if case == "one process" else ""
    nodes = [
        NodeSpec(
            name="control",
            kind=NodeKind.SENSOR,
            behaviour="cadence_behaviours:ControlLoop",
            implementation="",
            subscriptions=() if case == "alone" else topics,
            process_group=group,
        )
    ]
    if case != "alone":
        nodes += [
            NodeSpec(
                name=topic.name[1:],
                kind=NodeKind.SENSOR,
                behaviour="cadence_behaviours:ImageSource",
                implementation="",
                publishers=(topic,),
                process_group=group,
            )
            for topic in topics
        ]
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/localhost:{probe.getsockname()[1]}"
    transport = transport_settings(kind, domain_id=93, listen_endpoints=(endpoint,))
    plan = Plan(source="timer_cadence", mode="MODE_TEST", nodes=tuple(nodes), transport=transport)
    with tempfile.TemporaryDirectory() as folder:
        options = SupervisorOptions(
            duration_s=duration_s, run_base=Path(folder) / "run", log_directory=Path(folder)
        )
        bare = subprocess.Popen(
            [sys.executable, "-c", BARE_LOOP, str(duration_s)], stdout=subprocess.PIPE, text=True
        )
        report = Supervisor(plan, server, options).run()
        bare_s = float(bare.communicate()[0])
    if report.exit_code != 0:
        return f"{kind:5} {case:13} failed: {report.reason}"
    timer = report.nodes[0].timers[0]
    images = sum(topic.count for topic in report.nodes[0].topics)
    verdict = "yes" if timer.jitter_p999_s <= WITHIN_S else "no"
    return (
        f"{kind:5} {case:13} {timer.achieved_hz:7.2f} Hz  p50 {timer.jitter_p50_s * 1e6:5.0f} µs  "
        f"p99 {timer.jitter_p99_s * 1e6:5.0f} µs  p99.9 {timer.jitter_p999_s * 1e6:5.0f} µs  "
        f"max {timer.jitter_max_s * 1e3:6.2f} ms  overruns {timer.overruns}  images {images}  "
        f"99.9 % within 2 ms: {verdict}; bare loop p99.9 {bare_s * 1e6:5.0f} µs"
    )


if __name__ == "__main__":
    main()
