"""``joshua find-cameras --write``: write the stable names of cameras into a configuration, all or none."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from joshua.tools import (
    EditError,
    ExitCode,
    edited_texts,
    load_readable,
    nearest_first,
    replace_texts,
    show_change,
    wanted_nodes,
)

from joshua_camera.source_text import SourceKind, device_path, source_kind

if TYPE_CHECKING:
    import argparse

    from joshua.tools import LoadedConfig

    from joshua_camera.survey import FoundCamera

#: Fields of a ``camera_config`` that a new field may follow.
FIELDS = ("device_id", "width", "height", "fps")


@dataclass(frozen=True)
class CameraNode:
    """How a node of a file names its camera: the path of its block, its ``source`` and its device."""

    name: str
    block_path: str
    source: str
    device: str


def write(arguments: argparse.Namespace, cameras: Sequence[FoundCamera], root: str = "/") -> int:
    """Write the names and show the change. Exit code 0; 2 or 4 if nothing was written.

    Args:
        arguments: of the command; cameras: of this machine; root: folder that holds ``dev``.
    """
    try:
        changed = _write(arguments, cameras, root)
    except EditError as error:
        sys.stderr.write(f"joshua find-cameras: {error}\nnothing was written\n")
        return error.code
    if not changed:
        sys.stdout.write(f"{arguments.write_to}: already names its cameras, so there is nothing to write\n")
    return ExitCode.OK


def camera_nodes(loaded: LoadedConfig, root: str = "/") -> Iterator[CameraNode]:
    """Return the nodes of a file that read a camera of this machine."""
    for want in wanted_nodes(loaded.graph, devices=True, models=False):
        if want.block_name != "camera_config" or want.block is None:
            continue
        source = want.block.source
        if source and source_kind(source) is not SourceKind.DEVICE:
            continue
        path = device_path(source) if source else f"/dev/video{want.block.device_id}"
        device = os.path.join(root, path.lstrip("/"))  # noqa: PTH118 (the name of a device, as in the file)
        yield CameraNode(want.entry.node.node_name, want.block_path, source, device)


def _write(arguments: argparse.Namespace, cameras: Sequence[FoundCamera], root: str) -> bool:
    loaded = load_readable(arguments.write_to)
    nodes = _chosen(list(camera_nodes(loaded, root)), arguments)
    values = _names(nodes, cameras, arguments)
    texts = edited_texts(loaded, values, FIELDS)
    for name, text in texts.items():
        show_change(name, loaded.sources[name], text)
    if texts and not arguments.show_only:
        replace_texts(texts, lambda: _verify(loaded.path, values))
        sys.stdout.write("".join(f"{name}: written\n" for name in texts))
    return bool(texts)


def _chosen(nodes: Sequence[CameraNode], arguments: argparse.Namespace) -> Sequence[CameraNode]:
    """Return the nodes to write. Raises EditError."""
    names = [node.name for node in nodes]
    if not nodes:
        raise EditError(f"{arguments.write_to} has no node with a camera of this machine")
    if arguments.camera and not arguments.node:
        raise EditError(f"--camera chooses the camera of one node: add --node with one of {', '.join(names)}")
    if not arguments.node:
        return nodes
    nodes = [node for node in nodes if node.name == arguments.node]
    if not nodes:
        near = ", ".join(nearest_first(arguments.node, names))
        raise EditError(f"{arguments.write_to} has no camera node {arguments.node}. Its camera nodes: {near}")
    return nodes


def _names(
    nodes: Sequence[CameraNode], cameras: Sequence[FoundCamera], arguments: argparse.Namespace
) -> dict[str, dict[str, str]]:
    """Return the sources to write by the path of the block. Raises EditError, naming every problem."""
    values: dict[str, dict[str, str]] = {}
    owners: dict[str, str] = {}
    problems: list[str] = []
    for node in nodes:
        device = arguments.camera or node.device
        real = os.path.realpath(device)
        camera = next((item for item in cameras if os.path.realpath(item.path) == real), None)
        if camera is None:
            here = ", ".join(item.path for item in cameras)
            remedy = f"Cameras here: {here}. Choose one: --node {node.name} --camera PATH"
            problems.append(
                f"{node.name}: the camera {device} is not plugged in. "
                f"{remedy if here else 'Plug it in, because this machine has no camera'}"
            )
        elif not camera.source:
            problems.append(f"{node.name}: the system gives {camera.path} no stable name, so keep device_id")
        elif camera.path in owners:
            other = owners[camera.path]
            problems.append(f"{node.name} and {other} both name {camera.path}: choose another camera for one")
        else:
            owners[camera.path] = node.name
            if node.source != camera.source:
                values[node.block_path] = {"source": camera.source}
    if problems:
        raise EditError("\n".join(problems), ExitCode.INVALID if cameras else ExitCode.HARDWARE)
    return values


def _verify(path: str, values: dict[str, dict[str, str]]) -> None:
    """Read the file back. Raises EditError if a source is another one."""
    found = {node.block_path: node.source for node in camera_nodes(load_readable(path))}
    for block_path, fields in values.items():
        if found.get(block_path) != fields["source"]:
            raise EditError(f"{block_path}.source did not become {fields['source']!r}")
