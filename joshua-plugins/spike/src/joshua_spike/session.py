"""A session with the hub program: one state per line, the newest set-point first."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Sequence
from dataclasses import dataclass

from joshua.api.clocks import StampClock
from joshua.api.patience import Patience

from joshua_spike.errors import LinkLost, MotorCheckFailed, ProgramFailed
from joshua_spike.hub.program import HubProgram
from joshua_spike.lines import HubState, Line
from joshua_spike.link import HubLink
from joshua_spike.pybricks import Status
from joshua_spike.waiting import wait_awake

POLL_PERIOD_S = 0.02  # polling period of the state without commands
REPLY_TIMEOUT_S = 0.25  # after which a line is sent again
HELLO_TIMEOUT_S = 0.6
CONFIGURE_TIMEOUT_S = 1.0
ORDER_PATIENCE_S = 1.0  # awake time in which the hub may leave lines without a reply
HELLO_PATIENCE_S = 1.2
CONFIGURE_PATIENCE_S = 4.0
READY_TIMEOUT_S = 5.0
PIPELINE_SHARE = 0.6  # share of a round trip between two pending lines
MOST_OUTSTANDING = 2  # lines that may be pending: one poll, one with targets
MOTOR_DEVICES = {
    46: "Technic large linear motor",
    47: "Technic extra large motor",
    48: "SPIKE medium motor",
    49: "SPIKE large motor",
    65: "SPIKE small motor",
    75: "Technic medium angular motor",
    76: "Technic large angular motor",
}
OTHER_DEVICES = {
    61: "colour sensor",
    62: "distance sensor",
    63: "force sensor",
    64: "3×3 colour light matrix",
}


@dataclass(frozen=True)
class StampedState:
    """A state and its acquisition time, ns since the epoch."""

    stamp_ns: int
    state: HubState


@dataclass
class Counters:
    """Link counters since it was opened."""

    lines: int = 0
    lost: int = 0
    corrupt: int = 0
    uploads: int = 0
    round_trip_s: float = 0.0


class HubSession:
    """Runs on the event loop of its link; other threads use ``latest``, ``end`` and ``changed``.

    Args:
        ports: letters of the ports, in joint order.
        dead_man_s, dead_man_action: action of the hub after this time without a command: H holds, F releases.
    """

    def __init__(
        self,
        device_name: str,
        service: str,
        adapter: str,
        ports: Sequence[str],
        *,
        dead_man_s: float,
        dead_man_action: str,
    ) -> None:
        self.link = HubLink(device_name, service, adapter, self._on_line, self._on_end)
        self._ports = "".join(ports)
        self._dead_man = (str(round(dead_man_s * 1000)), dead_man_action)
        self._stamps = StampClock()
        self.counters = Counters()
        self.changed = threading.Condition()
        self.latest: StampedState | None = None
        self.end: Exception | None = None
        self.number = 0  # number of received states
        self._sequence = 0
        self._sent: dict[int, int] = {}  # send times of pending lines, by sequence number
        self._answers: dict[str, asyncio.Future[Line]] = {}
        self._targets: tuple[int, ...] | None = None
        self._wake = asyncio.Event()
        self._sent_s = 0.0
        self._pump: asyncio.Task[None] | None = None
        self._closing = False

    async def open(self, program: HubProgram) -> None:
        """Connect, upload the program unless it is running, check the motors and start polling.

        Raises:
            DeviceError: one of ``joshua_spike.errors``.
        """
        await self.link.open()
        status = await self.link.first_status()
        running = bool(status & Status.PROGRAM_RUNNING) and await self._identity() == program.identity
        if not running:
            await self._upload(program)
        self.link.guard_program()
        await self._configure()
        self._pump = asyncio.ensure_future(self._run())

    async def close(self) -> None:
        """End the session. Idempotent."""
        pump, self._pump = self._pump, None
        self._closing = True  # in addition to cancel, which wait_for may swallow before Python 3.12
        if pump is not None:
            pump.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await pump
        await self.link.close()

    async def order(self, kind: str) -> HubState:
        """Make the hub execute a command now and return its next state. Raises LinkLost, ProgramFailed."""
        if kind != "E":
            self._targets = None
        line = await self._ask(Line(kind, 0), "S", REPLY_TIMEOUT_S, ORDER_PATIENCE_S)
        if line is None:
            raise self.end or LinkLost(f"{self.link}: does not respond to commands. Move closer")
        return HubState.of(line)

    def follow(self, targets_deg: tuple[int, ...]) -> None:
        """Queue targets for the link; newer ones replace them."""
        self._targets = targets_deg
        self._wake.set()

    async def _identity(self) -> str:
        """Return the identity of the running program; "" if it is not the hub program."""
        answer = await self._ask(Line("?", 0), "R", HELLO_TIMEOUT_S, HELLO_PATIENCE_S)
        return answer.words[0] if answer is not None and answer.words else ""

    async def _upload(self, program: HubProgram) -> None:
        ready: asyncio.Future[Line] = asyncio.get_running_loop().create_future()
        self._answers["R"] = ready
        await self.link.upload(program.blob)
        self.counters.uploads += 1
        try:
            await wait_awake(ready, READY_TIMEOUT_S)
        except asyncio.TimeoutError:
            words = self.link.last_words() or "nothing"
            raise ProgramFailed(
                f"{self.link}: the uploaded program does not become ready. Its output:\n"
                f"  {words}\n"
                "  Update the hub's firmware at https://code.pybricks.com, and switch the hub off and on"
            ) from None
        finally:
            self._answers.pop("R", None)

    async def _configure(self) -> None:
        words = (*self._dead_man, self._ports)
        answer = await self._ask(Line("C", 0, words), "M", CONFIGURE_TIMEOUT_S, CONFIGURE_PATIENCE_S)
        if answer is None:
            raise self.end or LinkLost(f"{self.link}: its program does not answer. Move closer")
        problems = []
        for word in answer.words:
            port, _, device = word.partition(":")
            if device == "0":
                problems.append(f"port {port}: nothing is plugged in")
            elif device.startswith("-"):
                name = OTHER_DEVICES.get(int(device[1:]), f"a device of type {device[1:]}")
                problems.append(f"port {port}: a {name} is plugged in, which is not a motor")
        if problems:
            found = ", ".join(word.replace(":-", ":") for word in answer.words)
            raise MotorCheckFailed(
                "\n  ".join(
                    [
                        f"{self.link}: motor check failed",
                        *problems,
                        f"expected: a motor on {', '.join(self._ports)}",
                        f"found (port:type): {found}",
                        "Plug the motors in, or correct port_names. Then start again.",
                    ]
                )
            )

    async def _ask(self, line: Line, answer: str, timeout_s: float, patience_s: float) -> Line | None:
        """Send a line until its reply arrives; None if none does.

        Args:
            answer: kind of the reply; timeout_s: after which the line is sent again.
            patience_s: awake time without a reply, see ``joshua.api.patience.Patience``.
        """
        patience = Patience(patience_s, period_s=timeout_s)
        while self.end is None:
            patience.begin()
            sequence = self._next_sequence()
            future: asyncio.Future[Line] = asyncio.get_running_loop().create_future()
            key = f"{answer}{sequence:02x}"
            self._answers[key] = future
            try:
                await self._say(Line(line.kind, sequence, line.words))
                return await asyncio.wait_for(future, timeout_s)
            except asyncio.TimeoutError:
                self.counters.lost += 1
                if not patience.miss():
                    return None
            finally:
                self._answers.pop(key, None)
        return None

    async def _run(self) -> None:
        """Send lines one after the other until cancelled or the link ends."""
        try:
            while self.end is None and not self._closing:
                line, wait_s = self._next_line()
                if line is not None:
                    await self._say(line)
                    continue
                self._wake.clear()
                with contextlib.suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(self._wake.wait(), wait_s)
        except (LinkLost, ProgramFailed) as error:
            self._on_end(error)

    def _next_line(self) -> tuple[Line | None, float]:
        """Return what to send now, or how long to wait."""
        now_ns = self._stamps.now_ns()
        for sequence, sent_ns in list(self._sent.items()):
            if now_ns - sent_ns > REPLY_TIMEOUT_S * 1e9:
                del self._sent[sequence]
                self.counters.lost += 1
        now_s = asyncio.get_running_loop().time()
        if self._targets is not None and len(self._sent) < MOST_OUTSTANDING:
            # targets sent together have no more effect than the last one
            early_s = self._sent_s + self.counters.round_trip_s * PIPELINE_SHARE - now_s
            if self._sent and early_s > 0:
                return None, early_s
            words = tuple(str(target) for target in self._targets)
            self._targets = None
            return Line("T", self._next_sequence(), words), 0.0
        wait_s = self._sent_s + POLL_PERIOD_S - now_s
        if not self._sent and wait_s <= 0:
            return Line("P", self._next_sequence()), 0.0
        return None, max(wait_s, 0.005) if not self._sent else REPLY_TIMEOUT_S / 4

    async def _say(self, line: Line) -> None:
        if line.kind in "TPEHF":
            self._sent[line.sequence] = self._stamps.now_ns()
        self._sent_s = asyncio.get_running_loop().time()
        self.counters.lines += 1
        await self.link.say(line)

    def _next_sequence(self) -> int:
        self._sequence = self._sequence % 255 + 1  # 0 is reserved for the hub
        return self._sequence

    def _on_line(self, line: Line) -> None:
        if line.kind == "S":
            self._on_state(line)
        for key in (f"{line.kind}{line.sequence:02x}", line.kind):
            future = self._answers.get(key)
            if future is not None and not future.done():
                future.set_result(line)
        self.counters.corrupt = self.link.reader.corrupt

    def _on_state(self, line: Line) -> None:
        try:
            state = HubState.of(line)
        except ValueError:
            self.link.reader.corrupt += 1
            return
        now_ns = self._stamps.now_ns()
        sent_ns = self._sent.get(line.sequence)
        while sent_ns is not None and line.sequence in self._sent:
            del self._sent[next(iter(self._sent))]  # the hub replies only to the newest of these
        if sent_ns is not None:
            self.counters.round_trip_s = (now_ns - sent_ns) / 1e9
        taken_ns = now_ns if sent_ns is None else (sent_ns + now_ns) // 2
        with self.changed:
            last_ns = self.latest.stamp_ns if self.latest is not None else 0
            self.latest = StampedState(max(taken_ns, last_ns + 1), state)
            self.number += 1
            self.changed.notify_all()
        self._wake.set()

    def _on_end(self, reason: Exception) -> None:
        with self.changed:
            if self.end is None:
                self.end = reason
            self.changed.notify_all()
        for future in self._answers.values():
            if not future.done():
                future.set_exception(reason)
        self._wake.set()
