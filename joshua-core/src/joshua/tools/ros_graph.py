"""The transport with which a program outside a run joins a ROS 2 graph."""

from __future__ import annotations

import os

from joshua.cli.exit_codes import ExitCode
from joshua.plan import TransportSettings


class GraphError(Exception):
    """The program cannot join the graph, or the command cannot continue.

    Attributes:
        code: exit code.
    """

    def __init__(self, message: str, code: ExitCode = ExitCode.FAILED) -> None:
        super().__init__(message)
        self.code = code


def graph_transport(path: str | None, option: str) -> TransportSettings:
    """Return the transport chosen by the command line, a configuration file or the environment.

    Args:
        path: of a configuration whose transport block applies; None for the environment.
        option: name of the requested transport; "" for none.

    Raises:
        GraphError: the environment is invalid, the file cannot be read or the transport is not installed.
    """
    from joshua.plugins import load_registry
    from joshua.schema.transport_pb2 import TransportConfig
    from joshua.transport.choice import TransportChoiceError, choose_transport, why_missing

    try:
        if path:
            settings = _settings_of_file(path, option)
        else:
            settings = choose_transport(TransportConfig(), os.environ, load_registry, option=option)
    except TransportChoiceError as error:
        raise GraphError(str(error), ExitCode.INVALID) from error
    if not settings.implementation:
        raise GraphError(". ".join(why_missing(settings, load_registry())), ExitCode.NOT_INSTALLED)
    return settings


def _settings_of_file(path: str, option: str) -> TransportSettings:
    from joshua.config import load
    from joshua.config.checks import Context
    from joshua.planner.transport_choice import transport_settings
    from joshua.plugins import load_registry

    loaded = load(path)
    settings, found = transport_settings(Context(loaded, launch=True), load_registry(), option)
    problems = [item for item in (*loaded.diagnostics, *found) if item.severity.value == "error"]
    if not loaded.is_readable or settings is None:
        reason = problems[0].message if problems else "it cannot be read"
        raise GraphError(f"{path}: {reason} Run: joshua --config {path} --validate-only", ExitCode.INVALID)
    return settings
