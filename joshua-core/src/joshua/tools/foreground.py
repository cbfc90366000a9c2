"""A program that holds nodes of a robot without starting them, such as a calibration."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Collection
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from joshua.cli.exit_codes import ExitCode
from joshua.ipc.run_bases import RunDirectoryError, base_directory
from joshua.plan.events import NodeStatus, RunStatus
from joshua.supervisor.control_server import ControlServer
from joshua.supervisor.reactor import Reactor
from joshua.supervisor.run_directory import NodesInUseError, RunDirectory

if TYPE_CHECKING:
    from typing_extensions import Self

    from joshua.plan import Plan


class JobRefusedError(Exception):
    """The nodes cannot be taken; the message says why and what to do.

    Attributes:
        code: exit code of a command that ends with it.
    """

    def __init__(self, message: str, code: ExitCode) -> None:
        super().__init__(message)
        self.code = code


class ForegroundJob:
    """Takes nodes of a plan for this program, as a run does, and answers ``joshua status`` and ``stop``.

    A context manager; a thread of its own answers, whatever the program waits for.

    Args:
        plan: of the file; mode: what status shows as its mode.
        nodes: names of the nodes to take.
        report: the state of a node by its name, such as ``ready``, and what is being done with it.
        stop: called by ``joshua stop``, in that thread.

    Raises:
        JobRefusedError: on entering: another run has a node, or the folder of running systems cannot be used.
    """

    def __init__(
        self,
        plan: Plan,
        mode: str,
        nodes: Collection[str],
        report: Callable[[str], tuple[str, str]],
        stop: Callable[[], None],
    ) -> None:
        self._plan = plan
        self._mode = mode
        self._nodes = {spec.name: spec.full_name for spec in plan.nodes if spec.name in nodes}
        self._report = report
        self._stop = stop
        self._began_s = time.monotonic()
        self._leaving = False
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            try:
                self._start(stack)
            except NodesInUseError as error:
                raise JobRefusedError(str(error), ExitCode.HARDWARE) from error
            except RunDirectoryError as error:
                raise JobRefusedError(str(error), ExitCode.FAILED) from error
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _start(self, stack: ExitStack) -> None:
        plan = self._plan
        source = os.path.abspath(plan.source)  # noqa: PTH100 (links stay as they are)
        base = base_directory(os.environ)
        directory = RunDirectory.create(base, source, plan.transport.domain_id, list(self._nodes.values()))
        stack.callback(directory.close)
        self._reactor = Reactor()
        stack.callback(self._reactor.close)
        path = directory.socket_path
        handlers = {
            "status": self._status,
            "stop": self._end,
            "call": self._refuse,
            "subscribe": self._refuse,
        }
        try:
            server = ControlServer(self._reactor, path, handlers)
        except OSError as error:
            raise JobRefusedError(f"{path}: {error}; set XDG_RUNTIME_DIR", ExitCode.FAILED) from error
        stack.callback(server.close)
        thread = threading.Thread(target=self._serve, name="presence", daemon=True)
        stack.callback(thread.join)
        stack.callback(self._reactor.post, self._leave)
        thread.start()

    def _serve(self) -> None:
        while not self._leaving:
            self._reactor.turn()

    def _leave(self) -> None:
        self._leaving = True

    def _status(self, *_: object) -> dict[str, Any]:
        nodes = []
        for name, full_name in self._nodes.items():
            state, doing = self._report(name)
            nodes.append(NodeStatus(full_name, state, os.getpid(), 0, reason=doing))
        elapsed_s = time.monotonic() - self._began_s
        status = RunStatus(self._plan.source, self._mode, "running", elapsed_s, os.getpid(), tuple(nodes))
        return {"status": status.as_dict()}

    def _end(self, *_: object) -> dict[str, Any]:
        self._stop()
        return {"stopping": True}

    def _refuse(self, *_: object) -> dict[str, Any]:
        text = f"{self._mode} starts no nodes: only `joshua status` and `joshua stop` reach it"
        return {"error": text, "code": "refused"}
