"""One node inside a child process: its lifecycle and its loop. Written stop-first."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any, Literal

from joshua.ipc.messages import Call, CallReply, Failure, Heartbeat, Message, Report, Said, Step
from joshua.ipc.process_attributes import lock_memory, prefer_this_process, set_timer_slack
from joshua.node import ros_time
from joshua.node.behaviour import NodeBehaviour
from joshua.node.calls import Calls
from joshua.node.context import NodeContext, NodeFailedError
from joshua.node.endpoints import Endpoints
from joshua.node.errors import (
    Cancelled,
    InterruptedLifecycleError,
    NodeError,
    exit_code_of,
    is_permanent,
)
from joshua.node.extensions import ExtendedNode, extend
from joshua.node.implementation import load_behaviour
from joshua.node.logs import NodeLogHandler, RosoutPublisher, node_logger
from joshua.node.verbs import Caller, verbs_of
from joshua.plan import ActuatorFacts, CheckResult, JointTrace, ModelFacts, NodeReport, NodeSpec, installing
from joshua.plan.foreign_text import printable
from joshua.transport import Transport

#: Interval of messages with running totals.
TOTALS_PERIOD_S = 0.5

#: Time limit for reader threads to notice the stop.
READER_JOIN_S = 1.0

#: Time limit of a verb called by a ROS 2 service.
SERVICE_TIMEOUT_S = 5.0

#: The default of 50 µs would delay every tick.
TIMER_SLACK_NS = 1000

StepName = Literal["import", "transport", "configure", "activate", "active", "deactivate", "cleanup"]


@dataclass(frozen=True)
class RuntimeServices:
    """Services of the process for each of its nodes.

    Attributes:
        send: sends messages to the supervisor. Heartbeats and totals may be dropped.
        transport: opens or returns the connection of this process to the graph.
        activation: set when the supervisor lets the nodes start.
        logs: handles the log records of the process; log_level: lowest level.
        heartbeat_s: time between two heartbeats.
    """

    send: Callable[[Message], None]
    transport: Callable[[], Transport]
    activation: threading.Event
    logs: NodeLogHandler
    log_level: int
    heartbeat_s: float


class NodeRuntime:
    """Runs one node from its import to its last report.

    Args:
        spec: the node's part of the plan.
        services: those of the process.
        interruptible: entered around everything that a second stop signal may interrupt.
    """

    def __init__(
        self,
        spec: NodeSpec,
        services: RuntimeServices,
        interruptible: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self._spec = spec
        self._services = services
        self._interruptible = interruptible
        self._wake = threading.Event()
        self._log = node_logger(spec.full_name, services.log_level)
        self._behaviour: NodeBehaviour | None = None
        self._step: StepName = "import"
        self._rosout: RosoutPublisher | None = None
        self._exit_code = 0
        self._serves_calls = False
        self.context = NodeContext(
            spec, self._log, services.send, lambda: services.logs.adopt_thread(spec.full_name), self._wake.set
        )
        self._calls = Calls(self.context, services.send, self._wake.set, lambda error: _describe(error, spec))

    @property
    def exit_code(self) -> int:
        """0 after a clean end, else the code of the failure."""
        return self._exit_code

    @property
    def running(self) -> bool:
        """Whether the node has not been asked to stop, or has not reacted yet."""
        return self._step not in ("deactivate", "cleanup")

    def request_stop(self) -> None:
        """Asks the node to stop cleanly. Any thread."""
        self.context.request_stop()

    @property
    def full_name(self) -> str:
        """Of the node."""
        return self._spec.full_name

    def take_call(self, call: Call) -> bool:
        """Receives a call from outside. Returns whether it will be answered. Any thread."""
        if self._behaviour is None:
            return False
        active = self._serves_calls and not self.context.stop_requested
        self._calls.take(call, self._behaviour.verb_providers(), active=active)
        return True

    def _ask(self, verb: str, payload: dict[str, Any]) -> CallReply:
        """Call a verb for a ROS 2 node elsewhere."""
        assert self._behaviour is not None
        providers, caller = self._behaviour.verb_providers(), Caller("network")
        active = self._serves_calls and not self.context.stop_requested
        return self._calls.ask(verb, payload, SERVICE_TIMEOUT_S, providers, active=active, caller=caller)

    def wake(self) -> None:
        """Wakes the node's loop, after the activation was set."""
        self._wake.set()

    def run(self) -> None:
        """Runs the node until it has ended. Never raises exceptions of the behaviour."""
        self._services.logs.adopt_thread(self._spec.full_name)
        try:
            with self._interruptible():
                self._start_and_loop()
        except Cancelled:
            self._log.debug("ended step %s, as it was asked to stop", self._step)
        except BaseException as error:  # noqa: BLE001 (even sys.exit must not skip the safe state)
            self.context.fail_with(error)
        self._report_failure()
        self._shut_down()
        self._services.send(Step(node=self._spec.full_name, step="finished"))

    def _start_and_loop(self) -> None:
        self._enter("import")
        behaviour_type = load_behaviour(self._spec)
        if self.context.stop_requested:
            return
        self._enter("transport")
        handle = self._services.transport().create_node(self._spec.name, self._spec.namespace)
        self.context.endpoints = Endpoints(
            handle, self._spec, self._services.send, self.context.fail_with, self._log
        )
        if self._spec.facts.use_sim_time:
            ros_time.follow_simulation()
            if self._spec.process_group != "simulation":  # that process sets the time itself
                self.context.endpoints.subscribe(ros_time.CLOCK, ros_time.take)
        self._rosout = RosoutPublisher(handle, self._spec)
        self._services.logs.observe(self._spec.full_name, self._rosout.publish)
        self._behaviour = behaviour_type(self.context)
        self._enter("configure")
        self._behaviour.configure()
        self._services.send(Step(node=self._spec.full_name, step="configured"))
        # Before the activation, so that no plugin code runs between torque on and the loop that watches it.
        if self._services.transport().carries_services:
            verbs = tuple(verbs_of(self._behaviour.verb_providers()).values())
            extend(ExtendedNode(self.context, handle, verbs, self._ask, self._rosout.parameter_events))
        if not self._activation_came():
            return
        self._enter("activate")
        self._behaviour.activate()
        self._serves_calls = True  # from the moment when the supervisor may forward one
        set_timer_slack(TIMER_SLACK_NS)
        is_model = isinstance(
            self._spec.facts, ModelFacts
        )  # its weights are too large to be locked in memory
        if self._controls_a_device() or is_model:
            locked = not is_model and lock_memory()
            text = f"{prefer_this_process() or 'normal'}, {'memory locked' if locked else ''}"
            self._services.send(Said(kind="priority", node=self._spec.full_name, text=text.rstrip(", ")))
        self._enter("active")
        self._loop()

    def _controls_a_device(self) -> bool:
        """Whether this process is the driver of an actuator, not a simulation with joints."""
        facts = self._spec.facts
        return isinstance(facts, ActuatorFacts) and facts.simulation is None

    def _enter(self, step: StepName) -> None:
        self._step = step
        self._services.send(Step(node=self._spec.full_name, step=step))

    def _activation_came(self) -> bool:
        """Waits for the activation. False if the node must stop."""
        while not (self._services.activation.is_set() or self.context.stop_requested):
            self._wake.wait(0.5)
            self._wake.clear()
        return not self.context.stop_requested

    def _loop(self) -> None:
        """Runs timers until the stop: the hot loop of a node."""
        context, timers, calls = self.context, self.context.timer_queue, self._calls
        heartbeat_ns = round(self._services.heartbeat_s * 1e9)
        totals_ns = round(TOTALS_PERIOD_S * 1e9)
        next_heartbeat_ns = next_totals_ns = time.monotonic_ns()
        timers.start()
        while not context.stop_requested:
            wait_ns = timers.run_due()
            if context.estop_came:
                context.estop_came = False
                self._look_for_estop()
            if calls.waiting:
                self._serve_call()
            now_ns = time.monotonic_ns()
            if now_ns >= next_heartbeat_ns:
                next_heartbeat_ns = now_ns + heartbeat_ns
                self._beat(now_ns)
            if now_ns >= next_totals_ns:
                next_totals_ns = now_ns + totals_ns
                self._send_totals()
            rest_ns = next_heartbeat_ns - now_ns
            wait_ns = rest_ns if wait_ns is None else min(wait_ns, rest_ns)
            if wait_ns > 0 and self._wake.wait(wait_ns / 1e9):
                self._wake.clear()

    def _look_for_estop(self) -> None:
        if self._behaviour is not None:
            self._behaviour.estop()

    def _serve_call(self) -> None:
        """Executes the next call. One that runs as ``activation`` counts as an activation."""
        job = self._calls.next()
        if job is None:
            return
        as_activation = job.verb.runs == "activation"
        if as_activation:
            self._enter("activate")
        reply, error = self._calls.serve(job)
        if as_activation and error is None:
            self._enter("active")
        self._calls.send(reply)
        if error is not None:
            raise error

    def _beat(self, now_ns: int) -> None:
        ages = self.context.reader_ages()
        beat = Heartbeat(
            node=self._spec.full_name, stamp_ns=now_ns, thread_id=threading.get_native_id(), threads=ages
        )
        self._services.send(beat)

    def _send_totals(self) -> None:
        if self.context.endpoints is not None:
            self._services.send(self.context.endpoints.totals())
        self._services.logs.settle(self._spec.full_name)

    def _report_failure(self) -> None:
        error = self.context.failure
        if error is None:
            return
        self._exit_code = exit_code_of(error)
        failure = Failure(
            node=self._spec.full_name,
            step=self._step,
            exit_code=self._exit_code,
            text=_describe(error, self._spec),
            traceback=_traceback(error),
            unexpected=not _explains_itself(error),
            is_permanent=is_permanent(error),
        )
        self._services.send(failure)

    def _shut_down(self) -> None:
        """Brings the device into its safe state, then releases all resources, each independently."""
        self.context.request_stop()
        behaviour = self._behaviour
        checks: tuple[CheckResult, ...] = ()
        traces: tuple[JointTrace, ...] = ()
        if behaviour is not None:
            self._enter("deactivate")
            self._attempt("deactivate", behaviour.deactivate)
            left = self.context.join_readers(READER_JOIN_S)
            if left:
                self._log.warning("threads still running after the stop request: %s", ", ".join(left))
            if self.context.endpoints is not None:
                self._attempt("ending the subscriptions", self.context.endpoints.close_subscriptions)
            checks, traces = self._test_results(behaviour)
            self._enter("cleanup")
            self._attempt("cleanup", behaviour.cleanup)
        report = self._report(checks).model_copy(update={"traces": traces})
        self._services.logs.observe(self._spec.full_name, None)
        if self.context.endpoints is not None:
            self._attempt("leaving the graph", self.context.endpoints.close)
        self._services.send(Report(report=report))

    def _attempt(self, what: str, action: Callable[[], None]) -> None:
        try:
            action()
        except Exception as error:  # noqa: BLE001 (the remaining parts must run)
            if isinstance(error, NodeError):  # its message names the remedy
                is_new = str(error) != str(self.context.failure)
                (self._log.error if is_new else self._log.debug)("%s failed: %s", what, error)
            else:
                self._log.exception("%s failed", what)
            if self.context.failure is None:
                self.context.failure = error
                self._report_failure()

    def _test_results(
        self, behaviour: NodeBehaviour
    ) -> tuple[tuple[CheckResult, ...], tuple[JointTrace, ...]]:
        try:
            results = tuple(
                CheckResult(check=check, passed=bool(passed), measured=str(measured))
                for check, passed, measured in behaviour.test_results()
            )
            return results, tuple(behaviour.test_traces())
        except Exception as error:  # noqa: BLE001 (the remaining parts must run)
            self._log.exception("the test results are not available")
            failed = CheckResult(check="test results", passed=False, measured=_describe(error, self._spec))
            return (failed,), ()

    def _report(self, checks: tuple[CheckResult, ...]) -> NodeReport:
        endpoints, failure = self.context.endpoints, self.context.failure
        return NodeReport(
            full_name=self._spec.full_name,
            state="stopped" if failure is None else "failed",
            reason="" if failure is None else _describe(failure, self._spec),
            topics=endpoints.reports() if endpoints is not None else (),
            timers=tuple(timer.cadence.report() for timer in self.context.timer_queue.timers),
            checks=checks,
            warnings=tuple(self.context.warnings),
        )


def _explains_itself(error: BaseException) -> bool:
    """Whether the message of a failure was written for users."""
    return isinstance(error, (NodeFailedError, InterruptedLifecycleError)) or hasattr(error, "exit_code")


def _describe(error: BaseException, spec: NodeSpec) -> str:
    """The failure in one line."""
    if isinstance(error, InterruptedLifecycleError):
        return "it did not notice the stop request and was interrupted"
    if isinstance(error, ModuleNotFoundError):
        return f"it needs the module {error.name}, which is not installed: {installing.install(spec.plugin)}"
    text = str(error) if _explains_itself(error) else f"{type(error).__name__}: {error}"
    return printable(text, 2000)


def _traceback(error: BaseException) -> str:
    if isinstance(error, NodeFailedError):
        return ""
    return printable("".join(traceback.format_exception(type(error), error, error.__traceback__)), 8000)
