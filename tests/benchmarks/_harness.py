"""One-way latency between two processes: the same run for every carrier, and its figures as ratios.

A coordinator runs every carrier in several rounds, so that a busy machine disturbs all alike, and shows
the least disturbed round of each. A round has a receiver and a sender, which read the same monotonic
clock: a message carries its number and the time just before it is made, and the receiver notes the time
when it holds the decoded message. The processor time of both sides is read over the same span, less that
of a sender that makes its messages at the same pace and sends them nowhere.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import random
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

NULL = "nothing"


class Workload(Protocol):
    """What travels: makes numbered messages and reads them back."""

    name: str
    type_name: str
    rate_hz: float
    count: int

    def make(self, number: int) -> Any:
        """A message that carries the number and the time of the call."""

    def read(self, message: Any) -> tuple[int, int]:
        """(number, time in ns) of a received message."""


@dataclass
class Outcome:
    """Figures of one carrier."""

    carrier: str
    received: int = 0
    lost: int = 0
    reordered: int = 0
    p50_us: float = 0.0
    p99_us: float = 0.0
    sender_percent: float = 0.0
    receiver_percent: float = 0.0


def free_port() -> int:
    """A TCP port that is free on loopback."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def main(workload: Workload, carriers: Sequence[str], targets: dict[str, tuple[float, float]]) -> None:
    """Runs the benchmark, or one side of it when the coordinator asks.

    Args:
        workload: what travels.
        carriers: names of the carriers, the references first.
        targets: for a carrier the longest median in µs and the largest share of a core in percent.
    """
    parser = argparse.ArgumentParser(description=workload.name)
    parser.add_argument("--carriers", default=",".join(carriers))
    parser.add_argument("--count", type=int, default=workload.count)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--side", choices=("sender", "receiver"))
    parser.add_argument("--place", default="")
    arguments = parser.parse_args()
    workload.count = arguments.count
    if arguments.side == "sender":
        _send(workload, arguments.carriers, json.loads(arguments.place))
    elif arguments.side == "receiver":
        _receive(workload, arguments.carriers, json.loads(arguments.place))
    else:
        names = arguments.carriers.split(",")
        rounds = [[_run(workload, name) for name in names] for _ in range(arguments.rounds)]
        _print(workload, [_least_disturbed(runs) for runs in zip(*rounds, strict=True)], targets)


def _run(workload: Workload, carrier: str) -> Outcome:
    from _carriers import coordinator

    place = {"port": free_port(), "domain": random.randrange(233), "path": f"/tmp/bench-{os.getpid()}"}
    command = [sys.executable, sys.argv[0], "--count", str(workload.count), "--place", json.dumps(place)]
    with coordinator(carrier, place):
        idle = _side([*command, "--carriers", NULL, "--side", "sender"])
        receiver = _start([*command, "--carriers", carrier, "--side", "receiver"])
        assert receiver.stdout is not None
        assert receiver.stdout.readline().strip() == "ready"
        sent = _side([*command, "--carriers", carrier, "--side", "sender"])
        got = json.loads(receiver.communicate("done\n", timeout=60)[0])
    latencies = np.array(got["latencies_ns"]) / 1e3
    numbers = got["numbers"]
    return Outcome(
        carrier=carrier,
        received=len(numbers),
        lost=workload.count - len(set(numbers)),
        reordered=sum(1 for a, b in itertools.pairwise(numbers) if b < a),
        p50_us=float(np.percentile(latencies, 50)),
        p99_us=float(np.percentile(latencies, 99)),
        sender_percent=max(0.0, sent["percent"] - idle["percent"]),
        receiver_percent=got["percent"],
    )


def _least_disturbed(runs: Sequence[Outcome]) -> Outcome:
    """The round with the lowest median: other programs of the machine only ever add; losses add up."""
    best = min(runs, key=lambda outcome: outcome.p50_us)
    best.lost = sum(outcome.lost for outcome in runs)
    best.reordered = sum(outcome.reordered for outcome in runs)
    return best


def _start(command: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def _side(command: list[str]) -> dict[str, Any]:
    done = subprocess.run(command, check=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def _send(workload: Workload, carrier: str, place: dict[str, Any]) -> None:
    from _carriers import sender

    send, close = sender(carrier, workload.type_name, place)
    period_s = 1 / workload.rate_hz
    for number in range(20):  # caches, connections and buffers are warm before the figures begin
        send(workload.make(-1 - number))
        time.sleep(0.01)
    cpu_s, start_s = time.process_time(), time.monotonic()
    for number in range(workload.count):
        wait_s = start_s + number * period_s - time.monotonic()
        if wait_s > 0:
            time.sleep(wait_s)
        send(workload.make(number))
    time.sleep(0.5)
    spent_s, span_s = time.process_time() - cpu_s, time.monotonic() - start_s
    close()
    print(json.dumps({"percent": 100 * spent_s / span_s}))


def _receive(workload: Workload, carrier: str, place: dict[str, Any]) -> None:
    from _carriers import receiver

    numbers: list[int] = []
    latencies_ns: list[int] = []
    span: list[float] = []

    def got(message: Any) -> None:
        number, stamp_ns = workload.read(message)
        now_ns = time.monotonic_ns()
        if number >= 0:
            if not numbers:
                span[:] = [time.process_time(), time.monotonic()]
            numbers.append(number)
            latencies_ns.append(now_ns - stamp_ns)

    close = receiver(carrier, workload.type_name, place, got)
    print("ready", flush=True)
    sys.stdin.readline()
    cpu_s, end_s = time.process_time(), time.monotonic()
    close()
    percent = 100 * (cpu_s - span[0]) / (end_s - span[1]) if span else 0.0
    print(json.dumps({"numbers": numbers, "latencies_ns": latencies_ns, "percent": percent}))


def _print(workload: Workload, outcomes: list[Outcome], targets: dict[str, tuple[float, float]]) -> None:
    floor = min((o.p50_us for o in outcomes if not o.carrier.startswith("joshua")), default=0.0)
    load = os.getloadavg()[0]
    print(f"{workload.name}, {workload.count} messages, load {load:.1f}")
    row = "{:<24} {:>8} {:>8} {:>6} {:>6} {:>10} {:>9} {:>11}  {}"
    print(
        row.format(
            "carrier", "p50 µs", "p99 µs", "ratio", "lost", "reordered", "sender %", "receiver %", "target"
        )
    )
    for outcome in outcomes:
        verdict = ""
        if outcome.carrier in targets:
            longest_us, share = targets[outcome.carrier]
            reached = (
                outcome.p50_us <= longest_us
                and max(outcome.sender_percent, outcome.receiver_percent) <= share
                and not outcome.lost
                and not outcome.reordered
            )
            limits = f"≤ {longest_us:.0f} µs" + (f", ≤ {share:g} %" if share < 100 else "")
            verdict = f"{limits}: {'reached' if reached else 'missed'}"
        cells = (
            outcome.carrier,
            f"{outcome.p50_us:.0f}",
            f"{outcome.p99_us:.0f}",
            f"{outcome.p50_us / floor:.2f}" if floor else "",
            str(outcome.lost),
            str(outcome.reordered),
            f"{outcome.sender_percent:.1f}",
            f"{outcome.receiver_percent:.1f}",
            verdict,
        )
        print(row.format(*cells))
    print(json.dumps([asdict(outcome) for outcome in outcomes]))


Callback = Callable[[Any], None]
