"""The messages between the supervisor and a child process, as values."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from joshua.ipc.frames import FrameError
from joshua.plan import NodeReport, NodeSpec, TransportSpec
from joshua.plan.events import Progress

#: The verb that every node has: it tells the others.
LIST_VERBS = "verbs"

#: Raised whenever a message changes its meaning; both sides must agree.
PROTOCOL_VERSION = 3


class Message(BaseModel):
    """Base of all messages."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class Start(Message):
    """Supervisor to child: what to run; ``facts.restarted`` of a node says that it ran before."""

    kind: Literal["start"] = "start"
    protocol: int = PROTOCOL_VERSION
    nodes: tuple[NodeSpec, ...]
    transport: TransportSpec
    log_level: int = 20
    heartbeat_s: float = 0.05
    orphan_grace_s: float = 0.6


class Activate(Message):
    """Supervisor to child: every node is configured, start moving and publishing."""

    kind: Literal["activate"] = "activate"


class Stop(Message):
    """Supervisor to child: stop in good order.

    ``urgent`` interrupts a node that does not notice it at once, such as one whose loop has hung.
    """

    kind: Literal["stop"] = "stop"
    reason: str
    urgent: bool = False


class Call(Message):
    """Supervisor to child: do what a verb of a node does; answered with the ``CallReply`` of the same id.

    After ``deadline_ns``, on the monotonic clock, nobody waits any more, and nothing is done.
    """

    kind: Literal["call"] = "call"
    id: int
    node: str
    verb: str
    payload: dict[str, Any] = Field(default_factory=dict)
    deadline_ns: int


class Hello(Message):
    """Child to supervisor, first of all: who speaks."""

    kind: Literal["hello"] = "hello"
    protocol: int = PROTOCOL_VERSION
    version: str
    process_id: int
    python: str


class Step(Message):
    """Child to supervisor: a node entered a step of its lifecycle."""

    kind: Literal["step"] = "step"
    node: str
    step: Literal[
        "import",
        "transport",
        "configure",
        "configured",
        "activate",
        "active",
        "deactivate",
        "cleanup",
        "finished",
    ]


class Waiting(Message):
    """Child to supervisor: what a node waits for just now; "" for nothing."""

    kind: Literal["waiting"] = "waiting"
    node: str
    text: str


class Shown(Message):
    """Child to supervisor: a text for the node's part of the status line; "" for nothing."""

    kind: Literal["shown"] = "shown"
    node: str
    text: str


class Progressed(Message):
    """Child to supervisor: how far a node is with work that ends."""

    kind: Literal["progress"] = "progress"
    node: str
    progress: Progress


class ThreadAge(BaseModel):
    """A reader thread, the seconds since it last showed life, and its limit."""

    model_config = ConfigDict(frozen=True)

    name: str
    age_s: float
    limit_s: float


class Heartbeat(Message):
    """Child to supervisor, from the node's own loop: it turns.

    ``stamp_ns`` is of the monotonic clock, ``thread_id`` the system's number of the loop's thread.
    """

    kind: Literal["heartbeat"] = "heartbeat"
    node: str
    stamp_ns: int
    thread_id: int = 0
    threads: tuple[ThreadAge, ...] = ()


class Log(Message):
    """Child to supervisor: one log record. ``level`` as in ``logging``; time in ns since the epoch."""

    kind: Literal["log"] = "log"
    node: str
    time_ns: int
    level: int
    text: str
    logger: str = ""
    file: str = ""
    line: int = 0


class Topics(Message):
    """Child to supervisor: running totals of messages by topic; monotonic stamp, ns."""

    kind: Literal["topics"] = "topics"
    node: str
    stamp_ns: int
    published: dict[str, int] = Field(default_factory=dict)
    received: dict[str, int] = Field(default_factory=dict)


class FirstMessage(Message):
    """Child to supervisor: the first message of a subscription has arrived; monotonic stamp, ns."""

    kind: Literal["first-message"] = "first-message"
    node: str
    topic: str
    stamp_ns: int


class NodeWarning(Message):
    """Child to supervisor: a warning for the node's row of the start-up table."""

    kind: Literal["warning"] = "warning"
    node: str
    text: str


class Failure(Message):
    """Child to supervisor: a node failed in a step of its lifecycle.

    ``exit_code`` is the one of the program that this kind of failure calls for; ``unexpected`` says that
    the text alone does not explain it to a user.
    """

    kind: Literal["failure"] = "failure"
    node: str
    step: str
    exit_code: int
    text: str
    traceback: str = ""
    unexpected: bool = True


class Fault(Message):
    """Child to supervisor: the device of a node does nothing until it is resumed; "" ends that."""

    kind: Literal["fault"] = "fault"
    node: str
    text: str


class VerbInfo(BaseModel):
    """A verb as its node declares it; request and reply are JSON schemas, {} for nothing or a sentence."""

    model_config = ConfigDict(frozen=True)

    name: str
    summary: str = ""
    moves: bool = False
    request: dict[str, Any] = Field(default_factory=dict)
    reply: dict[str, Any] = Field(default_factory=dict)


class CallReply(Message):
    """Child to supervisor: what came of a ``Call``.

    ``code`` and ``text`` say why it is not ``ok``, ``allowed`` what would be; ``moves`` is the verb's.
    """

    kind: Literal["call-reply"] = "call-reply"
    id: int
    node: str
    ok: bool
    payload: dict[str, Any] = Field(default_factory=dict)
    code: str = ""
    text: str = ""
    allowed: tuple[str, ...] = ()
    moves: bool = False


class StopRun(Message):
    """Child to supervisor: the node's work is done and the whole run may end in good order."""

    kind: Literal["stop-run"] = "stop-run"
    node: str
    reason: str


class Report(Message):
    """Child to supervisor, last of all: figures and test results of a node."""

    kind: Literal["report"] = "report"
    report: NodeReport


ToChild = Start | Activate | Stop | Call
ToSupervisor = (
    Hello
    | Step
    | Waiting
    | Shown
    | Progressed
    | Heartbeat
    | Log
    | Topics
    | FirstMessage
    | NodeWarning
    | Failure
    | Fault
    | CallReply
    | StopRun
    | Report
)

_T = TypeVar("_T")

_ESCAPES = {code: f"\\x{code:02x}" for code in (*range(9), *range(11, 32), *range(127, 160))}
_ESCAPES |= {code: f"\\u{code:04x}" for code in (*range(0x202A, 0x202F), *range(0x2066, 0x206A))}

_TO_CHILD: TypeAdapter[ToChild] = TypeAdapter(Annotated[ToChild, Field(discriminator="kind")])
_TO_SUPERVISOR: TypeAdapter[ToSupervisor] = TypeAdapter(Annotated[ToSupervisor, Field(discriminator="kind")])


def encode(message: Message) -> bytes:
    """Serialises a message as JSON."""
    # Limits and rates can be infinite, for which pydantic's own JSON writes null.
    return json.dumps(message.model_dump()).encode()


def decode_for_child(payload: bytes) -> ToChild:
    """Reads a message of the supervisor. Raises FrameError."""
    return _decode(_TO_CHILD, payload)


def decode_for_supervisor(payload: bytes) -> ToSupervisor:
    """Reads a message of a child. Raises FrameError."""
    return _decode(_TO_SUPERVISOR, payload)


def printable(text: str, limit: int = 0) -> str:
    """Makes text safe for JSON and terminals; it may quote a device, or somebody on the network.

    Lone surrogates, control characters other than tab and line feed, and what turns the direction of a line
    round are escaped; the rest is cut at ``limit`` characters.
    """
    if limit and len(text) > limit:
        text = f"{text[:limit]}… ({len(text) - limit} more characters)"
    return text.translate(_ESCAPES).encode("utf-8", "backslashreplace").decode("utf-8")


def _decode(adapter: TypeAdapter[_T], payload: bytes) -> _T:
    try:
        return adapter.validate_json(payload)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise FrameError(f"not a message of this protocol: {first['msg']}") from error
