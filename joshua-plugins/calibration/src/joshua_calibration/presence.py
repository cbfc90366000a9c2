"""A calibration among the running systems: its nodes are taken, and it answers status and stop."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any

from joshua.cli.exit_codes import ExitCode
from joshua.ipc.run_bases import RunDirectoryError, base_directory
from joshua.plan import Plan
from joshua.supervisor.control_server import ControlServer
from joshua.supervisor.reactor import Reactor
from joshua.supervisor.run_directory import NodesInUseError, RunDirectory
from joshua.supervisor.status import NodeStatus, RunStatus

from joshua_calibration.arms import Refused
from joshua_calibration.front_end import ArmState
from joshua_calibration.session import Arm

MODE = "MODE_CALIBRATION"

_STATES = {
    ArmState.WAITING: "ready",
    ArmState.ACTIVE: "ready",
    ArmState.DONE: "stopped",
    ArmState.STOPPED: "stopped",
}


class Presence:
    """What other commands see of this run; a thread of its own answers them, whatever the arms make wait.

    Args:
        stop: called by ``joshua stop``, in that thread.
        stack: gives everything back.
        doing: what is done with every arm; "" for a calibration, which is at another step with each.

    Raises:
        Refused: another run has the nodes, or the folder of running systems cannot be used.
    """

    def __init__(
        self,
        plan: Plan,
        arms: Sequence[Arm],
        stop: Callable[[], None],
        stack: ExitStack,
        *,
        doing: str = "",
    ) -> None:
        self._plan = plan
        self._arms = arms
        self._stop = stop
        self._doing = doing
        self._began_s = time.monotonic()
        names = {arm.node_name for arm in arms}
        self._nodes = {spec.name: spec.full_name for spec in plan.nodes if spec.name in names}
        try:
            directory = RunDirectory.create(
                base_directory(os.environ),
                os.path.abspath(plan.source),  # noqa: PTH100 (links stay as they are)
                plan.transport.domain_id,
                list(self._nodes.values()),
            )
        except (NodesInUseError, RunDirectoryError) as error:
            held = isinstance(error, NodesInUseError)
            raise Refused(str(error), ExitCode.HARDWARE if held else ExitCode.FAILED) from error
        stack.callback(directory.close)
        self._reactor = Reactor()
        stack.callback(self._reactor.close)
        try:
            server = ControlServer(
                self._reactor, directory.socket_path, {"status": self._status, "stop": self._end}
            )
        except OSError as error:
            raise Refused(
                f"{directory.socket_path}: {error}; set XDG_RUNTIME_DIR", ExitCode.FAILED
            ) from error
        stack.callback(server.close)
        self._wake, self._waker = os.pipe()
        stack.callback(os.close, self._wake)
        self._reactor.watch(self._wake, self._leave)
        self._leaving = False
        thread = threading.Thread(target=self._serve, name="presence", daemon=True)
        stack.callback(thread.join)
        stack.callback(os.close, self._waker)
        thread.start()

    def _serve(self) -> None:
        while not self._leaving:
            self._reactor.turn()

    def _leave(self) -> None:
        self._leaving = True

    def _status(self, _: object) -> dict[str, Any]:
        nodes = tuple(
            NodeStatus(
                self._nodes[arm.node_name],
                _STATES[arm.state],
                os.getpid(),
                0,
                reason=self._doing or f"calibration: {arm.state.value}",
            )
            for arm in self._arms
        )
        elapsed_s = time.monotonic() - self._began_s
        status = RunStatus(self._plan.source, MODE, "running", elapsed_s, os.getpid(), nodes)
        return {"status": status.as_dict()}

    def _end(self, _: object) -> dict[str, Any]:
        self._stop()
        return {"stopping": True}
