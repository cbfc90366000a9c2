"""What an operation mode is: one frozen ``ModeSpec``, in one file for each mode."""

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
        path: field path of the block that asks for it, such as ``ai.data_store``; its last part names the
            node.
        block: that block as far as the mode uses it; None where the file asks for no such service, and for a
            service with a ``behaviour`` where there are no settings.
        kind: of the plugin that runs it, and ``value``: the enum value by which that plugin is chosen.
        is_chosen: whether the file says which plugin is meant; where it does not, a check says so.
        node_name: of its node; "" takes the last part of the path.
        behaviour: import string of the node behaviour of a service that the mode brings itself and no other
            plugin runs; settings: of the settings model that is made from the block.
        required: the mode does not work without its plugin.
        topics: what it publishes and subscribes to, from the graph of the nodes.
        process_group: nodes of one group share a process; restart: ``on-failure``, ``never`` or ``stop-run``.
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
        """Name of the block that asks for it."""
        return self.path.rpartition(".")[2]

    @property
    def name(self) -> str:
        """Name of its node: unless given, that of its block."""
        return self.node_name or self.block_name

    def needed(self) -> ServiceSpec:
        """The same service in a mode that does not work without it."""
        return replace(self, required=True)


@dataclass(frozen=True, eq=False, repr=False)
class ModeSpec:
    """One operation mode.

    Attributes:
        name: value of ``OperationMode``, such as ``MODE_TEST``, or what ``general.plugin_mode`` calls it.
        check: finds what the mode misses in a file.
        devices: it starts actuators and sensors; models: it starts the nodes of ``ai.models``.
        services: what runs beside them.
        blocks: further blocks of the file that have an effect in it, such as ``test``.
        for_file: what the file's own choices change of this spec.
        duration_s: length after which the run ends by itself; None: it runs until it is stopped or done.
        run: import string of what runs the mode in place of nodes: called with the checked file, the command
            line's options and the emulated devices or None, it returns the exit code; "" for a run of nodes.
        verdict: the run ends with a pass/fail table of what each node measured.
        works_uncalibrated: actuators may move within their position limits without a calibration.
        recalibrates: it makes the robot's calibration anew; the present one is neither loaded nor checked.
        idle: what starts no device, for a note that says so, such as "an upload".
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
