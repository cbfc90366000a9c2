"""The caller's side of workers that are connected, which Ray Train manages in a task of its own."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from joshua_jobs.executor import Joint

from joshua_ray.failures import Losses, explained

if TYPE_CHECKING:
    from joshua_ray.cluster import Cluster

#: How often the caller looks for what the workers tell.
POLL_S = 0.3

#: How long the other workers may take to end after the function has failed in one.
PARTING_S = 20.0


def run(cluster: Cluster, module: Any, share: float, joint: Joint[Any]) -> Iterator[Any]:
    """See ``Executor.together``.

    Args:
        module: Ray; share: part of a core that a worker reserves.
    """
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

    function, count, gpus = joint.function, joint.count, bool(joint.gpus)
    here = NodeAffinitySchedulingStrategy(module.get_runtime_context().get_node_id(), soft=False)
    box = module.remote(num_cpus=0, scheduling_strategy=here)(Box).remote()
    told = {"function": f"{function.__module__}:{function.__qualname__}", "item": joint.item, "box": box}
    work = module.remote(num_cpus=0, max_retries=0, scheduling_strategy=here)(fit).remote(
        told, count, share, gpus
    )
    patience = [cluster.patience(share, count), *([cluster.patience(1.0, count, "GPU")] if gpus else [])]
    losses, failure, until_s = Losses(cluster.address), None, float("inf")
    while True:
        ended = bool(module.wait([work], timeout=0, fetch_local=False)[0])  # before the box is emptied
        for kind, value in cluster.asked(box.take.remote(joint.stopping())):
            if kind == "told":
                losses.end()
                yield value
            elif kind == "lost":
                cluster.lost += value[0]
                losses.add(value[1])
            elif failure is None:
                failure, until_s = value, time.monotonic() + PARTING_S
        if failure is not None and (ended or time.monotonic() > until_s):
            raise explained(cluster.address, failure)
        if ended:
            cluster.end_of(work)
            return
        for each in patience:
            each.check()
        yield None
        module.wait([work], timeout=POLL_S, fetch_local=False)


def fit(*arguments: Any) -> None:
    """Let Ray Train work, in a process of the cluster: what it waits for can be left at any time."""
    from joshua_ray.fitting import fit as fit_there

    fit_there(*arguments)


class Box:
    """Actor that keeps what was told until the caller takes it."""

    def __init__(self) -> None:
        self._kept: list[tuple[str, Any]] = []
        self._stopping = False

    def put(self, kind: str, value: Any) -> None:
        """Keep something."""
        self._kept.append((kind, value))

    def take(self, stopping: bool) -> list[tuple[str, Any]]:
        """Return what is kept, and keep whether to stop."""
        self._stopping = self._stopping or stopping
        kept, self._kept = self._kept, []
        return kept

    def stopping(self) -> bool:
        """Return whether to stop."""
        return self._stopping
