"""Loads and merges a configuration: the file, its includes, and the ``--set`` options."""

from __future__ import annotations

import os.path
import re
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from joshua.config.files import FileId, file_id, read_source
from joshua.config.graph import build_graph
from joshua.schema.config_pb2 import Config
from joshua.textproto.binder import Binder, Merge
from joshua.textproto.diagnostics import Diagnostics, Span
from joshua.textproto.limits import MAX_FILES, MAX_INCLUDE_DEPTH
from joshua.textproto.parser import parse
from joshua.textproto.plugin_types import PluginTypes
from joshua.textproto.positions import Positions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from google.protobuf.message import Message

    from joshua.plan import Diagnostic
    from joshua.plan.graph import RobotGraph


_ROBOT_ID = r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}"


@dataclass(frozen=True, eq=False, repr=False)
class LoadedConfig:
    """A configuration from its files. If they have errors, it contains what could be read.

    Attributes:
        path: of the requested file.
        config: the merged message. ``include`` keeps the paths in the files.
        positions: position of each field. A field whose value could not be read is set and broken
            (``positions.is_broken``). The message then contains its default, which needs no further findings.
        diagnostics: findings of reading, file by file and from top to bottom.
        sources: file name, as in positions, to text. The file itself is first, the options of ``--set`` last,
            one per line.
        is_readable: False if the file itself could not be read and nothing is known about it.
        calibration_file: the robot's calibration file, if it was loaded because no other file has a
        calibration.
    """

    path: str
    config: Config
    positions: Positions
    diagnostics: list[Diagnostic] = field(default_factory=list)
    sources: dict[str, str] = field(default_factory=dict)
    is_readable: bool = True
    calibration_file: str = ""

    @cached_property
    def graph(self) -> RobotGraph:
        """The nodes of the configuration and the topics between them."""
        return build_graph(self.config)


def calibration_path(config_path: str, robot_id: str) -> str:
    """Path of a robot's calibration file; "" for an invalid id.

    Args:
        config_path: of the configuration in the same folder.
    """
    if not re.fullmatch(_ROBOT_ID, robot_id):
        return ""
    folder = os.path.dirname(config_path)  # noqa: PTH120 - keeps the path as the user wrote it
    return os.path.join(folder, "calibration", f"{robot_id}.pbtxt")  # noqa: PTH118


def journal_path(calibration_file: str, node_name: str) -> str:
    """Path of the file that marks an arm's calibration as being written. It remains if interrupted."""
    return f"{calibration_file.removesuffix('.pbtxt')}.{node_name}.interrupted.json"


def load(
    path: str | os.PathLike[str],
    overrides: Sequence[str] = (),
    message_types: Iterable[str | type[Message]] = (),
    calibration: Callable[[str, Config], str] = lambda path, config: calibration_path(
        path, config.general.id
    ),
) -> LoadedConfig:
    """Load a configuration file. Never raises because of its content.

    A file without a calibration gets that of its robot, if there is one.

    Args:
        path: of the file.
        overrides: options of ``--set``, such as ``general.name=demo``; the last one wins.
        message_types: types for ``plugin_config`` blocks: message classes, or import strings of compiled
            ``_pb2`` modules. They are loaded only if a block needs them.
        calibration: names the calibration file of a configuration by its path and content; "" for none.
    """
    return _Loading(os.fspath(path), PluginTypes(message_types)).run(overrides, calibration)


class _OpenFile(NamedTuple):
    """A file being read, for the chain of includes."""

    identity: FileId
    name: str


class _Loading:
    def __init__(self, path: str, types: PluginTypes) -> None:
        self._path = path
        self._config = Config()
        self._positions = Positions()
        self._problems = Diagnostics()
        self._merge = Merge(self._positions, self._problems, types)
        self._sources: dict[str, str] = {}
        self._chain: list[_OpenFile] = []
        self._included: dict[FileId, tuple[str, Span | None]] = {}

    def run(self, overrides: Sequence[str], calibration: Callable[[str, Config], str]) -> LoadedConfig:
        self._read(self._path, None)
        is_readable = self._path in self._sources
        if overrides and is_readable:
            from joshua.textproto.overrides import OPTION, apply_overrides

            self._sources[OPTION] = apply_overrides(overrides, self._config, self._merge)
        calibration_file = self._load_calibration(calibration) if is_readable else ""
        return LoadedConfig(
            self._path,
            self._config,
            self._positions,
            self._problems.items,
            self._sources,
            is_readable,
            calibration_file,
        )

    def _load_calibration(self, calibration: Callable[[str, Config], str]) -> str:
        if self._config.HasField("calibration"):
            return ""
        path = calibration(self._path, self._config)
        identity = file_id(path) if path else None
        if identity is None or identity in self._included:
            return ""
        self._read(path, None)
        return path

    def _read(self, path: str, at: Span | None) -> None:
        identity = file_id(path)
        if identity is not None and not self._may_read(identity, path, at):
            return
        source = read_source(path, self._problems, at)
        if source is None or identity is None:
            return
        self._sources[path] = source.text
        self._included[identity] = (path, at)
        self._chain.append(_OpenFile(identity, path))
        fields = parse(source, self._problems)
        Binder(source, self._merge, self._include).document(self._config, fields)
        self._chain.pop()

    def _include(self, value: str, at: Span) -> None:
        folder = os.path.dirname(at.source.name)  # noqa: PTH120 - keeps the path as the user wrote it
        if not value:
            self._problems.error(
                "include-missing", "The path of the included file is empty.", at, path="include", found='""'
            )
        else:
            home = os.path.expanduser(value)  # noqa: PTH111 - an unknown user stays as written
            self._read(os.path.normpath(os.path.join(folder, home)), at)  # noqa: PTH118

    def _may_read(self, identity: FileId, path: str, at: Span | None) -> bool:
        """Report a cycle of includes, a second include of one file, and too many files."""
        names = [file.name for file in self._chain]
        identities = [file.identity for file in self._chain]
        related: list[tuple[Span, str]] = []
        if identity in identities:
            chain = [*names[identities.index(identity) :], path]
            code, message = "include-cycle", f"The file includes itself: {' → '.join(chain)}."
        elif identity in self._included:
            name, first = self._included[identity]
            code, message = "include-twice", f"{name} is included already; its content would be added twice."
            related = [] if first is None else [(first, "it is included first here")]
        elif len(self._included) >= MAX_FILES:
            code, message = "too-many-files", f"More than {MAX_FILES} files are included."
        elif len(self._chain) > MAX_INCLUDE_DEPTH:
            code = "include-too-deep"
            message = f"A chain of includes has more than {MAX_INCLUDE_DEPTH} files."
        else:
            return True
        self._problems.error(code, message, at, path="include", found=path, related=related)
        return False
