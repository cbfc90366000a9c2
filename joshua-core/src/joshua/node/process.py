"""A child process: one or several nodes, one transport, one control channel."""

from __future__ import annotations

import gc
import logging
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

from joshua.guardian.latch import latch_of
from joshua.guardian.silence import AwakeClock
from joshua.ipc.frames import FrameError
from joshua.ipc.messages import (
    Activate,
    Call,
    CallReply,
    Estop,
    Heartbeat,
    Hello,
    Log,
    Message,
    Progressed,
    Start,
    Stop,
    ToChild,
    Topics,
)
from joshua.ipc.process_attributes import set_title
from joshua.node.control import ControlChannel
from joshua.node.errors import InterruptedLifecycleError
from joshua.node.logs import NodeLogHandler, install_handler
from joshua.node.runtime import NodeRuntime, RuntimeServices
from joshua.transport import Transport, open_transport

#: Time between a stop on a signal and the interruption of a node that has not reacted.
INTERRUPT_AFTER_S = 0.3

#: The same after an urgent stop request.
URGENT_INTERRUPT_AFTER_S = 0.05

#: These times are counted in such steps, because a node in a stalled process cannot react.
PATIENCE_STEP_S = 0.02

#: The interpreter's default of 5 ms lets one busy thread delay the ticks of another by that much.
SWITCH_INTERVAL_S = 0.0005

#: Time limit for sending the last messages.
DRAIN_S = 1.0

#: Messages that may be dropped if the supervisor does not read.
CAN_MISS = (Heartbeat, Log, Progressed, Topics)


class NodeProcess:
    """Runs the nodes that the supervisor names. Ends with them, with the supervisor, or on its request.

    Args:
        control_descriptor: socket of the supervisor; version: of the core in another environment.
    """

    def __init__(self, control_descriptor: int, version: str = "") -> None:
        self._version = version
        self._channel = ControlChannel(
            control_descriptor, self._on_message, self._on_orphaned, self._on_signals
        )
        self._starts: queue.SimpleQueue[Start | None] = queue.SimpleQueue()
        self._runtimes: list[NodeRuntime] = []
        self._activation = threading.Event()
        self._transport: Transport | None = None
        self._transport_lock = threading.Lock()  # opening it takes long
        self._stop_requested_s: float | None = None
        self._stop_lock = threading.Lock()
        self._in_interruptible = False
        self._orphan_grace_s = 0.6
        self._start: Start | None = None
        self._estop: Estop | None = None

    def run(self) -> int:
        """Runs until the nodes have ended. Returns the exit code of the process."""
        self._handle_signals()
        self._channel.start()
        self._send(Hello(version=self._version, process_id=os.getpid(), python=sys.version.split()[0]))
        start = self._starts.get()
        if start is None:
            return 0
        self._start = start
        set_title(start.nodes[0].process_group or start.nodes[0].name)
        handler = NodeLogHandler(self._send, start.nodes[0].full_name)
        install_handler(handler, start.log_level)
        services = RuntimeServices(
            send=self._send,
            transport=self._open_transport,
            activation=self._activation,
            logs=handler,
            log_level=start.log_level,
            heartbeat_s=start.heartbeat_s,
        )
        self._run_nodes(start, services)
        for spec in start.nodes:
            handler.settle(spec.full_name, ended=True)
        self._close_transport()
        self._channel.drain(DRAIN_S)
        return max(runtime.exit_code for runtime in self._runtimes)

    def _on_message(self, message: ToChild) -> None:
        """Obeys the supervisor (control thread)."""
        if isinstance(message, Start):
            self._orphan_grace_s = message.orphan_grace_s
            self._starts.put(message)
        elif isinstance(message, Activate):
            sys.setswitchinterval(SWITCH_INTERVAL_S)
            # excludes the loaded modules from garbage collection
            gc.freeze()
            self._activation.set()
            for runtime in self._runtimes:
                runtime.wake()
        elif isinstance(message, Call):
            self._take_call(message)
        elif isinstance(message, Estop):
            self._estop = message
            for runtime in self._runtimes:
                self._pass_on(message, runtime)
        elif isinstance(message, Stop):
            self._request_stop()
            if message.urgent:
                self._later(URGENT_INTERRUPT_AFTER_S, self._interrupt)

    def _on_orphaned(self) -> None:
        """Ends cleanly within a bounded time after the supervisor has gone (control thread)."""
        self._request_stop()
        self._later(self._orphan_grace_s / 2, self._interrupt)
        self._later(self._orphan_grace_s, lambda: os._exit(1))

    def _on_signals(self, numbers: bytes) -> None:
        """Stops on SIGTERM, and interrupts nodes that still run after a stop request (control thread)."""
        if signal.SIGTERM not in numbers:
            return
        requested_s = self._stop_requested_s
        if requested_s is not None and time.monotonic() - requested_s > INTERRUPT_AFTER_S:
            self._interrupt()
            return
        self._request_stop()
        self._later(INTERRUPT_AFTER_S, self._interrupt)

    def _run_nodes(self, start: Start, services: RuntimeServices) -> None:
        specs = start.nodes
        # The first node runs on the main thread, which signals can interrupt and some libraries require.
        self._runtimes = [NodeRuntime(specs[0], services, self._interruptible)]
        self._runtimes += [NodeRuntime(spec, services, nullcontext) for spec in specs[1:]]
        if self._estop is not None:  # it came before there were nodes
            for runtime in self._runtimes:
                self._pass_on(self._estop, runtime)
        if self._stop_requested_s is not None:
            self._request_stop()
        threads = [
            threading.Thread(target=self._run_beside, args=(runtime,), name=spec.name, daemon=True)
            for runtime, spec in zip(self._runtimes[1:], specs[1:], strict=True)
        ]
        for thread in threads:
            thread.start()
        self._run_beside(self._runtimes[0])
        for thread in threads:
            thread.join()

    def _run_beside(self, runtime: NodeRuntime) -> None:
        """Runs one node. When it ends, the others of the process end too."""
        runtime.run()
        self._request_stop()

    def _request_stop(self) -> None:
        with self._stop_lock:
            if self._stop_requested_s is None:
                self._stop_requested_s = time.monotonic()
        self._starts.put(None)
        for runtime in self._runtimes:
            runtime.request_stop()

    def _pass_on(self, message: Estop, runtime: NodeRuntime) -> None:
        latch = None if message.latch is None else latch_of(message.latch)
        runtime.context.take_estop(latch, stored=message.stored)

    def _take_call(self, call: Call) -> None:
        for runtime in self._runtimes:
            if runtime.full_name == call.node and runtime.take_call(call):
                return
        text = f"{call.node} is still starting: try again"
        self._send(CallReply(id=call.id, node=call.node, ok=False, code="not-running", text=text))

    def _interrupt(self) -> None:
        if self._runtimes and self._runtimes[0].running:
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGUSR1)

    def _later(self, delay_s: float, action: Callable[[], None]) -> None:
        """Calls a function after a time, excluding pauses of this whole process."""

        def wait_and_act() -> None:
            clock = AwakeClock(longest_look_s=2 * PATIENCE_STEP_S)
            while (left_s := delay_s - clock.now_s()) > 0:
                time.sleep(min(left_s, PATIENCE_STEP_S))
            action()

        threading.Thread(target=wait_and_act, name="patience", daemon=True).start()

    @contextmanager
    def _interruptible(self) -> Iterator[None]:
        self._in_interruptible = True
        try:
            yield
        finally:
            self._in_interruptible = False

    def _handle_signals(self) -> None:
        def interrupt(_number: int, _frame: object) -> None:
            if self._in_interruptible:
                self._in_interruptible = False  # once is enough, because the node shuts down
                raise InterruptedLifecycleError

        # Ctrl-C reaches the whole foreground group, but only the supervisor handles it.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        signal.signal(signal.SIGUSR1, interrupt)
        # The handler does nothing: the byte in the wake-up socket reaches the control thread even while the
        # main thread is busy outside Python.
        signal.signal(signal.SIGTERM, lambda _number, _frame: None)
        signal.set_wakeup_fd(self._channel.wake_descriptor, warn_on_full_buffer=False)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})  # the fork server blocks it

    def _send(self, message: Message) -> None:
        self._channel.send(message, can_miss=isinstance(message, CAN_MISS))

    def _open_transport(self) -> Transport:
        if self._start is None:
            raise FrameError("no start message received")
        with self._transport_lock:
            if self._transport is None:
                self._transport = open_transport(self._start.transport)
            return self._transport

    def _close_transport(self) -> None:
        if self._transport is None:
            return
        try:
            self._transport.close()
        except Exception:
            logging.getLogger("joshua.node").exception("the transport cannot be closed")
