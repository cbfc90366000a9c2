"""Calls to a node: checked on the control thread, executed on the thread that the verb declares."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import count
from queue import Empty, Queue
from typing import Any

from joshua.ipc.frames import FrameError
from joshua.ipc.messages import (
    LIST_VERBS,
    Call,
    CallReply,
    Message,
    decode_for_supervisor,
    encode,
)
from joshua.node.context import NodeContext
from joshua.node.verbs import LOCAL, Caller, InvalidRequestError, RefusedError, Verb, allowed, verbs_of
from joshua.plan.foreign_text import printable

#: Largest reply. Publish larger data on a topic.
REPLY_LIMIT_BYTES = 1024 * 1024


@dataclass(frozen=True)
class Job:
    """A valid call that waits for its execution."""

    call: Call
    verb: Verb
    serve: Callable[[], dict[str, Any]]

    @property
    def over(self) -> bool:
        """Whether it has expired: it must not be executed late."""
        return time.monotonic_ns() > self.call.deadline_ns


class Calls:
    """The calls of one node.

    Args:
        context: of the node; send: takes messages for the supervisor.
        wake: wakes the node's loop; describe: describes a failure in one line.
    """

    def __init__(
        self,
        context: NodeContext,
        send: Callable[[Message], None],
        wake: Callable[[], None],
        describe: Callable[[BaseException], str],
    ) -> None:
        self.waiting: deque[Job] = deque()
        self._context = context
        self._name = context.spec.full_name
        self._send = send
        self._wake = wake
        self._describe = describe
        self._beside = ""
        self._asked: dict[int, Queue[CallReply]] = {}
        self._numbers = count(-1, -1)  # those of the supervisor count upwards

    def ask(
        self,
        verb: str,
        payload: dict[str, Any],
        timeout_s: float,
        providers: Sequence[object],
        *,
        active: bool,
        caller: Caller,
    ) -> CallReply:
        """Call a verb for a caller outside the run and wait for the answer, on any thread except the loop.

        Args:
            verb, payload: the call; timeout_s: for the reply.
            providers, active, caller: as for ``take``.
        """
        end_ns = time.monotonic_ns() + round(timeout_s * 1e9)
        number = next(self._numbers)
        call = Call(id=number, node=self._name, verb=verb, payload=payload, deadline_ns=end_ns)
        answer: Queue[CallReply] = Queue()
        self._asked[call.id] = answer
        try:
            self.take(call, providers, active=active, caller=caller)
            return answer.get(timeout=timeout_s)
        except Empty:
            text = f"{self._name} did not answer {verb} within {timeout_s:g} s"
            return self._reply(call, ok=False, code="timeout", text=text)
        finally:
            del self._asked[call.id]

    def send(self, reply: CallReply) -> None:
        """Pass an answer to the caller."""
        answer = self._asked.get(reply.id)
        if answer is not None:
            answer.put(reply)
        elif reply.id >= 0:
            self._send(reply)

    def take(self, call: Call, providers: Sequence[object], *, active: bool, caller: Caller = LOCAL) -> None:
        """Answers a call, or queues it for the thread of its verb. Control thread.

        Args:
            providers: objects whose methods are the node's verbs.
            active: whether the node's loop runs; caller: origin of the call.
        """
        try:
            verbs = verbs_of(providers)
            if call.verb == LIST_VERBS:
                infos = [item.info().model_dump() for item in verbs.values()]
                self.send(self._reply(call, payload={"verbs": infos}))
                return
            verb = verbs.get(call.verb)
            if verb is None:
                near = get_close_matches(call.verb, verbs, n=3, cutoff=0.5)
                names = tuple(dict.fromkeys([*near, *verbs]))
                self._refuse(call, "unknown-verb", f"{self._name} has no verb {call.verb!r}", names)
            elif not active:
                self._refuse(call, "not-running", f"{self._name} is starting or stopping: try again")
            elif why := allowed(verb, caller):
                self._refuse(call, "not-allowed", f"{self._name}: {why}")
            else:
                self._place(Job(call, verb, verb.bind(call.payload)))
        except InvalidRequestError as error:
            self._refuse(call, "invalid", f"{self._name}: {error}")
        except Exception as error:
            self._context.log.error("%s: %s", call.verb, error, exc_info=True)
            self._refuse(call, "failed", f"{self._name} failed: {type(error).__name__}: {error}")

    def next(self) -> Job | None:
        """The next call for the node's loop; None if all have expired."""
        while self.waiting:
            job = self.waiting.popleft()
            if not job.over:
                return job
        return None

    def serve(self, job: Job) -> tuple[CallReply, BaseException | None]:
        """Executes a call. Returns the answer, and the error that must fail the node, or None."""
        call, moves = job.call, job.verb.moves
        try:
            reply = self._reply(call, payload=job.serve(), moves=moves)
        except RefusedError as error:
            return self._refusal(call, "refused", str(error), moves=moves), None
        except Exception as error:
            text = f"{self._name} failed: {self._describe(error)}"
            if not moves:
                self._context.log.error("%s: %s", call.verb, text, exc_info=True)
            # after a failed verb that moves, the state of the device is unknown: it stops
            return self._refusal(call, "failed", text, moves=moves), error if moves else None
        problem = _unfit(reply)
        return (self._refusal(call, "failed", f"{self._name}: {problem}") if problem else reply), None

    def _place(self, job: Job) -> None:
        if job.verb.runs != "beside":
            self.waiting.append(job)
            self._wake()
        elif self._beside:
            text = f"{self._name} is not done with {self._beside} yet: try again"
            self._refuse(job.call, "refused", text)
        else:
            self._beside = job.call.verb
            # No time limit: the caller has a timeout, and the loop is watched as usual.
            self._context.spawn_thread(
                lambda: self._serve_beside(job), name=job.call.verb, hang_after_s=math.inf
            )

    def _serve_beside(self, job: Job) -> None:
        try:
            reply, error = self.serve(job)
        finally:
            self._beside = ""
        self.send(reply)
        if error is not None:
            self._context.fail_with(error)

    def _reply(self, call: Call, **fields: Any) -> CallReply:
        return CallReply(id=call.id, node=self._name, **{"ok": True, **fields})

    def _refusal(
        self, call: Call, code: str, text: str, names: tuple[str, ...] = (), *, moves: bool = False
    ) -> CallReply:
        text = printable(text, 2000)
        return self._reply(call, ok=False, code=code, text=text, allowed=names, moves=moves)

    def _refuse(self, call: Call, code: str, text: str, names: tuple[str, ...] = ()) -> None:
        self.send(self._refusal(call, code, text, names))


def _unfit(reply: CallReply) -> str:
    """Why the supervisor could not read a reply, which would end this process; "" if it can."""
    data = encode(reply)
    if len(data) > REPLY_LIMIT_BYTES:
        return f"its reply has {len(data)} bytes; at most {REPLY_LIMIT_BYTES} are allowed"
    try:
        decode_for_supervisor(data)
    except FrameError as error:
        return f"its reply cannot be sent: {error}"
    return ""
