"""The fork server: single-threaded, loads heavy modules, forks children and reaps them."""

from __future__ import annotations

import contextlib
import fcntl
import gc
import importlib
import json
import os
import selectors
import signal
import socket
import sys
import time
import traceback
from typing import Any, NoReturn

from joshua.ipc.frames import EndOfStreamError, FrameSocket
from joshua.ipc.process_attributes import IGNORED_SIGNALS, set_parent_death_signal, set_title
from joshua.supervisor.standby import GUARDIAN_PROGRAM, LAST_DESCRIPTOR, Standby

#: Program of a child.
NODE_PROGRAM = "joshua.node.main"

#: Modules for children. A missing module is reported by the node that imports it.
PRELOADED = (
    NODE_PROGRAM,
    GUARDIAN_PROGRAM,
    "numpy",
    "joshua.messages",
    "zenoh",
    "zenoh.ext",
    "joshua.transport.zenoh.transport",
    "joshua.devices.actuator_node",
    "joshua.devices.sensor_node",
    "joshua.plugins.settings",
)

#: Message types whose codecs are compiled. The frequent types have fast paths.
PRELOADED_TYPES = (
    "rcl_interfaces/msg/Log",
    "rcl_interfaces/msg/ParameterEvent",
    "diagnostic_msgs/msg/DiagnosticArray",
    "std_srvs/srv/Trigger_Response",
)

#: Math libraries start threads when loaded, and a process with threads cannot fork safely.
LOAD_SETTINGS = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
}

#: Time for children to end by themselves when the supervisor is gone.
ORPHAN_GRACE_S = 0.7

#: The control socket of every child.
CONTROL_DESCRIPTOR = 3

#: The socket of a forked child for the orders of its guardians.
STANDBY_DESCRIPTOR = 4

_FIRST_FREE = 32


class Server:
    """Serves requests until the supervisor closes the socket or dies."""

    def __init__(self, sock: socket.socket) -> None:
        self._frames = FrameSocket(sock)
        self._children: set[int] = set()
        self._wake_receiver, self._wake_sender = socket.socketpair()
        self._wake_receiver.setblocking(False)
        self._wake_sender.setblocking(False)
        self._selector = selectors.DefaultSelector()
        self._standby = Standby(self._selector)

    def run(self) -> int:
        """Serves until the end and returns the exit code."""
        signal.signal(signal.SIGCHLD, lambda _number, _frame: None)
        signal.set_wakeup_fd(self._wake_sender.fileno(), warn_on_full_buffer=False)
        self._selector.register(self._frames.fileno(), selectors.EVENT_READ, self._serve_requests)
        self._selector.register(self._wake_receiver.fileno(), selectors.EVENT_READ, self._reap)
        try:
            while True:
                for key, _events in self._selector.select(self._standby.pause_s()):
                    if self._selector.get_map().get(key.fd) is key:  # not closed by one before
                        key.data()
                self._standby.look()
        except EndOfStreamError:
            self._end_children()
        return 0

    def close(self) -> None:
        """Closes the sockets. Idempotent."""
        signal.set_wakeup_fd(-1)
        for item in (self._standby, self._selector, self._frames, self._wake_receiver, self._wake_sender):
            item.close()

    def report(self, **event: Any) -> None:
        """Sends an event to the supervisor."""
        self._frames.send(json.dumps(event).encode())

    def _serve_requests(self) -> None:
        for payload in self._frames.receive():
            request = json.loads(payload)
            descriptors = self._frames.take_descriptors(request["descriptors"])
            self._start_child(request, descriptors)

    def _start_child(self, request: dict[str, Any], descriptors: list[int]) -> None:
        for name in request.get("modules", ()):
            if name not in sys.modules:
                with contextlib.suppress(Exception):  # the node that loads it reports the cause
                    importlib.import_module(name)
        server_id = os.getpid()
        # An executed program can have other plugins than this process, which then cannot stop its devices.
        doubled = self._standby.available and request["operation"] == "fork"
        ours, theirs = socket.socketpair(type=socket.SOCK_SEQPACKET) if doubled else (None, None)
        # A signal for the child stays pending until the child handles it. Ignored here, it would be lost.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
        try:
            process_id = os.fork()
        except OSError as error:
            text = f"the system refuses another process: {error}"
            self.report(event="refused", request=request["request"], text=text)
            if ours is not None:
                ours.close()
        else:
            if process_id == 0:
                self._become_child(request, descriptors, server_id, theirs)
            self._children.add(process_id)
            if ours is not None:
                self._standby.add(process_id, ours)
            self.report(event="started", request=request["request"], process_id=process_id)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
        if theirs is not None:
            theirs.close()
        for descriptor in descriptors:
            os.close(descriptor)

    def _become_child(
        self, request: dict[str, Any], descriptors: list[int], server_id: int, standby: socket.socket | None
    ) -> NoReturn:
        try:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            # The kernel stops it when the server dies. The check covers a server that died before.
            set_parent_death_signal(signal.SIGTERM)
            if os.getppid() != server_id:
                os._exit(1)
            _redirect(descriptors, None if standby is None else standby.detach())
            if request["operation"] == "execute":
                _execute(request["arguments"], request["environment"])
            set_title(request["title"])
            _run_node_process(None if standby is None else STANDBY_DESCRIPTOR)
        except BaseException:  # noqa: BLE001 (the process ends here, whatever it was)
            _show_crash()
        finally:
            os._exit(70)

    def _reap(self) -> None:
        with contextlib.suppress(BlockingIOError):
            self._wake_receiver.recv(4096)
        while True:
            try:
                process_id, status = os.waitpid(-1, os.WNOHANG)
            except ChildProcessError:
                return
            if process_id == 0:
                return
            self._standby.ended(process_id, status)
            if process_id in self._children:
                self._children.discard(process_id)
                self.report(event="exited", process_id=process_id, status=status)

    def _end_children(self) -> None:
        """Waits for children to end with the supervisor, then kills the others. Orders are carried out."""
        deadline_s = time.monotonic() + ORPHAN_GRACE_S
        while self._children or self._standby.busy:
            with contextlib.suppress(EndOfStreamError):
                self._reap()
            if time.monotonic() > deadline_s:
                for process_id in self._children:
                    os.kill(process_id, signal.SIGKILL)
            self._standby.look()
            time.sleep(0.01)


def serve(sock: socket.socket, parent_id: int, *, preload: bool) -> int:
    """Runs the server in this process and returns its exit code."""
    set_title("joshua-fork")
    for number in IGNORED_SIGNALS:
        signal.signal(number, signal.SIG_IGN)  # the supervisor decides what they mean
    signal.pthread_sigmask(signal.SIG_UNBLOCK, IGNORED_SIGNALS)
    # While modules load the socket is not watched, and there are no children yet.
    set_parent_death_signal(signal.SIGKILL)
    if os.getppid() != parent_id:
        return 1
    server = Server(sock)
    missing = load_modules() if preload else []
    set_parent_death_signal(0)
    try:
        server.report(event="preloaded", text=", ".join(missing), threads=_threads())
        return server.run()
    except EndOfStreamError:
        return 0  # the supervisor ended while modules were loading
    finally:
        server.close()


def load_modules() -> list[str]:
    """Imports the modules for children and returns the missing ones."""
    kept = {name: os.environ.get(name) for name in LOAD_SETTINGS}
    os.environ.update(LOAD_SETTINGS)
    gc.disable()
    missing = []
    try:
        for name in PRELOADED:
            try:
                importlib.import_module(name)
            except ImportError:
                missing.append(name)
        if NODE_PROGRAM not in missing:
            sys.modules[NODE_PROGRAM].prepare()
        if "joshua.messages" not in missing:
            sys.modules["joshua.messages"].preload(PRELOADED_TYPES)
    finally:
        gc.enable()
        for name, value in kept.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
    # Children share these objects: a collection in a child would copy every page that it visits.
    gc.freeze()
    return missing


def _threads() -> int:
    try:
        return len(os.listdir("/proc/self/task"))  # noqa: PTH208 (one name for each thread is all it needs)
    except OSError:
        return 1


def _redirect(descriptors: list[int], standby: int | None) -> None:
    """Sets up the child's standard streams and sockets, and closes all other descriptors."""
    # Copies beyond the numbers that are about to be overwritten.
    control, output, error = (fcntl.fcntl(item, fcntl.F_DUPFD, _FIRST_FREE) for item in descriptors)
    if standby is not None:
        standby = fcntl.fcntl(standby, fcntl.F_DUPFD, _FIRST_FREE)
    null = os.open(os.devnull, os.O_RDONLY)
    for source, target in ((null, 0), (output, 1), (error, 2), (control, CONTROL_DESCRIPTOR)):
        os.dup2(source, target, inheritable=True)
    first = CONTROL_DESCRIPTOR + 1
    if standby is not None:
        os.dup2(standby, STANDBY_DESCRIPTOR, inheritable=False)
        first = STANDBY_DESCRIPTOR + 1
    os.closerange(first, LAST_DESCRIPTOR)


def _execute(arguments: list[str], environment: dict[str, str]) -> NoReturn:
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    os.execve(arguments[0], arguments, environment)  # noqa: S606


def _run_node_process(standby: int | None) -> None:
    # By name: this room must not import the node's.
    program = importlib.import_module(NODE_PROGRAM)
    # Line-buffered; the server's own streams may be those of a test runner.
    sys.stdout = open(1, "w", buffering=1, errors="backslashreplace", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", buffering=1, errors="backslashreplace", closefd=False)  # noqa: SIM115
    if "numpy.random" in sys.modules:
        sys.modules["numpy.random"].seed()  # each child draws other numbers
    code = program.EXIT_INTERNAL
    try:
        code = program.run_forked(CONTROL_DESCRIPTOR, standby_descriptor=standby)
    except BaseException:  # noqa: BLE001 (the process ends here, whatever it was)
        _show_crash()
    finally:
        program.finish(code)


def _show_crash() -> None:
    """Writes the traceback to descriptor 2: ``sys.stderr`` may belong to the forked process."""
    with contextlib.suppress(OSError):
        os.write(2, traceback.format_exc().encode("utf-8", "backslashreplace"))


def main() -> None:
    """Runs the server in a fresh interpreter."""
    descriptor, parent_id, preload, *sys.path[:] = sys.argv[1:]
    os.set_inheritable(int(descriptor), False)
    os._exit(serve(socket.socket(fileno=int(descriptor)), int(parent_id), preload=preload == "True"))


if __name__ == "__main__":
    main()
