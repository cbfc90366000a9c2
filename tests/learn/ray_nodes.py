"""Ray clusters of several nodes on the loopback, with a token."""

from __future__ import annotations

import inspect
import os
import secrets
from typing import Any

from joshua.testing.port import free_port

os.environ |= {
    "RAY_AUTH_MODE": "token",
    "RAY_AUTH_TOKEN": os.environ.get("RAY_AUTH_TOKEN") or secrets.token_hex(16),
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",  # on the loopback
    "RAY_health_check_period_ms": "500",  # a lost node is noticed soon
    "RAY_health_check_failure_threshold": "3",
    "RAY_worker_niceness": "0",  # workers advance on a busy machine
}

from ray._private import services
from ray._raylet import persist_port
from ray.cluster_utils import Cluster as Cluster

STORE = 80 * 1024 * 1024

AGENT_PORTS = (
    "metrics_agent_port",
    "metrics_export_port",
    "dashboard_agent_listen_port",
    "runtime_env_agent_port",
)


def start_raylet(*given: Any, **named: Any) -> Any:
    """Starts a raylet without its wait for agents, which may take longer than its limit on a busy machine."""
    values = inspect.signature(real_start_raylet).bind(*given, **named).arguments
    for name in AGENT_PORTS:
        persist_port(values["session_dir"], values["node_id"], name, values[name])
    return real_start_raylet(*given, **named)


real_start_raylet = services.start_raylet
services.start_raylet = start_raylet


def on_loopback(cores: int) -> dict[str, Any]:
    """What a node is started with."""
    return {
        "num_cpus": cores,
        "object_store_memory": STORE,
        "node_ip_address": "127.0.0.1",
        **{name: free_port() for name in AGENT_PORTS},
    }


def started(cores: int) -> Cluster:
    return Cluster(initialize_head=True, head_node_args={**on_loopback(cores), "include_dashboard": False})


def add_worker(nodes: Cluster) -> Any:
    return nodes.add_node(**on_loopback(1))
