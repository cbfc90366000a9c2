"""Reserve nodes of a robot for a program that does not start them, such as a calibration."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from joshua.cli.exit_codes import ExitCode
from joshua.cli.report import NotStartedError
from joshua.ipc.run_bases import RunDirectoryError, base_directory
from joshua.plan.events import NodeStatus, RunStatus
from joshua.supervisor.control_server import ControlServer
from joshua.supervisor.reactor import Reactor
from joshua.supervisor.run_directory import NodesInUseError, RunDirectory

if TYPE_CHECKING:
    from joshua.plan import Plan


@contextmanager
def foreground_job(
    plan: Plan,
    mode: str,
    nodes: Collection[str],
    report: Callable[[str], tuple[str, str]],
    stop: Callable[[], None],
) -> Iterator[None]:
    """Reserve nodes of a plan for this program, as a run does, and answer ``joshua status`` and ``stop``.

    Args:
        plan: of the file; mode: shown by status; nodes: names of the nodes to reserve.
        report: returns the state of a node by name, such as ``ready``, and the current activity.
        stop: called by ``joshua stop``, in the thread that answers.

    Raises:
        NotStartedError: another run uses a node, or the folder of running systems cannot be used.
    """
    held = {spec.name: spec.full_name for spec in plan.nodes if spec.name in nodes}
    began_s = time.monotonic()
    ended = threading.Event()

    def status(*_: object) -> dict[str, Any]:
        rows = []
        for name, full_name in held.items():
            state, doing = report(name)
            rows.append(NodeStatus(full_name, state, os.getpid(), 0, reason=doing))
        elapsed_s = time.monotonic() - began_s
        return {
            "status": RunStatus(plan.source, mode, "running", elapsed_s, os.getpid(), tuple(rows)).as_dict()
        }

    def end(*_: object) -> dict[str, Any]:
        stop()
        return {"stopping": True}

    def refuse(*_: object) -> dict[str, Any]:
        text = f"{mode} starts no nodes: only `joshua status` and `joshua stop` reach it"
        return {"error": text, "code": "refused"}

    def serve() -> None:
        while not ended.is_set():
            reactor.turn()

    handlers = {"status": status, "stop": end, "call": refuse, "subscribe": refuse}
    source = os.path.abspath(plan.source)  # noqa: PTH100 (links stay as they are)
    with ExitStack() as stack:
        try:
            base = base_directory(os.environ)
            directory = RunDirectory.create(base, source, plan.transport.domain_id, list(held.values()))
        except NodesInUseError as error:
            raise NotStartedError(str(error), ExitCode.HARDWARE) from error
        except RunDirectoryError as error:
            raise NotStartedError(str(error), ExitCode.FAILED) from error
        stack.callback(directory.close)
        reactor = Reactor()
        stack.callback(reactor.close)
        path = directory.socket_path
        try:
            stack.callback(ControlServer(reactor, path, handlers).close)
        except OSError as error:
            raise NotStartedError(f"{path}: {error}. Set XDG_RUNTIME_DIR", ExitCode.FAILED) from error
        thread = threading.Thread(target=serve, name="presence", daemon=True)
        stack.callback(thread.join)
        stack.callback(reactor.post, ended.set)
        thread.start()
        yield
