"""Starting a Ray cluster of this machine, and joining one, unless others can reach it unprotected."""

from __future__ import annotations

import logging
import os
import secrets
import signal
import threading
from typing import Any

from joshua_jobs.executor import JobError

from joshua_ray.addresses import LOCAL, is_loopback, parsed, refuse_other_tls, refuse_unprotected

_LOG = logging.getLogger("joshua.ray")

#: How long the head may take to accept a connection.
CONNECT_S = 3.0

#: Ray's variable whose value 0 keeps it on the loopback, on every system despite its name.
LOOPBACK_ONLY = "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"

#: Memory for shared objects of a cluster of this machine, in bytes.
LOCAL_STORE = 128 * 1024 * 1024

#: Token of clusters of this machine that this process starts; Ray reads it once in a process.
_LOCAL_TOKEN = secrets.token_hex(32)


def started_here() -> Any:
    """Start a cluster of this machine, on the loopback, with a token that only its processes know.

    Raises:
        JobError: Ray cannot start it.
    """
    os.environ["RAY_AUTH_MODE"] = "token"
    os.environ["RAY_AUTH_TOKEN"] = _LOCAL_TOKEN
    module = _imported(on_loopback=True)
    try:
        _init(
            module,
            address=LOCAL,
            num_cpus=len(os.sched_getaffinity(0)),
            include_dashboard=False,
            object_store_memory=LOCAL_STORE,
        )
    except Exception as error:  # Ray has no class of its own for a start that takes too long
        module.shutdown()
        raise JobError(
            f"Ray cannot start a cluster of this machine: {_first(error)}. Free memory, disk space and "
            "cores, and run the command again"
        ) from error
    return module


def _first(error: Exception) -> str:
    """Return the first sentence of what Ray says."""
    return " ".join(str(error).split()).partition(". ")[0].rstrip(".")


def joined(address: str) -> Any:
    """Join a cluster as its driver. Raises JobError."""
    host, port = parsed(address)
    head = f"ray start --head --node-ip-address={host} --port={port} --include-dashboard=false"
    if is_loopback(host):
        head = f"{LOOPBACK_ONLY}=0 {head}"
    try:
        refuse_other_tls(address, os.environ, CONNECT_S)
    except OSError as error:
        raise JobError(
            f"no Ray cluster answers at {address}: {error.strerror or error}. Start its head "
            f"({head}), or correct the address"
        ) from error
    module = _imported(is_loopback(host))
    from ray import exceptions

    try:
        if _is_refused(f"127.0.0.1:{port}" if host == "localhost" else address):
            raise JobError(_REFUSED.format(address))
        _init(module, address=address)
        nodes = module.nodes()
    except (exceptions.RayError, ConnectionError, RuntimeError, OSError, ValueError) as error:
        module.shutdown()
        raise JobError(
            f"this machine cannot join the Ray cluster at {address}: {error}. Run the command on a node of "
            f"the cluster (ray start --address={address}), with the same versions of Python and Ray"
        ) from error
    far = sorted({node["NodeManagerAddress"] for node in nodes if node["Alive"]} - {host})
    far = [other for other in far if not is_loopback(other)]
    try:
        if far:
            refuse_unprotected(f"the node {far[0]} of the cluster at {address}", os.environ)
    except JobError:
        module.shutdown()
        raise
    return module


def _is_refused(address: str) -> bool:
    """Return whether a cluster refuses the token of this process; ``ray.init`` would not say why it fails.

    Ray has no public call that asks a cluster without joining it: its own commands use this class.
    """
    from ray._raylet import GcsClient

    try:
        return not GcsClient(address=address).cluster_id
    except Exception as error:  # noqa: BLE001 (ray.init explains everything else)
        return "auth" in str(error).lower()


_REFUSED = (
    "the Ray cluster at {} refuses the token of this process. Set RAY_AUTH_MODE=token and the token of "
    "the cluster (RAY_AUTH_TOKEN_PATH, RAY_AUTH_TOKEN, or ~/.ray/auth_token)"
)


def _init(module: Any, **options: Any) -> None:
    """Call ``ray.init``, and keep the handler of SIGTERM that it replaces.

    What Ray reports of nodes that end goes to the log. It would print it, with 20 lines of Ray's own log for
    each, and has no public setting for that: with ``log_to_driver=False``, it prints only less.
    """
    in_main = threading.current_thread() is threading.main_thread()
    handler = signal.getsignal(signal.SIGTERM)
    printing = module._private.worker
    if hasattr(printing, "print_to_stdstream"):
        printing.print_to_stdstream = _logged
    try:
        module.init(log_to_driver=False, logging_level="ERROR", **options)
    finally:
        if in_main:
            signal.signal(signal.SIGTERM, handler)


def _logged(report: dict[str, Any], *_: Any, **__: Any) -> None:
    """Log a report of Ray instead of printing it."""
    for text in report["lines"]:
        _LOG.info("%s", text)


def _imported(on_loopback: bool) -> Any:
    """Import Ray, without its reports of use.

    Args:
        on_loopback: keep Ray from replacing the loopback by the network address of this machine, where a
            cluster on the loopback does not listen. Ray reads the variable when it is imported.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    if on_loopback:
        os.environ[LOOPBACK_ONLY] = "0"
    import ray

    if ray.is_initialized():
        raise JobError("this process uses a Ray cluster already")
    return ray
