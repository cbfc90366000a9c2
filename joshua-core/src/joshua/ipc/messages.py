"""Messages between the supervisor and a child process."""

from __future__ import annotations

import json
from functools import cache
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from joshua.ipc.frames import FrameError
from joshua.plan import NodeReport, NodeSpec, TransportSettings
from joshua.plan.progress import Progress

#: Verb of every node, which lists its verbs.
LIST_VERBS = "verbs"

#: Incremented when a message changes. Both sides must have the same.
PROTOCOL_VERSION = 5


class Message(BaseModel):
    """Base of all messages."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class Start(Message):
    """Supervisor to child: the nodes to run. ``facts.restarted`` of a node marks a restart."""

    kind: Literal["start"] = "start"
    protocol: int = PROTOCOL_VERSION
    nodes: tuple[NodeSpec, ...]
    transport: TransportSettings
    log_level: int = 20
    heartbeat_s: float = 0.05
    orphan_grace_s: float = 0.6


class Activate(Message):
    """Supervisor to child: every node is configured; start to move and publish."""

    kind: Literal["activate"] = "activate"


class Stop(Message):
    """Supervisor to child: shut down cleanly. ``urgent`` interrupts a node that does not react."""

    kind: Literal["stop"] = "stop"
    reason: str
    urgent: bool = False


class Call(Message):
    """Supervisor to child: call a verb of a node. The ``CallReply`` has the same id.

    The call expires at ``deadline_ns`` of the monotonic clock: then it is not executed.
    """

    kind: Literal["call"] = "call"
    id: int
    node: str
    verb: str
    payload: dict[str, Any] = Field(default_factory=dict)
    deadline_ns: int


class Estop(Message):
    """Supervisor to child: an e-stop is latched, or released (``latch`` is None).

    A node that is told need not wait until it reads the file. ``stored``: the latch is a file. Otherwise the
    node itself remembers it until it is released.
    """

    kind: Literal["estop"] = "estop"
    latch: dict[str, Any] | None = None
    stored: bool = True


class Hello(Message):
    """Child to supervisor, first message: versions."""

    kind: Literal["hello"] = "hello"
    protocol: int = PROTOCOL_VERSION
    version: str
    process_id: int
    python: str


class Step(Message):
    """Child to supervisor: a node entered a lifecycle step."""

    kind: Literal["step"] = "step"
    node: str
    step: str


class Said(Message):
    """Child to supervisor: a text of a node.

    ``waiting``: what it waits for ("" for nothing). ``shown``: text for its part of the status line.
    ``warning``: for its row of the start-up table. ``fault``: why its device is stopped until it is resumed
    ("" ends the fault). ``priority``: of its control loop. ``stop-run``: its work is done and the whole run
    may stop, with the reason.
    """

    kind: Literal["waiting", "shown", "warning", "fault", "priority", "stop-run"]
    node: str
    text: str


class Progressed(Message):
    """Child to supervisor: progress of a node's work."""

    kind: Literal["progress"] = "progress"
    node: str
    progress: Progress


class ThreadAge(BaseModel):
    """Age of a reader thread's last sign of life, and its limit."""

    model_config = ConfigDict(frozen=True)

    name: str
    age_s: float
    limit_s: float


class Heartbeat(Message):
    """Child to supervisor, from the node's loop. Monotonic stamp; ``thread_id`` is the loop's native id."""

    kind: Literal["heartbeat"] = "heartbeat"
    node: str
    stamp_ns: int
    thread_id: int = 0
    threads: tuple[ThreadAge, ...] = ()


class Log(Message):
    """Child to supervisor: one log record. ``level`` as in ``logging``, time in ns since the epoch."""

    kind: Literal["log"] = "log"
    node: str
    time_ns: int
    level: int
    text: str
    logger: str = ""
    file: str = ""
    line: int = 0


class Topics(Message):
    """Child to supervisor: message totals by topic, with a monotonic stamp."""

    kind: Literal["topics"] = "topics"
    node: str
    stamp_ns: int
    published: dict[str, int] = Field(default_factory=dict)
    received: dict[str, int] = Field(default_factory=dict)


class FirstMessage(Message):
    """Child to supervisor: a subscription received its first message, with a monotonic stamp."""

    kind: Literal["first-message"] = "first-message"
    node: str
    topic: str
    stamp_ns: int


class Failure(Message):
    """Child to supervisor: a node failed in a lifecycle step.

    ``exit_code``: of the program after such a failure. ``unexpected``: the user needs the traceback too.
    ``is_permanent``: a restart would fail in the same way.
    """

    kind: Literal["failure"] = "failure"
    node: str
    step: str
    exit_code: int
    text: str
    traceback: str = ""
    unexpected: bool = True
    is_permanent: bool = False


class VerbInfo(BaseModel):
    """Declaration of a verb. Request and reply are JSON schemas: {} is no request, or a sentence as reply."""

    model_config = ConfigDict(frozen=True)

    name: str
    summary: str = ""
    moves: bool = False
    request: dict[str, Any] = Field(default_factory=dict)
    reply: dict[str, Any] = Field(default_factory=dict)


class CallReply(Message):
    """Child to supervisor: result of a ``Call``.

    ``code`` and ``text`` explain a refusal, ``allowed`` lists alternatives. ``moves`` is the verb's.
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


class Estopped(Message):
    """Child to supervisor: effect of an e-stop on the device of a node, the fields of an ``EstopReport``."""

    kind: Literal["estopped"] = "estopped"
    node: str
    report: dict[str, Any]


class Report(Message):
    """Child to supervisor, last message: figures and test results of a node."""

    kind: Literal["report"] = "report"
    report: NodeReport


ToChild = Start | Activate | Stop | Call | Estop
NodeMessage = (
    Step
    | Said
    | Progressed
    | Heartbeat
    | Log
    | Topics
    | FirstMessage
    | Failure
    | CallReply
    | Estopped
    | Report
)
ToSupervisor = Hello | NodeMessage

_T = TypeVar("_T")


@cache
def _to_child() -> TypeAdapter[ToChild]:
    return TypeAdapter(Annotated[ToChild, Field(discriminator="kind")])


@cache
def _to_supervisor() -> TypeAdapter[ToSupervisor]:
    return TypeAdapter(Annotated[ToSupervisor, Field(discriminator="kind")])


def prepare_child() -> None:
    """Builds the validators of a child, in the fork server for all of its children."""
    _to_child()


def prepare_supervisor() -> None:
    """Builds the validators of the supervisor, while it waits for its first child."""
    _to_supervisor()


def encode(message: Message) -> bytes:
    """Serialises a message as JSON."""
    # Limits and rates can be infinite, for which pydantic's own JSON writes null.
    return json.dumps(message.model_dump()).encode()


def decode_for_child(payload: bytes) -> ToChild:
    """Reads a message of the supervisor. Raises FrameError."""
    return _decode(_to_child(), payload)


def decode_for_supervisor(payload: bytes) -> ToSupervisor:
    """Reads a message of a child. Raises FrameError."""
    return _decode(_to_supervisor(), payload)


def _decode(adapter: TypeAdapter[_T], payload: bytes) -> _T:
    try:
        return adapter.validate_json(payload)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise FrameError(f"not a message of this protocol: {first['msg']}") from error
