"""What fails on a cluster, and when it is too much: missing cores, lost workers, missing modules."""

from __future__ import annotations

import importlib.util
import re
import time
from collections.abc import Callable

from joshua_jobs.executor import JobError

from joshua_ray.addresses import LOCAL

#: Losses in a row: the work probably ends its worker.
ATTEMPTS = 4

#: What Ray Train requires beside Ray.
_FOR_RAY_TRAIN = ("fsspec", "pandas", "psutil", "pyarrow", "pydantic", "requests")

_NAMES = {"CPU": ("core", "cores"), "GPU": ("GPU", "GPUs")}


class Patience:
    """Gives a cluster that has too few cores, or GPUs, time to get some.

    Args:
        address: of the cluster; there: returns how many it has of a resource, or raises JobError.
        each, count: how many a worker requires, and the number of workers.
        limit_s: how long they may be missing; resource: ``CPU`` or ``GPU``.
    """

    def __init__(
        self,
        address: str,
        there: Callable[[str], float],
        each: float,
        count: int,
        limit_s: float,
        resource: str = "CPU",
    ) -> None:
        self._address, self._there, self._each, self._count = address, there, each, count
        self._needed = round(each * count, 6)  # 0.1 of a core has no exact value
        self._limit_s, self._resource = limit_s, resource
        self._since: float | None = None

    def check(self) -> None:
        """To be called often. Raises JobError if cores have been missing for too long."""
        gone: JobError | None = None
        try:
            there = self._there(self._resource)
        except JobError as error:  # also of a busy machine, for a while
            there, gone = 0.0, error
        if there >= self._needed:
            self._since = None
            return
        now = time.monotonic()
        self._since = now if self._since is None else self._since
        if now - self._since >= self._limit_s:
            raise gone or JobError(self._lack(there))

    def _lack(self, there: float) -> str:
        one, many = _NAMES[self._resource]
        waited = f" for {self._limit_s:g} s" if self._limit_s else ""
        fewer = int(round(there / self._each, 6))
        if there or self._resource != "CPU":
            workers = f"its {self._count} workers have" if self._count > 1 else "its worker has"
            has = f"has {f'{there:g}' if there else 'no'} {one if there == 1 else many}"
            found = f"the cluster {self._address} {has}, and {workers} required {self._needed:g}{waited}"
        else:
            found = f"all workers of the cluster {self._address} are lost: no node with a free core{waited}"
        remedies = [f"start nodes (ray start --address={self._address})"] if self._address != LOCAL else []
        if fewer:
            remedies.append(f"lower workers to {fewer}")
        elif self._resource == "GPU":
            remedies.append('train without GPUs (device: "cpu")')
        then = f"{' or '.join(remedies)}, and run the command again" if remedies else "run the command again"
        return f"{found}. {then[0].upper()}{then[1:]}"


class Losses:
    """Counts losses in a row.

    Args:
        address: of the cluster.
    """

    def __init__(self, address: str) -> None:
        self._address, self._in_a_row = address, 0

    def end(self) -> None:
        """Note that something was done since the last loss."""
        self._in_a_row = 0

    def add(self, why: str) -> None:
        """Count a loss. Raises JobError if it is one too many."""
        self._in_a_row += 1
        if self._in_a_row == ATTEMPTS:
            raise JobError(
                f"the cluster {self._address} lost workers {ATTEMPTS} times in a row with the same work, the "
                f"last time because {why}. It may need more memory than a node has: lower workers, and run "
                "the command again"
            )


def explained(address: str, error: Exception) -> Exception:
    """Return an exception of a job; a JobError if a module is missing where it ran."""
    text = str(error)
    if not isinstance(error, ImportError) and "failed to import on the worker" not in text:
        return error
    found = re.search(r"No module named '([^']+)'", text)
    module = getattr(error, "name", None) or (found[1] if found else "the job")
    return JobError(
        f"a worker of the cluster {address} cannot import {module}: install the same distributions of JOSHUA "
        "on every node, and run the command again"
    )


def require_train() -> None:
    """Raise JobError if Ray Train cannot be imported here."""
    lacking = [name for name in _FOR_RAY_TRAIN if importlib.util.find_spec(name) is None]
    if lacking:
        raise JobError(
            f"workers that learn together require Ray Train, which lacks {', '.join(lacking)}: install "
            "joshua-ray[train] on every node (from a clone: tools/policies.sh policies)",
            3,
        )
