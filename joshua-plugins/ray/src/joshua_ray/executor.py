"""The entry point of the executor ``ray``. Ray is imported when it is connected."""

from __future__ import annotations

import importlib.util
import os

from joshua_jobs.executor import Executor, JobError

from joshua_ray import addresses

NOT_INSTALLED = (
    "--ray requires Ray, which is not installed: install joshua-ray[cluster] "
    "(from a clone: ./run --with 'ray[cluster]')"
)


def check(address: str) -> None:
    """Refuse an address that must not be used; see ``joshua_jobs.check_address``."""
    addresses.check(address, os.environ)
    if importlib.util.find_spec("ray") is None:
        raise JobError(NOT_INSTALLED, 3)


def connect(address: str, workers: int | None) -> Executor:
    """Connect to a cluster; at most so many jobs run at the same time."""
    from joshua_ray.cluster import Cluster

    return Cluster(address, workers)
