"""Workers that are connected as a process group of PyTorch, by Ray Train, which this module imports.

Ray Train starts the workers, connects them, and starts all of them again when one is lost. What they tell
goes to a box of the caller: Ray Train's own reports and checkpoints are not used.
"""

from __future__ import annotations

import importlib
import logging
import os
import socket
import tempfile
import time
from dataclasses import dataclass
from typing import Any

import psutil
import ray
from joshua_jobs.executor import Disconnected, JobError, Post
from ray.train import FailureConfig, LoggingConfig, RunConfig, ScalingConfig, UserCallback
from ray.train.torch import TorchConfig, TorchTrainer

#: How often a worker asks whether it has to stop.
POLL_S = 0.3

#: How long a worker that cannot reach the others waits for Ray, which notices a lost node after about 30 s.
NOTICED_S = 60.0

#: Longest wait of a worker for the others: they read their data, or compute.
PATIENCE_S = 1800

#: Ray Train's variables: look at the workers often, and start neither its metrics nor its watch of nodes
#: that a cloud takes back, which are counted when they are gone.
_VARIABLES = {
    "RAY_TRAIN_V2_ENABLED": "1",
    "RAY_TRAIN_HEALTH_CHECK_INTERVAL_S": "0.5",
    "RAY_TRAIN_METRICS_ENABLED": "0",
    "RAY_TRAIN_ENABLE_PREEMPTION_WATCHER": "0",
}


def fit(told: dict[str, Any], count: int, share: float, gpus: bool) -> None:
    """Run a function in connected workers, see ``Executor.together``, until it returns in all.

    Args:
        told: ``function`` as module:name, its ``item``, the ``box``; count: of the workers.
        share: part of a core that each reserves; gpus: whether each has one.
    """
    os.environ.update({name: os.environ.get(name, value) for name, value in _VARIABLES.items()})
    logging.getLogger("ray.train").setLevel(logging.CRITICAL)  # what matters is told
    with tempfile.TemporaryDirectory(prefix="joshua-ray-train-", ignore_cleanup_errors=True) as scratch:
        TorchTrainer(
            _work,
            train_loop_config=told,
            torch_config=_Torch(timeout_s=PATIENCE_S),
            scaling_config=ScalingConfig(
                num_workers=count,
                use_gpu=gpus,
                resources_per_worker={"CPU": share, **({"GPU": 1} if gpus else {})},
                placement_strategy="SPREAD",
            ),
            run_config=RunConfig(
                name="together",
                storage_path=scratch,
                failure_config=FailureConfig(max_failures=-1),
                callbacks=[_Losses(told["box"])],
                logging_config=LoggingConfig(log_level="CRITICAL"),
            ),
        ).fit()


@dataclass
class _Losses(UserCallback):  # type: ignore[misc,unused-ignore]
    """Tells the losses of workers, which Ray Train finds."""

    box: Any

    def after_exception(self, run_context: Any, worker_exceptions: dict[int, Exception]) -> None:
        """See ``UserCallback``."""
        del run_context
        gone = [error for error in worker_exceptions.values() if not _is_of_the_function(error)]
        first = next(iter(gone or worker_exceptions.values()))
        why = " ".join(str(first).split())[:200]
        ray.get(self.box.put.remote("lost", (max(1, len(gone)), why or type(first).__name__)))


def _is_of_the_function(error: Exception) -> bool:
    return type(error).__name__ == "UserExceptionWithTraceback"


class _Post(Post):
    def __init__(self, box: Any) -> None:
        self._box, self._asked_s, self._stopping = box, 0.0, False
        self._answer: Any = None

    def tell(self, value: Any) -> None:
        """See ``Post``."""
        self._box.put.remote("told", value)

    def fail(self, error: Exception) -> None:
        """Tell the exception of the function, and wait until it has arrived."""
        try:
            ray.get(self._box.put.remote("failed", error))
        except Exception:  # noqa: BLE001 (one that cannot be sent)
            ray.get(self._box.put.remote("failed", JobError(f"{type(error).__name__}: {error}")))

    @property
    def stopping(self) -> bool:
        """See ``Post``. The answer of the last question but one, so that nobody waits."""
        if self._answer is None and time.monotonic() - self._asked_s > POLL_S:
            self._answer, self._asked_s = self._box.stopping.remote(), time.monotonic()
        if self._answer is not None and ray.wait([self._answer], timeout=0)[0]:
            self._stopping, self._answer = bool(ray.get(self._answer)), None
        return self._stopping


def _work(told: dict[str, Any]) -> None:
    """Do the work of one worker."""
    post = _Post(told["box"])
    try:
        module, _, name = told["function"].partition(":")
        getattr(importlib.import_module(module), name)(told["item"], post)
    except Disconnected:
        time.sleep(NOTICED_S)  # Ray finds the lost worker, counts it, and ends this one
        raise
    except Exception as error:  # noqa: BLE001 (raised where the caller is; Ray would try again)
        post.fail(error)


class _Connected(TorchConfig().backend_cls):  # type: ignore[misc,unused-ignore]
    """Connects the workers by the network of their nodes. A host name may stand for the loopback alone.

    Gloo chooses the network before the function of the workers runs. Ray has no setting for it that can
    differ from node to node; ``on_start`` of the class ``backend_cls`` is its documented developer interface.
    """

    def on_start(self, worker_group: Any, backend_config: Any) -> None:
        """See ``Backend``."""
        worker_group.execute(use_network_of_node)
        super().on_start(worker_group, backend_config)


@dataclass
class _Torch(TorchConfig):  # type: ignore[misc,unused-ignore]
    @property
    def backend_cls(self) -> Any:
        """See ``BackendConfig``."""
        return _Connected


def use_network_of_node() -> None:
    """Let this worker listen where its node does, unless the user has chosen an interface."""
    address = ray.util.get_node_ip_address()
    families = (socket.AF_INET, socket.AF_INET6)
    for name, known in psutil.net_if_addrs().items():
        if any(item.family in families and item.address.partition("%")[0] == address for item in known):
            for variable in ("GLOO_SOCKET_IFNAME", "NCCL_SOCKET_IFNAME"):
                os.environ.setdefault(variable, name)
            return
