"""Match adapters to the nodes of a configuration and choose a permanent name for each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from joshua_serial.errors import PortNotFound
from joshua_serial.usb_ports import Endpoint, PortEntry, is_lasting_name, resolve


class Ambiguous(Exception):
    """The adapter of a node, or its name, is ambiguous. The message gives the remedy."""


@dataclass(frozen=True)
class NodePort:
    """How a node of a file names its serial port.

    Attributes:
        path: field path of its ``serial`` block.
    """

    node: str
    path: str
    port: str
    serial_number: str
    vid_pid: str


def adapter_of(
    node: NodePort, ports: Sequence[PortEntry], device_root: str, *, is_named: bool, chosen: PortEntry | None
) -> PortEntry:
    """Return the adapter that a node refers to.

    Args:
        ports: all connected adapters; chosen: the one that the user named.
        is_named: the user named this node, so a single adapter must be its own.

    Raises:
        Ambiguous: several adapters are possible.
    """
    if chosen is not None:
        if not chosen.vid_pid:
            raise Ambiguous(
                f"{node.node}: {chosen.path} is not a USB adapter, so it has no identity to write"
            )
        return chosen
    endpoint = Endpoint(node.port, node.serial_number, node.vid_pid, device_root)
    if node.serial_number or node.vid_pid:
        try:
            return resolve(endpoint)
        except PortNotFound as error:
            if not is_named:
                raise Ambiguous(
                    f"{node.node}: {error} Or name the adapter: --node {node.node} --port PATH"
                ) from error
    else:
        entry = resolve(endpoint)
        if entry.vid_pid:
            return entry
    if is_named and len(ports) == 1:
        return ports[0]
    if not ports:
        raise Ambiguous(
            f"{node.node}: {endpoint} is not plugged in, nor is any other adapter: plug it in first"
        )
    listing = "".join(f"\n    {port}" for port in ports)
    raise Ambiguous(
        f"{node.node}: {endpoint} is not plugged in, and the file does not say which of the others to use. "
        f"Adapters here:{listing}\n"
        f"  choose one: --node {node.node} --port PATH"
    )


def lasting_name(entry: PortEntry, ports: Sequence[PortEntry], node: NodePort) -> dict[str, str]:
    """Return the ``serial`` fields that identify an adapter in any socket.

    Raises:
        Ambiguous: the adapter has no unique identity.
    """
    if entry.serial_number:
        equal = [port for port in ports if port.serial_number == entry.serial_number]
        values = {"serial_number": entry.serial_number}
        if len(equal) > 1 or (node.vid_pid and node.vid_pid.lower() != entry.vid_pid.lower()):
            values["vid_pid"] = entry.vid_pid
        if sum(port.vid_pid == entry.vid_pid for port in equal) < 2:
            return values
        kind = f"the serial number {entry.serial_number}"
    elif node.serial_number:
        raise Ambiguous(
            f"{node.node}: {entry} has no serial number, and the file names {node.serial_number}: "
            f"remove that line from {node.path}"
        )
    else:
        equal = [port for port in ports if port.vid_pid == entry.vid_pid]
        if len(equal) < 2:
            return {"vid_pid": entry.vid_pid}
        kind = f"no serial number, and the product {entry.vid_pid}"
    if is_lasting_name(node.port) and Path(node.port).exists():
        return {}  # a udev rule names it by its socket, and the file already uses that name
    paths = ", ".join(port.path for port in equal)
    raise Ambiguous(
        f"{node.node}: {len(equal)} adapters have {kind} ({paths}), which does not distinguish them. Name "
        "each by its socket: joshua doctor --udev"
    )
