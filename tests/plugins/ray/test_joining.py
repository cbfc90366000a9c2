"""Clusters that Ray cannot start or reach, with a stand-in for Ray."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from joshua_jobs.executor import JobError
from joshua_ray.cluster import Cluster


class RayError(Exception):
    """Stands for Ray's."""


def refused(*_: Any, **__: Any) -> Any:
    raise RayError("Timed out while waiting for GCS to become available.")


def slow(*_: Any, **__: Any) -> Any:
    raise Exception("The current node timed out during startup.")  # as Ray does


def nothing(*_: Any, **__: Any) -> None:
    """Does nothing."""


@pytest.fixture
def with_ray(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    def install(init: Any, nodes: Any) -> None:
        ray = SimpleNamespace(
            is_initialized=lambda: False,
            _private=SimpleNamespace(worker=SimpleNamespace()),
            exceptions=SimpleNamespace(RayError=RayError),
            init=init,
            nodes=nodes,
            shutdown=nothing,
        )
        monkeypatch.setitem(sys.modules, "ray", ray)

    for name in ("RAY_AUTH_MODE", "RAY_AUTH_TOKEN", "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"):
        monkeypatch.setenv(name, "")  # changed by a start
    return install


def test_a_cluster_that_does_not_start_is_explained(with_ray: Callable[..., None]) -> None:
    with_ray(slow, nothing)
    with pytest.raises(JobError) as caught:
        Cluster("local")
    assert str(caught.value) == (
        "Ray cannot start a cluster of this machine: The current node timed out during startup. Free memory, "
        "disk space and cores, and run the command again"
    )


def test_a_cluster_that_does_not_answer_is_given_time(with_ray: Callable[..., None]) -> None:
    with_ray(nothing, refused)
    for patience_s in (3600.0, 0.0):
        with Cluster("local", patience_s=patience_s) as cluster:
            patience = cluster.patience(1.0)
            if patience_s:
                patience.check()
                continue
            for ask in (patience.check, cluster.cores, cluster.largest):
                with pytest.raises(JobError) as caught:
                    ask()
                assert str(caught.value) == (
                    "the cluster local is lost: Timed out while waiting for GCS to become available. Start "
                    "it, and run the command again"
                )
