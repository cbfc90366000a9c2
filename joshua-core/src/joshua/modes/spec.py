"""The declaration of an operation mode: one frozen ``ModeSpec``, in one file per mode."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from joshua.config.checks import Context
from joshua.plan import Diagnostic
from joshua.plan.graph import RobotGraph, ServiceTopic
from joshua.plugins import PluginSpec
from joshua.schema import config_pb2 as pb


@dataclass(frozen=True, eq=False, repr=False)
class ServiceSpec:
    """A service that a mode runs beside the devices.

    Attributes:
        path: field path of the block that requests it, such as ``ai.data_store``. The last part names the
            node.
        block: the part of that block that the mode uses. None if the file does not request the service, or
            for a service with a ``behaviour`` and no settings.
        kind: of the plugin that runs it; ``value``: the enum value that selects that plugin.
        is_chosen: whether the file selects a plugin. If not, a check reports that.
        node_name: of its node; "" takes the last part of the path.
        behaviour: import string of the node behaviour, for a service that the mode itself provides; settings:
            import string of the settings model for the block.
        required: the mode does not work without the plugin.
        topics: what it publishes and subscribes to, from the graph of the nodes.
        process_group: nodes of a group share a process; restart: ``on-failure``, ``never`` or ``stop-run``.
    """

    path: str
    block: Callable[[pb.Config], Any | None] = lambda config: None
    kind: type[PluginSpec] | None = None
    value: Callable[[pb.Config], str] = lambda config: ""
    is_chosen: Callable[[pb.Config], bool] = lambda config: True
    node_name: str = ""
    behaviour: str = ""
    settings: str = ""
    required: bool = False
    topics: Callable[[RobotGraph, pb.Config], Iterable[ServiceTopic]] = lambda graph, config: ()
    process_group: str = ""
    restart: str = "on-failure"

    @property
    def block_name(self) -> str:
        """Name of the block that requests it."""
        return self.path.rpartition(".")[2]

    @property
    def name(self) -> str:
        """Name of its node, by default that of its block."""
        return self.node_name or self.block_name

    def needed(self) -> ServiceSpec:
        """Return the same service, required by its mode."""
        return replace(self, required=True)


@dataclass(frozen=True, eq=False, repr=False)
class ModeSpec:
    """One operation mode.

    Attributes:
        name: value of ``OperationMode``, such as ``MODE_TEST``, or the name in ``general.plugin_mode``.
        check: finds what a file lacks for the mode.
        devices: it starts actuators and sensors; models: it starts the nodes of ``ai.models``.
        services: those that run beside them.
        blocks: further blocks of the file that have an effect in it, such as ``test``.
        for_file: adapts this spec to the file's choices.
        duration_s: the run ends after this time; None: it runs until it is stopped or done.
        run: import string of a function that runs the mode in place of nodes. Its arguments are the checked
            file, the command line's options, and the emulated devices or None. It returns the exit code. ""
            for a run of nodes.
        verdict: the run ends with a pass/fail table of what each node measured.
        works_uncalibrated: actuators may move within their position limits without a calibration.
        recalibrates: it makes a new calibration of the robot. The existing one is neither loaded nor checked.
        idle: name of an activity that starts no device, such as "an upload", for a note.
    """

    name: str
    check: Callable[[Context], Iterator[Diagnostic]] = lambda context: iter(())
    devices: bool = True
    models: bool = False
    services: tuple[ServiceSpec, ...] = ()
    blocks: tuple[str, ...] = ()
    for_file: Callable[[ModeSpec, pb.Config], ModeSpec] = lambda spec, config: spec
    duration_s: Callable[[pb.Config], float | None] = lambda config: None
    run: str = ""
    verdict: bool = False
    works_uncalibrated: bool = False
    recalibrates: bool = False
    idle: str = ""

    def uses(self, path: str) -> bool:
        """Whether a block of the file has an effect in this mode."""
        return path in self.blocks or any(service.path == path for service in self.services)
