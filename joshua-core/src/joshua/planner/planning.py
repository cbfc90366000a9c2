"""Config to Plan: which nodes start, with which implementation, settings and topics."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from joshua.modes import mode_name, mode_of
from joshua.plan import Diagnostic, Severity
from joshua.planner.devices import wanted_nodes
from joshua.planner.diagnostics import Diagnostics
from joshua.planner.resolution import Resolved, Resolver
from joshua.planner.services import ResolvedService, graph_services, physics_of, resolve_services
from joshua.plugins import SensorSpec
from joshua.schema import config_pb2 as pb

if TYPE_CHECKING:
    from joshua.config import LoadedConfig
    from joshua.plan import NodeSpec, Plan
    from joshua.planner.request import Request
    from joshua.plugins import Registry


class Planning:
    """One configuration on its way to a plan.

    Attributes:
        findings: every problem so far; ``resolve`` and ``plan`` add to it.
    """

    def __init__(self, loaded: LoadedConfig, registry: Registry, request: Request) -> None:
        self._config = loaded.config
        self._registry = registry
        self._request = request
        self._mode = mode_of(loaded.config, registry)
        self._findings = Diagnostics(loaded, launch=request.launch)
        self._graph = loaded.graph
        self._allows_uncalibrated = request.allow_uncalibrated or self._mode.works_uncalibrated
        self._resolver = Resolver(
            loaded.config,
            self._graph,
            registry,
            self._findings,
            request.path,
            allow_uncalibrated=self._allows_uncalibrated,
        )
        self._nodes: list[Resolved] = []
        self._services: list[ResolvedService] = []

    @property
    def findings(self) -> list[Diagnostic]:
        """What was found so far."""
        return self._findings.items

    def resolve(self) -> None:
        """Finds the implementations and checks the settings, which is all that validation needs."""
        config, mode = self._config, self._mode
        self._services = resolve_services(config, self._registry, mode, self._findings, self._request)
        self._graph = graph_services(self._services, self._graph, config)
        wanted = wanted_nodes(self._graph, devices=mode.devices, models=mode.models)
        self._nodes = self._resolver.resolve(wanted, physics_of(self._services))
        self._refuse_shared_terminal()
        self._check_command_line([want.entry.node.host for want in wanted])

    def plan(self) -> Plan | None:
        """Makes the plan of what was resolved; None where the transport cannot be chosen."""
        from joshua.plan import Plan
        from joshua.planner.node_planner import NodePlanner
        from joshua.planner.services import service_node
        from joshua.planner.transport_choice import transport_settings

        config, request = self._config, self._request
        planner = NodePlanner(
            self._mode,
            self._graph,
            self._registry,
            self._resolver.joints,
            self._findings,
            request,
            physics_of(self._services),
            allow_uncalibrated=self._allows_uncalibrated,
        )
        nodes = planner.specs(self._nodes)
        nodes += [service_node(resolved, self._graph, request) for resolved in self._services]
        if config.simulation.use_sim_time:
            nodes = [
                node.model_copy(update={"facts": replace(node.facts, use_sim_time=True)}) for node in nodes
            ]
        nodes = _share_of_host(nodes, request.host, self._findings)
        transport = transport_settings(config, request.path, self._findings, self._registry)
        if transport is None:
            return None
        self._note_partial_qos(nodes, transport.kind)
        return Plan(
            source=request.path,
            mode=pb.OperationMode.Name(config.general.mode) if mode_name(config) else "",
            robot_id=config.general.id,
            robot_name=config.general.name,
            nodes=tuple(_start_order(nodes)),
            transport=transport,
            duration_s=self._mode.duration_s(config) if request.duration_s is None else request.duration_s,
            verdict=self._mode.verdict,
        )

    def _check_command_line(self, hosts: list[str]) -> None:
        """A machine that no node names, and plugins to block that are not installed."""
        request = self._request
        if request.host and hosts and request.host not in hosts:
            self._findings.no_share(request.host, sorted({host for host in hosts if host}))
        for name in request.blocked_plugins:
            if not self._registry.knows(name):
                self._findings.nothing_to_block(name, self._registry)

    def _refuse_shared_terminal(self) -> None:
        """A key goes to one reader: which one would be chance."""
        readers = [node for node in self._nodes if isinstance(node.spec, SensorSpec) and node.spec.terminal]
        hosts: dict[str, str] = {}
        for reader in readers:
            node = reader.want.entry.node
            first = hosts.setdefault(node.host, node.node_name)
            if first != node.node_name:
                self._findings.add(
                    "terminal-shared",
                    Severity.ERROR,
                    f"{first} and {node.node_name} both read the terminal, and each key "
                    "reaches one of them only",
                    reader.want.block_path,
                    remedy="put the controls of both into one keyboard_config",
                )

    def _note_partial_qos(self, nodes: list[NodeSpec], kind: str) -> None:
        """Says once which quality-of-service settings do not act everywhere, and on which topics."""
        from joshua.transport.qos_rules import effective_qos_notes

        topics: dict[str, list[str]] = {}
        for node in nodes:
            for topic in (*node.publishers, *node.subscriptions):
                for note in effective_qos_notes(kind, topic.qos):
                    topics.setdefault(note, []).append(topic.name)
        for note, names in topics.items():
            where = ", ".join(dict.fromkeys(names))
            self._findings.add("qos-acts-partly", Severity.NOTE, f"{where}: {note}")


def _share_of_host(nodes: list[NodeSpec], host: str, findings: Diagnostics) -> list[NodeSpec]:
    """Keeps the nodes that this machine runs: those of ``--host``, or those that name no host."""
    hosts = sorted({node.host for node in nodes if node.host})
    mine = [node for node in nodes if node.host == host]
    if nodes and not mine:
        findings.no_share(host, hosts)
    return mine


def _start_order(nodes: list[NodeSpec]) -> list[NodeSpec]:
    """Puts nodes that only publish before those that listen, each group in the order of the file."""
    return sorted(nodes, key=lambda node: bool(node.subscriptions))
