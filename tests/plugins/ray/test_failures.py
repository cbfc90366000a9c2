"""What a cluster that fails is said to lack, without a cluster."""

from __future__ import annotations

import sys

import pytest
from joshua_jobs.executor import JobError
from joshua_ray.failures import ATTEMPTS, Losses, Patience, explained, require_train

HEAD = "127.0.0.1:6379"


@pytest.mark.parametrize(
    ("address", "there", "each", "count", "limit_s", "resource", "said"),
    [
        (
            *(HEAD, 1.0, 0.1, 12, 0.0, "CPU"),
            f"the cluster {HEAD} has 1 core, and its 12 workers have required 1.2. Start nodes "
            f"(ray start --address={HEAD}) or lower workers to 10, and run the command again",
        ),
        (
            *("local", 2.0, 0.1, 30, 0.0, "CPU"),
            "the cluster local has 2 cores, and its 30 workers have required 3. Lower workers to 20, and "
            "run the command again",
        ),
        (
            *(HEAD, 2.0, 4.0, 1, 0.0, "CPU"),
            f"the cluster {HEAD} has 2 cores, and its worker has required 4. Start nodes "
            f"(ray start --address={HEAD}), and run the command again",
        ),
        (
            *("local", 2.0, 4.0, 1, 0.0, "CPU"),
            "the cluster local has 2 cores, and its worker has required 4. Run the command again",
        ),
        (
            *(HEAD, 0.0, 1.0, 1, 0.0, "CPU"),
            f"all workers of the cluster {HEAD} are lost: no node with a free core. Start nodes "
            f"(ray start --address={HEAD}), and run the command again",
        ),
        (
            *(HEAD, 1.0, 1.0, 2, 0.0, "GPU"),
            f"the cluster {HEAD} has 1 GPU, and its 2 workers have required 2. Start nodes "
            f"(ray start --address={HEAD}) or lower workers to 1, and run the command again",
        ),
        (
            *(HEAD, 0.0, 1.0, 2, 0.0, "GPU"),
            f"the cluster {HEAD} has no GPUs, and its 2 workers have required 2. Start nodes "
            f'(ray start --address={HEAD}) or train without GPUs (device: "cpu"), and run the command again',
        ),
    ],
)
def test_too_few_cores_or_gpus_are_said(
    address: str, there: float, each: float, count: int, limit_s: float, resource: str, said: str
) -> None:
    patience = Patience(address, {resource: there}.__getitem__, each, count, limit_s, resource)
    with pytest.raises(JobError) as caught:
        patience.check()
    assert str(caught.value) == said


def test_a_cluster_is_given_time_to_get_cores() -> None:
    cores = [1.0]
    patience = Patience(HEAD, lambda _: cores[0], 0.1, 20, 3600.0)
    patience.check()
    patience.check()
    cores[0] = 2.0
    patience.check()
    enough = Patience(HEAD, lambda _: 0.3, 0.1, 3, 0.0)
    enough.check()  # 3 * 0.1 is more than 0.3


def test_work_that_loses_its_workers_again_and_again_is_given_up() -> None:
    losses = Losses(HEAD)
    for _ in range(ATTEMPTS - 1):
        losses.add("the worker died")
    losses.end()  # something was done
    for _ in range(ATTEMPTS - 1):
        losses.add("the worker died")
    with pytest.raises(JobError) as caught:
        losses.add("the node was killed")
    assert str(caught.value) == (
        f"the cluster {HEAD} lost workers 4 times in a row with the same work, the last time because the "
        "node was killed. It may need more memory than a node has: lower workers, and run the command again"
    )


def test_a_module_that_a_worker_lacks_is_named() -> None:
    def said(name: str) -> str:
        return (
            f"a worker of the cluster {HEAD} cannot import {name}: install the same distributions of JOSHUA "
            "on every node, and run the command again"
        )

    for error in (
        ModuleNotFoundError("No module named 'joshua_imitation'", name="joshua_imitation"),
        ImportError("No module named 'joshua_imitation'"),
        RuntimeError("The function failed to import on the worker: No module named 'joshua_imitation'"),
    ):
        assert str(explained(HEAD, error)) == said("joshua_imitation")
    other = ValueError("item 4")
    assert explained(HEAD, other) is other


def test_ray_train_says_what_it_lacks(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("fsspec", "pandas", "psutil", "pyarrow", "pydantic", "requests"):
        monkeypatch.setitem(sys.modules, name, pytest)  # any module: installed
    monkeypatch.setitem(sys.modules, "pandas", None)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(JobError) as caught:
        require_train()
    assert str(caught.value) == (
        "workers that learn together require Ray Train, which lacks pandas, pyarrow: install "
        "joshua-ray[train] on every node (from a clone: tools/policies.sh policies)"
    )
    assert caught.value.exit_code == 3
    for name in ("pandas", "pyarrow"):
        monkeypatch.setitem(sys.modules, name, pytest)
    require_train()
