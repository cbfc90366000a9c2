"""From Config to Plan: the nodes with their implementations, settings and topics."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from joshua.modes import mode_name
from joshua.planner.resolution import Resolved, resolve_nodes, wanted_nodes
from joshua.planner.services import ResolvedService, physics_of, resolve_services
from joshua.plugins import SensorSpec, StoreSpec
from joshua.schema import config_pb2 as pb
from joshua.textproto.nearest import nearest_first

if TYPE_CHECKING:
    from joshua.plan import NodeSpec, Plan
    from joshua.planner.draft import Draft


def resolve(draft: Draft) -> tuple[list[Resolved], list[ResolvedService]]:
    """Find the implementations and check the settings. Validation needs no more."""
    services = resolve_services(draft)
    wanted = wanted_nodes(draft.graph, devices=draft.mode.devices, models=draft.mode.models)
    nodes = resolve_nodes(draft, wanted, physics_of(services))
    if draft.graph.models:
        from joshua.planner.model_planner import check_models

        check_models(draft, nodes)
    _check_terminal(draft, nodes)
    hosts = [want.entry.node.host for want in wanted]
    if draft.request.host and hosts and draft.request.host not in hosts:
        _no_share(draft, hosts)
    for name in draft.request.blocked_plugins:
        if not draft.registry.knows(name):
            known = [row.distribution for row in draft.registry.rows()]
            message = f"--block-plugin names {name!r}, but no plugin of that name is installed"
            allowed = tuple(dict.fromkeys(nearest_first(name, known)))
            draft.findings.append(draft.warning("block-unknown", message, found=name, allowed=allowed))
    return nodes, services


def make_plan(draft: Draft, nodes: list[Resolved], services: list[ResolvedService]) -> Plan | None:
    """Make the plan of the resolved nodes; None if the transport cannot be chosen."""
    from joshua.plan import Plan
    from joshua.planner.node_planner import node_specs, store_facts
    from joshua.planner.services import service_node
    from joshua.planner.transport_choice import transport_settings

    config, request, mode = draft.config, draft.request, draft.mode
    specs = node_specs(draft, nodes, physics_of(services))
    stores = any(resolved.service.kind is StoreSpec for resolved in services)
    told = store_facts(draft, nodes) if stores else {}
    if draft.graph.models:
        from joshua.planner.model_planner import with_compressed_pictures

        specs = with_compressed_pictures(draft, specs)
    specs += [service_node(draft, resolved, told) for resolved in services]
    if config.simulation.use_sim_time:
        specs = [spec.model_copy(update={"facts": replace(spec.facts, use_sim_time=True)}) for spec in specs]
    added = {"extensions": draft.registry.extensions()}
    mine = [spec.model_copy(update=added) for spec in specs if spec.host == request.host]
    if specs and not mine:
        _no_share(draft, [spec.host for spec in specs])
    transport, problems = transport_settings(draft, draft.registry)
    draft.findings += problems
    if transport is None:
        return None
    _note_partial_qos(draft, mine, transport.kind)
    return Plan(
        source=request.path,
        mode=pb.OperationMode.Name(config.general.mode) if mode_name(config) else "",
        robot_id=config.general.id,
        robot_name=config.general.name,
        # Nodes that only publish start before those that subscribe, each group in the order of the file.
        nodes=tuple(sorted(mine, key=lambda spec: bool(spec.subscriptions))),
        transport=transport,
        duration_s=mode.duration_s(config) if request.duration_s is None else request.duration_s,
        verdict=mode.verdict,
    )


def _no_share(draft: Draft, used: list[str]) -> None:
    """No node of the file runs on this machine."""
    host, hosts = draft.request.host, sorted({host for host in used if host})
    if host:
        message, allowed = f"No node of the file runs on the host {host!r}", tuple(nearest_first(host, hosts))
        draft.findings.append(draft.error("unknown-host", message, found=host, allowed=allowed))
    else:
        message = "Every node of the file names a host, so it is unclear which of them run on this machine"
        remedy = f"Add --host {hosts[0]}"
        draft.findings.append(draft.error("host-needed", message, allowed=tuple(hosts), remedy=remedy))


def _check_terminal(draft: Draft, nodes: list[Resolved]) -> None:
    """Refuse two readers of one terminal, because each key would reach only one of them at random."""
    hosts: dict[str, str] = {}
    for want in (item.want for item in nodes if isinstance(item.spec, SensorSpec) and item.spec.terminal):
        node = want.entry.node
        first = hosts.setdefault(node.host, node.node_name)
        if first != node.node_name:
            message = (
                f"{first} and {node.node_name} both read the terminal; each key reaches only one of them"
            )
            draft.findings.append(draft.error("terminal-shared", message, want.block_path))


def _note_partial_qos(draft: Draft, nodes: list[NodeSpec], kind: str) -> None:
    """Note the quality-of-service settings that do not act everywhere, with their topics."""
    from joshua.transport.choice import partial_qos

    topics: dict[str, list[str]] = {}
    for node in nodes:
        for topic in (*node.publishers, *node.subscriptions):
            if note := partial_qos(kind, topic.qos):
                topics.setdefault(note, []).append(topic.name)
    for note, names in topics.items():
        message = f"{', '.join(dict.fromkeys(names))}: {note}"
        draft.findings.append(draft.note("qos-acts-partly", message))
