"""Action server by the conventions of ROS 2: three services and two topics, one goal at a time.

Source: ROS 2 design, "Actions"; rcl_action for names and quality of service.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

from joshua.api.nodes import ExtendedNode
from joshua.api.transports import QosProfile
from joshua.messages import decode, encode, message_class

from joshua_services.action_types import CANCEL

# action_msgs/msg/GoalStatus
UNKNOWN, ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = range(7)
# action_msgs/srv/CancelGoal
_NONE, _REJECTED, _UNKNOWN_GOAL, _TERMINATED = range(4)

_STATUS_QOS = QosProfile(durability="TRANSIENT_LOCAL", depth=1)
#: Number of goals whose results stay available.
_REMEMBERED = 50


@dataclass
class Goal:
    """One accepted goal.

    Attributes:
        identifier: 16 bytes that the client chose; request: the goal's message; stamp_ns: of its acceptance.
        status: value of a GoalStatus; cancel: set when a client or a newer goal ends it.
        answers: clients that wait for the result; result: serialised, once the goal has ended.
    """

    identifier: bytes
    request: Any
    stamp_ns: int
    status: int = ACCEPTED
    replaced: bool = False
    cancel: threading.Event = field(default_factory=threading.Event)
    ended: threading.Event = field(default_factory=threading.Event)
    answers: list[Future[bytes]] = field(default_factory=list)
    result: bytes = b""


class ActionServer:
    """Server of one action of one node.

    Args:
        node: owner of the action; name: below the node's name; action: its type.
        refuse: returns why a goal's message is refused, "" to accept it.
        execute: executes a goal on its own thread. Returns its last status and the result's fields.
    """

    def __init__(
        self,
        node: ExtendedNode,
        name: str,
        action: str,
        refuse: Callable[[Any], str],
        execute: Callable[[Goal], tuple[int, dict[str, Any]]],
    ) -> None:
        self._node, self._action, self._refuse, self._execute = node, action, refuse, execute
        self._lock = threading.RLock()
        self._goals: OrderedDict[bytes, Goal] = OrderedDict()
        base = f"{node.context.spec.full_name}/{name}/_action"
        handle = node.handle
        self._feedback = handle.create_publisher(
            f"{base}/feedback", f"{action}_FeedbackMessage", QosProfile()
        )
        self._status = handle.create_publisher(
            f"{base}/status", "action_msgs/msg/GoalStatusArray", _STATUS_QOS
        )
        handle.create_service(f"{base}/send_goal", f"{action}_SendGoal", self._send_goal)
        handle.create_service(f"{base}/cancel_goal", CANCEL, self._cancel_goal)
        handle.create_service(f"{base}/get_result", f"{action}_GetResult", self._get_result)

    def feedback(self, goal: Goal, values: dict[str, Any]) -> None:
        """Publish feedback of a goal."""
        message = message_class(f"{self._action}_FeedbackMessage")(
            goal_id=_uuid(goal.identifier), feedback=message_class(f"{self._action}_Feedback")(**values)
        )
        self._feedback.publish(encode(message))

    def _send_goal(self, request: bytes) -> bytes:
        message = decode(f"{self._action}_SendGoal_Request", request)
        identifier, now_ns = bytes(message.goal_id.uuid), time.time_ns()
        reason = "its id is known" if identifier in self._goals else self._refuse(message.goal)
        log = self._node.context.log
        if reason:
            log.warning("a goal of %s is refused: %s", self._action.rpartition("/")[2], reason)
        else:
            goal = Goal(identifier, message.goal, now_ns)
            with self._lock:
                before = [one for one in self._goals.values() if not one.ended.is_set()]
                for one in before:
                    one.replaced = True
                    one.cancel.set()
                self._goals[identifier] = goal
                ended = [key for key, one in self._goals.items() if one.ended.is_set()]
                for key in ended[: max(0, len(self._goals) - _REMEMBERED)]:
                    del self._goals[key]
            self._node.context.spawn_thread(
                lambda: self._run(goal, before), name="action goal", hang_after_s=float("inf")
            )
        accepted = message_class(f"{self._action}_SendGoal_Response")(
            accepted=not reason, stamp=_time(now_ns)
        )
        return bytes(encode(accepted))

    def _run(self, goal: Goal, before: list[Goal]) -> None:
        for one in before:
            one.ended.wait()
        self._enter(goal, EXECUTING)
        try:
            status, values = self._execute(goal)
        except Exception:
            self._node.context.log.exception("a goal failed")
            status, values = ABORTED, {}
        response = message_class(f"{self._action}_GetResult_Response")(
            status=status, result=message_class(f"{self._action}_Result")(**values)
        )
        with self._lock:
            goal.result = bytes(encode(response))
            self._enter(goal, status)
            goal.ended.set()
        for answer in goal.answers:
            answer.set_result(goal.result)

    def _cancel_goal(self, request: bytes) -> bytes:
        """Cancel by id, by time or all, as action_msgs/srv/CancelGoal specifies."""
        info = decode(f"{CANCEL}_Request", request).goal_info
        identifier, until_ns = bytes(info.goal_id.uuid), info.stamp.sec * 10**9 + info.stamp.nanosec
        with self._lock:
            everything = not any(identifier) and not until_ns
            chosen = [
                goal
                for goal in self._goals.values()
                if everything or goal.identifier == identifier or goal.stamp_ns <= until_ns
            ]
            running = [goal for goal in chosen if not goal.ended.is_set()]
            for goal in running:
                goal.cancel.set()
                self._enter(goal, CANCELING)
        code = _NONE if running or not any(identifier) else _TERMINATED if chosen else _UNKNOWN_GOAL
        response = message_class(f"{CANCEL}_Response")(
            return_code=code, goals_canceling=[_info(goal) for goal in running]
        )
        return bytes(encode(response))

    def _get_result(self, request: bytes) -> bytes | Future[bytes]:
        message = decode(f"{self._action}_GetResult_Request", request)
        with self._lock:
            goal = self._goals.get(bytes(message.goal_id.uuid))
            if goal is None:
                return bytes(encode(message_class(f"{self._action}_GetResult_Response")(status=UNKNOWN)))
            if goal.ended.is_set():
                return goal.result
            goal.answers.append(Future())
            return goal.answers[-1]

    def _enter(self, goal: Goal, status: int) -> None:
        make = message_class("action_msgs/msg/GoalStatus")
        with self._lock:
            if goal.status == CANCELING and status == EXECUTING:
                return
            goal.status = status
            states = [make(goal_info=_info(one), status=one.status) for one in self._goals.values()]
            message = message_class("action_msgs/msg/GoalStatusArray")(status_list=states)
            self._status.publish(encode(message))


def _uuid(identifier: bytes) -> Any:
    import numpy as np

    return message_class("unique_identifier_msgs/msg/UUID")(uuid=np.frombuffer(identifier, np.uint8))


def _time(stamp_ns: int) -> Any:
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    return message_class("builtin_interfaces/msg/Time")(sec=seconds, nanosec=nanoseconds)


def _info(goal: Goal) -> Any:
    make = message_class("action_msgs/msg/GoalInfo")
    return make(goal_id=_uuid(goal.identifier), stamp=_time(goal.stamp_ns))
