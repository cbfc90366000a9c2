"""The executor on a Ray cluster: jobs are tasks, crews are actors, what a lost worker did is done again."""

from __future__ import annotations

import contextlib
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from joshua_jobs.executor import Crew, Executor, Item, JobError, Joint, Result, Stopped, never

from joshua_ray.addresses import LOCAL
from joshua_ray.failures import Losses, Patience, explained, require_train
from joshua_ray.joining import joined, started_here
from joshua_ray.together import run

#: How often a waiting executor asks whether it is stopped, and whether a worker is left.
POLL_S = 0.5

#: How long a cluster without any worker is given to get one.
PATIENCE_S = 30.0

#: Share of a core that a member of a crew reserves, so that the cores left after a loss suffice for all.
SHARE = 0.1


class Cluster(Executor):
    """The workers of a Ray cluster.

    Args:
        address: HOST:PORT of its head, of which this machine is a node; ``local`` starts one.
        limit: of jobs at the same time; None for one per core.
        patience_s: how long a cluster without any worker is given to get one.

    Raises:
        JobError: it cannot be reached, refuses the token, or has unprotected nodes off the loopback.
    """

    def __init__(self, address: str, limit: int | None = None, patience_s: float = PATIENCE_S) -> None:
        self._patience_s, self._limit = patience_s, limit
        self.address = address
        self._token = os.environ.get("RAY_AUTH_MODE"), os.environ.get("RAY_AUTH_TOKEN")
        self._ray: Any = started_here() if address == LOCAL else joined(address)

    @property
    def workers(self) -> int:
        """Cores of the nodes that are alive, or the limit if it is lower."""
        cores = int(self.cores())
        return cores if self._limit is None else min(cores, self._limit)

    def cores(self, resource: str = "CPU") -> float:
        """Return the cores, or GPUs, of the nodes that are alive, which tasks can reserve."""
        return sum(self._of_nodes(resource))

    def largest(self) -> float:
        """Return the cores of the node that has the most."""
        return max(self._of_nodes("CPU"), default=0.0)

    def _of_nodes(self, resource: str) -> list[float]:
        from ray import exceptions

        try:
            nodes = self._ray.nodes()
        except exceptions.RayError as error:
            raise self._gone(error) from error
        return [float(node["Resources"].get(resource, 0.0)) for node in nodes if node["Alive"]]

    def _gone(self, why: object) -> JobError:
        return JobError(
            f"the cluster {self.address} is lost: {str(why).rstrip('.')}. Start it, and run the command again"
        )

    def patience(self, each: float, count: int = 1, resource: str = "CPU") -> Patience:
        """Return what raises JobError once the cluster has had too few cores, or GPUs, for a while.

        Args:
            each: that a worker requires; count: of the workers.
        """
        return Patience(self.address, self.cores, each, count, self._patience_s, resource)

    def in_order(
        self,
        function: Callable[[Item], Result],
        items: Iterable[Item],
        stopping: Callable[[], bool] = never,
    ) -> Iterator[Result]:
        """See ``Executor``."""
        remote = self._ray.remote(num_cpus=1, max_retries=0)(function)
        # twice as many as cores, so that none waits for its next job; a limit must hold exactly
        limit = max(1, 2 * self.workers if self._limit is None else self._limit)
        waiting: deque[_Job] = deque()
        try:
            for item in items:
                waiting.append(_Job(remote, item, remote.remote(item), Losses(self.address)))
                if len(waiting) >= limit:
                    yield self._result(waiting.popleft(), stopping)
            while waiting:
                yield self._result(waiting.popleft(), stopping)
        finally:
            for job in waiting:
                with contextlib.suppress(Exception):
                    self._ray.cancel(job.answer, force=True)

    def crew(self, make: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> Crew:
        """See ``Executor``."""
        return _RayCrew(self, self._ray, make, arguments)

    def together(self, work: Joint[Any]) -> Iterator[Any]:
        """See ``Executor``."""
        require_train()
        gpus = self.cores("GPU") >= work.count if work.gpus is None else work.gpus
        return run(self, self._ray, SHARE, replace(work, gpus=gpus))

    def close(self) -> None:
        """See ``Executor``."""
        module, self._ray = self._ray, None
        if module is not None:
            module.shutdown()
            for name, value in zip(("RAY_AUTH_MODE", "RAY_AUTH_TOKEN"), self._token, strict=True):
                if value is None:
                    os.environ.pop(name, None)
                else:
                    os.environ[name] = value

    def _result(self, job: _Job, stopping: Callable[[], bool]) -> Any:
        while True:
            self.wait(job.answer, self.patience(1.0), stopping)
            found = self.answered(job.answer)
            if not isinstance(found, _Lost):
                return found
            self.lost += 1
            job.losses.add(found.why)
            job.answer = job.remote.remote(job.item)

    def wait(self, answer: Any, patience: Patience, stopping: Callable[[], bool]) -> None:
        """Wait for an answer.

        Raises:
            Stopped: ``stopping`` returned True. JobError: no worker was left for a while.
        """
        while not self._ray.wait([answer], timeout=POLL_S, fetch_local=False)[0]:
            if stopping():
                raise Stopped
            patience.check()

    def asked(self, answer: Any) -> Any:
        """Return the answer of an actor on this node. Raises JobError if it is lost, and so the node."""
        found = self.answered(answer)
        if isinstance(found, _Lost):
            raise self._gone(found.why)
        return found

    def end_of(self, work: Any) -> None:
        """Wait for the end of connected workers. Raises JobError if they could not work together."""
        try:
            found = self.answered(work)
        except JobError:
            raise
        except Exception as error:
            said = str(error).strip()
            if "No module named" in said:
                raise explained(self.address, ImportError(said)) from error
            last = said.splitlines()[-1] if said else type(error).__name__
            raise JobError(
                f"the workers of the cluster {self.address} cannot work together: {last[:300]}. Let the "
                "nodes connect to each other on all ports, and run the command again"
            ) from error
        if isinstance(found, _Lost):
            raise self._gone(found.why)

    def answered(self, answer: Any) -> Any:
        """Return an answer that is there, or ``_Lost``. Raises the exception of the job."""
        from ray import exceptions

        try:
            return self._ray.get(answer)
        except exceptions.RayTaskError as error:
            cause = getattr(error, "cause", None)
            if isinstance(cause, Exception):
                raise explained(self.address, cause) from None
            raise JobError(f"a job failed: {error}") from error
        except (
            exceptions.WorkerCrashedError,
            exceptions.LocalRayletDiedError,
            exceptions.NodeDiedError,
            exceptions.ObjectLostError,
            exceptions.OutOfMemoryError,
            exceptions.RayActorError,
            exceptions.RaySystemError,
        ) as error:
            return _Lost(str(error).partition("\n")[0] or type(error).__name__)
        except exceptions.RayError as error:
            raise JobError(f"the cluster {self.address} failed: {error}") from error


@dataclass
class _Job:
    """A job in progress."""

    remote: Any
    item: Any
    answer: Any
    losses: Losses


@dataclass(frozen=True)
class _Lost:
    """Stands for the answer of a worker that is lost."""

    why: str


class _Member:
    """An object in a worker."""

    def __init__(self, make: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        self._made = make(*arguments)

    def call(self, method: str, *arguments: Any) -> Any:
        """Call a method of the object."""
        return getattr(self._made, method)(*arguments)


class _RayCrew(Crew):
    def __init__(
        self, cluster: Cluster, module: Any, make: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]
    ) -> None:
        self._cluster, self._ray, self._make, self._arguments = cluster, module, make, list(arguments)
        self._kind = module.remote(num_cpus=SHARE, max_restarts=0, scheduling_strategy="SPREAD")(_Member)
        self._members = [self._made(some) for some in self._arguments]

    def _made(self, arguments: tuple[Any, ...]) -> Any:
        return self._kind.remote(self._make, arguments)

    def each(
        self,
        method: str,
        arguments: Sequence[tuple[Any, ...]],
        stopping: Callable[[], bool] = never,
    ) -> list[Any]:
        """See ``Crew``."""
        answers = [
            member.call.remote(method, *some) for member, some in zip(self._members, arguments, strict=True)
        ]
        return [
            self._result(index, method, arguments[index], answer, stopping)
            for index, answer in enumerate(answers)
        ]

    def _result(
        self, index: int, method: str, arguments: tuple[Any, ...], answer: Any, stopping: Callable[[], bool]
    ) -> Any:
        cluster, losses = self._cluster, Losses(self._cluster.address)
        while True:
            cluster.wait(answer, cluster.patience(SHARE, len(self._members)), stopping)
            found = cluster.answered(answer)
            if not isinstance(found, _Lost):
                return found
            cluster.lost += 1
            losses.add(found.why)
            self._members[index] = self._made(self._arguments[index])
            answer = self._members[index].call.remote(method, *arguments)

    def share(self, value: Any) -> Any:
        """See ``Crew``."""
        return self._ray.put(value)

    def close(self) -> None:
        """See ``Crew``."""
        members, self._members = self._members, []
        for member in members:
            with contextlib.suppress(Exception):
                self._ray.kill(member)
