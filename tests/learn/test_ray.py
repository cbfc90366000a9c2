"""Work on real Ray clusters of two nodes on the loopback, with workers and a node that are killed."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from joshua.testing.port import free_port
from joshua_dataset.transform import Source, build
from joshua_jobs.choice import opened
from joshua_jobs.executor import JobError, Stopped
from joshua_ray.cluster import Cluster
from ray_nodes import Cluster as Nodes
from ray_nodes import add_worker, started
from small_dataset import write


@pytest.fixture(scope="module")
def nodes() -> Iterator[Nodes]:
    found = started(1)
    add_worker(found)
    yield found
    found.shutdown()


@pytest.fixture
def cluster(nodes: Nodes) -> Iterator[Cluster]:
    if not nodes.worker_nodes:
        add_worker(nodes)
    with Cluster(nodes.address) as found:
        yield found


def joshua(*words: str, without: str = "-", **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs the command.

    Args:
        without: prefix of variables that it does not inherit.
    """
    inherited = {name: value for name, value in os.environ.items() if not name.startswith(without)}
    return subprocess.run(
        [sys.executable, "-m", "joshua", *words],
        env=inherited | environment,
        capture_output=True,
        text=True,
        timeout=150,
        check=False,
    )


def digests(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def slow(number: int) -> int:
    time.sleep(0.4)
    return number * number


def asleep(seconds: float) -> None:
    time.sleep(seconds)


def faulty(number: int) -> int:
    raise ValueError(f"item {number}")


def unanswered(marker: str) -> int:
    """Ends its worker the first time."""
    path = Path(marker)
    if not path.exists():
        path.write_text("")
        os.kill(os.getpid(), 9)
    return 7


def deadly(_: int) -> None:
    os.kill(os.getpid(), 9)


class Counter:
    def __init__(self, start: int) -> None:
        self.value = start

    def add(self, numbers: Any) -> int:
        self.value += sum(numbers)
        return self.value

    def wait(self, seconds: float) -> None:
        time.sleep(seconds)

    def end(self, marker: str) -> int:
        return unanswered(marker)


def test_data_set_jobs_give_the_same_bytes_on_a_cluster(nodes: Nodes, tmp_path: Path) -> None:
    write(tmp_path / "a", lengths=(3, 2, 4, 2, 3))
    write(tmp_path / "b", lengths=(2,))
    build([Source(tmp_path / "a"), Source(tmp_path / "b")], tmp_path / "here", codec="hevc", workers=1)
    merged = ("dataset", "merge", "a", "b", "--codec", "hevc")
    command = [*merged, "--into", "there", "--ray", nodes.address]
    done = subprocess.run(
        [sys.executable, "-m", "joshua", *command], cwd=tmp_path, capture_output=True, text=True, timeout=100
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{tmp_path / 'there'}: 6 episodes\n"
    assert digests(tmp_path / "there") == digests(tmp_path / "here")


def test_check_and_statistics_say_the_same_on_a_cluster(cluster: Cluster, tmp_path: Path) -> None:
    from joshua_dataset.checking import check
    from joshua_dataset.recomputing import recomputed
    from joshua_dataset.statistics import as_json

    write(tmp_path, lengths=(3, 2, 4))
    expected = [str(problem) for problem in check(tmp_path, workers=1)]
    assert [str(problem) for problem in check(tmp_path, workers=cluster)] == expected
    here, there = (
        {key: as_json(values) for key, values in recomputed(tmp_path, workers=workers).items()}
        for workers in (1, cluster)
    )
    assert json.dumps(here) == json.dumps(there)


def test_an_exception_of_a_job_is_raised_here(cluster: Cluster) -> None:
    with pytest.raises(ValueError, match="item 4"):
        list(cluster.in_order(faulty, [4]))
    assert cluster.lost == 0


def test_a_worker_without_the_same_distributions_is_said(
    cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = ModuleType("only_here")
    exec("def job(number): return number", vars(here))
    monkeypatch.setitem(sys.modules, "only_here", here)
    with pytest.raises(JobError, match="cannot import only_here: install the same distributions"):
        list(cluster.in_order(here.job, [1]))


def test_a_lost_worker_is_counted_and_its_job_repeated(cluster: Cluster, tmp_path: Path) -> None:
    assert list(cluster.in_order(unanswered, [str(tmp_path / "once")])) == [7]
    assert cluster.lost == 1


def test_a_job_that_always_ends_its_worker_is_given_up(cluster: Cluster) -> None:
    with pytest.raises(
        JobError, match="lost workers 4 times in a row with the same work, the last time because"
    ):
        list(cluster.in_order(deadly, [0]))


def test_a_crew_makes_lost_objects_again(cluster: Cluster, tmp_path: Path) -> None:
    crew = cluster.crew(Counter, [(1,), (10,), (100,)])
    shared = crew.share([1, 1])
    assert crew.each("add", [(shared,), (shared,), ([5],)]) == [3, 12, 105]
    (tmp_path / "1").write_text("")
    (tmp_path / "2").write_text("")
    ends = [(str(tmp_path / str(number)),) for number in range(3)]
    assert crew.each("end", ends) == [7, 7, 7]  # the first of them died
    assert cluster.lost == 1
    assert crew.each("add", [(shared,), (shared,), ([5],)]) == [3, 14, 110]
    with pytest.raises(Stopped):
        crew.each("wait", [(30.0,)] * 3, lambda: True)
    crew.close()


def test_work_on_a_cluster_stops_when_asked(cluster: Cluster) -> None:
    with pytest.raises(Stopped):
        list(cluster.in_order(asleep, [30], lambda: True))


def test_the_loss_of_all_workers_is_said(
    capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "joshua.ray")
    nodes = started(0)
    try:
        worker = add_worker(nodes)
        with Cluster(nodes.address, patience_s=1.0) as cluster:
            found = cluster.in_order(slow, range(20))
            assert next(found) == 0
            capfd.readouterr()
            nodes.remove_node(worker, allow_graceful=False)
            with pytest.raises(JobError) as caught:
                list(found)
            end_s = time.monotonic() + 20
            while "has been marked dead" not in caplog.text and time.monotonic() < end_s:
                time.sleep(0.1)
            assert "has been marked dead" in caplog.text  # what Ray would print
            assert capfd.readouterr() == ("", "")
        assert str(caught.value) == (
            f"all workers of the cluster {nodes.address} are lost: no node with a free core for 1 s. "
            f"Start nodes (ray start --address={nodes.address}), and run the command again"
        )
    finally:
        nodes.shutdown()


def own_address() -> str:
    """The address at which other machines reach this one; "" without a network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        try:
            found.connect(("192.0.2.1", 9))  # nothing is sent
        except OSError:
            return ""
        return str(found.getsockname()[0])


@pytest.mark.skipif(not own_address(), reason="without a network nobody can reach a cluster")
def test_a_cluster_that_others_can_reach_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "set")
    port = free_port()
    head = subprocess.Popen(
        [
            *(sys.executable, "-m", "ray.scripts.scripts", "start", "--head", "--block", f"--port={port}"),
            *("--node-ip-address=127.0.0.1", "--include-dashboard=false", "--num-cpus=1"),
            *("--object-store-memory=80000000", "--min-worker-port=0", "--max-worker-port=0"),
            f"--ray-client-server-port={free_port()}",
        ],
        env={name: value for name, value in os.environ.items() if not name.startswith("RAY_")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert head.stdout is not None
        assert any("Ray runtime started" in line for line in head.stdout)
        socket.create_connection((own_address(), port), 5).close()
        done = joshua("dataset", "check", str(tmp_path / "set"), "--ray", f"127.0.0.1:{port}", without="RAY_")
        assert done.returncode == 2, done.stderr
        assert (
            f"the node {own_address()} of the cluster at 127.0.0.1:{port} is not on the loopback, and "
            "whoever reaches a Ray cluster can run code on it. It requires token authentication and TLS; "
            "missing: RAY_AUTH_MODE=token, a token" in done.stderr
        )
    finally:
        head.terminate()
        head.wait(30)


@pytest.mark.skipif(not own_address(), reason="without a network nobody can reach a cluster")
def test_nothing_of_a_cluster_on_the_loopback_is_reached_from_elsewhere(
    nodes: Nodes, cluster: Cluster
) -> None:
    assert list(cluster.in_order(slow, [3])) == [9]
    ports = {int(nodes.address.rpartition(":")[2])}
    for node in cluster._ray.nodes():
        ports |= {node["NodeManagerPort"], node["ObjectManagerPort"]}
    assert len(ports) == 5
    for port in ports:
        socket.create_connection(("127.0.0.1", port), 5).close()
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((own_address(), port), 5)


def test_an_address_without_a_cluster_is_said() -> None:
    began_s = time.monotonic()
    with pytest.raises(
        JobError, match=r"no Ray cluster answers at 127.0.0.1:9: Connection refused. Start its head"
    ):
        opened(("ray", "127.0.0.1:9"))
    assert time.monotonic() - began_s < 5


def test_a_wrong_token_is_said(nodes: Nodes, tmp_path: Path) -> None:
    write(tmp_path)
    done = joshua(
        "dataset", "check", str(tmp_path), "--ray", nodes.address, RAY_AUTH_TOKEN="wrong-token-here"
    )
    assert done.returncode == 1, done.stderr
    assert (
        f"the Ray cluster at {nodes.address} refuses the token of this process. Set RAY_AUTH_MODE"
        in done.stderr
    )
    assert "Traceback" not in done.stderr
