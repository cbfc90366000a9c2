"""Processes that learn together: whom they cannot meet, who differs, and who is lost, is named."""

from __future__ import annotations

import os
import socket
import subprocess
import sys

from joshua.testing.port import free_port

PROGRAM = """
import os, sys
from joshua_imitation.group import Group, LostError
from joshua_training.run_folder import RunError

rank = int(sys.argv[1])
group = Group(size=2, rank=rank, local=rank, each=2, address=sys.argv[2])
group.join()
group.begin([], [7, 3])
try:
    group.begin([], [7, rank])
except RunError as error:
    print(error, flush=True)
if rank:
    os._exit(1)
try:
    while True:
        group.sum([1.0])
except LostError as error:
    print(error, flush=True)
"""


def start(rank: int, address: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(rank), address],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "OMP_NUM_THREADS": "1", "CUDA_VISIBLE_DEVICES": ""},
    )


def test_processes_that_differ_or_are_lost_say_so() -> None:
    address = f"127.0.0.1:{free_port()}"
    runs = [start(rank, address) for rank in range(2)]
    (said, failed), (other, _) = (run.communicate(timeout=200) for run in runs)
    differs = (
        "the processes differ in data set or checkpoint: give every machine the same data set, settings and "
        "resume_run"
    )
    assert other == f"{differs}\n"
    first, second = said.splitlines() or [failed]
    assert first == differs
    assert second.startswith("process 0 of 2 lost the others: ")
    assert second.endswith(": see their messages, and continue with resume_run")


def test_a_port_that_is_taken_is_named() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        run = start(0, address)
        _, said = run.communicate(timeout=200)
    assert run.returncode == 1
    last = said.strip().splitlines()[-1]
    assert f"process 0 of 2 cannot meet the others at {address}: " in last
    assert last.endswith(
        "start the file on every machine, each with its own machine_rank, and open that port"
    )
