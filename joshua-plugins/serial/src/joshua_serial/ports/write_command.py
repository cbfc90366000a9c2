"""``joshua find-port --write``: write the identities of adapters into a configuration, all or none."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joshua.tools import EditError, ExitCode, edited_texts, load_readable, replace_texts, show_change

from joshua_serial.ports.identity import Ambiguous, NodePort, adapter_of, lasting_name
from joshua_serial.usb_ports import PortEntry, list_ports

if TYPE_CHECKING:
    import argparse

    from joshua.tools import LoadedConfig


#: Fields of a ``serial`` block that a new field may follow.
FIELDS = ("port", "serial_number", "vid_pid", "baudrate")


def write(arguments: argparse.Namespace, named: Sequence[PortEntry], device_root: str) -> int:
    """Write the identities and show the change. Exit code 0; 2 or 4 if nothing was written."""
    try:
        changed = _write(arguments, named, device_root)
    except EditError as error:
        sys.stderr.write(f"joshua find-port: {error}\nnothing was written\n")
        return error.code
    if not changed:
        sys.stdout.write(f"{arguments.write_to}: already names its adapters, so there is nothing to write\n")
    return ExitCode.OK


def node_ports(loaded: LoadedConfig) -> Iterator[NodePort]:
    """Return the nodes of a file that have a serial link."""
    from joshua.tools import wanted_nodes

    for want in wanted_nodes(loaded.graph, devices=True, models=False):
        comm: Any = getattr(want.block, "comm", None)
        if comm is not None and comm.HasField("serial"):
            serial = comm.serial
            yield NodePort(
                want.entry.node.node_name,
                f"{want.block_path}.comm.serial",
                serial.port,
                serial.serial_number,
                serial.vid_pid,
            )


def _write(arguments: argparse.Namespace, named: Sequence[PortEntry], device_root: str) -> bool:
    loaded = load_readable(arguments.write_to)
    nodes = _chosen_nodes(list(node_ports(loaded)), arguments)
    chosen = named[0] if arguments.ports else None
    ports = list_ports(device_root)
    values, problems = _identities(nodes, ports, chosen, device_root, is_named=bool(arguments.node))
    if problems:
        raise EditError("\n".join(problems), ExitCode.INVALID if ports else ExitCode.HARDWARE)
    texts = edited_texts(loaded, values, FIELDS)
    for name, text in texts.items():
        show_change(name, loaded.sources[name], text)
    if texts and not arguments.show_only:
        replace_texts(texts, lambda: _check(loaded.path, values))
    if not arguments.show_only:
        sys.stdout.write("".join(f"{name}: written\n" for name in texts))
    return bool(texts)


def _chosen_nodes(nodes: Sequence[NodePort], arguments: argparse.Namespace) -> Sequence[NodePort]:
    names = [node.node for node in nodes]
    if not nodes:
        raise EditError(
            f"{arguments.write_to}: no node has comm {{ serial {{ … }} }}, so there is nothing to write"
        )
    if arguments.node:
        nodes = [node for node in nodes if node.node == arguments.node]
        if not nodes:
            near = difflib.get_close_matches(arguments.node, names, n=1)
            hint = f"; nearest: {near[0]}" if near else ""
            raise EditError(
                f"{arguments.write_to} has no node {arguments.node} with a serial link{hint}. "
                f"Nodes with one: {', '.join(names)}"
            )
    if len(arguments.ports) > 1 or (arguments.ports and len(nodes) > 1):
        raise EditError(
            "several nodes or ports match: give one --port with one --node; nodes with a serial link: "
            f"{', '.join(names)}"
        )
    return nodes


def _identities(
    nodes: Sequence[NodePort],
    ports: Sequence[PortEntry],
    chosen: PortEntry | None,
    device_root: str,
    *,
    is_named: bool,
) -> tuple[dict[str, dict[str, str]], list[str]]:
    """Return the fields to write by path of the ``serial`` block, and what is ambiguous."""
    values: dict[str, dict[str, str]] = {}
    problems: list[str] = []
    owners: dict[str, str] = {}
    for node in nodes:
        try:
            entry = adapter_of(node, ports, device_root, is_named=is_named, chosen=chosen)
            fields = lasting_name(entry, ports, node)
        except Ambiguous as error:
            problems.append(str(error))
            continue
        real = str(Path(entry.path).resolve())
        if real in owners:
            problems.append(f"{node.node} and {owners[real]} both name {entry}: two nodes cannot share a bus")
        owners[real] = node.node
        if node.port and Path(node.port).resolve() != Path(entry.path).resolve():
            fields["port"] = entry.path
        known = {"serial_number": node.serial_number, "vid_pid": node.vid_pid, "port": node.port}
        fields = {name: value for name, value in fields.items() if known[name] != value}
        if fields:
            values[node.path] = fields
    return values, problems


def _check(path: str, values: dict[str, dict[str, str]]) -> None:
    """Read the file back. Raises EditError if a value is another one."""
    found = {node.path: node for node in node_ports(load_readable(path))}
    for serial_path, fields in values.items():
        for name, value in fields.items():
            if getattr(found.get(serial_path), name, None) != value:
                raise EditError(f"{serial_path}.{name} did not become {value!r}")
