"""Where commands of other terminals find a run: its directory and control socket."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from joshua.ipc.run_bases import RunDirectoryError
from joshua.supervisor.control_server import ControlServer, Handler
from joshua.supervisor.logbook import Logbook
from joshua.supervisor.reactor import Reactor
from joshua.supervisor.run_directory import NodesInUseError, RunDirectory


class RunPlace:
    """Keeps a run reachable: creates its directory and socket again if they are removed.

    Args:
        reactor: the supervisor's loop; logbook: of the run.
        directory: of the run, closed by this object.
        handlers: of the requests on the control socket.
    """

    def __init__(
        self, reactor: Reactor, logbook: Logbook, directory: RunDirectory, handlers: Mapping[str, Handler]
    ) -> None:
        self._reactor = reactor
        self._logbook = logbook
        self._directory = directory
        self._handlers = handlers
        self._server: ControlServer | None = None
        self._lost = False
        self._serve()

    def look(self) -> None:
        """Creates the place again if it is gone. Takes two file checks."""
        try:
            if not self._directory.restore():
                return
        except (NodesInUseError, RunDirectoryError) as error:
            if not self._lost:
                self._lost = True
                text = f"its directory was removed, so joshua estop and stop do not find this run: {error}"
                self._logbook.write(logging.ERROR, text)
            return
        self._lost = False
        self._serve()
        self._logbook.write(
            logging.WARNING, "the directory of this run was removed and has been created again"
        )

    def close(self) -> None:
        """Removes the directory. Idempotent."""
        if self._server is not None:
            self._server.close()
        self._directory.close()

    def _serve(self) -> None:
        if self._server is not None:
            self._server.close()
            self._server = None
        self._directory.point_to_log(self._logbook.path)
        try:
            self._server = ControlServer(self._reactor, self._directory.socket_path, self._handlers)
        except OSError as error:
            text = f"no control socket, so no `joshua status`: {error}"
            self._logbook.write(logging.WARNING, text)
