"""Record the observations and actions of a running robot, aligned by acquisition time.

Transport threads only hand messages to the aligner. The node's timer takes complete frames from it. A
separate thread converts and writes them, and each camera has an encoder thread. A writer that falls behind
ends the episode.

Why one file: it is one class, whose threads share one lock and one queue.
"""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from joshua.api import NodeContext, RefusedError, verb
from joshua.api.nodes import ServiceFacts
from joshua.features import ACTION, EpisodeError, FeatureError, Frame
from joshua.messages import MessageError
from joshua.messages.arrays import acquired_ns, array_of

from joshua_dataset.buttons import JOY, Buttons
from joshua_dataset.cues import Cues
from joshua_dataset.described import Description
from joshua_dataset.disk import free_bytes, require_space, shortage
from joshua_dataset.formats import writer_of
from joshua_dataset.mcap_writer import McapWriter
from joshua_dataset.open_episode import read_journal
from joshua_dataset.pictures import QUEUE_S
from joshua_dataset.reader import DatasetError
from joshua_dataset.repair import is_unfinished, repaired
from joshua_dataset.sampler import COUNTERS, Sampler
from joshua_dataset.session import Phase, Session, Step
from joshua_dataset.settings import StoreSettings
from joshua_dataset.streams import NS_PER_S, RecorderStatus, Stream, Task
from joshua_dataset.writer import DatasetWriter, NotKept

#: How long an automatic start waits for topics before it reports so.
PATIENCE_S = 10.0


@dataclass(frozen=True)
class _Unkept:
    """An episode that could not be kept yet, with what it is kept with next time."""

    error: EpisodeError
    task: str
    counts: dict[str, int]


class Recorder:
    """Behaviour of ``DATA_STORE_RECORD``.

    Args:
        context: of the node; settings: of the block; facts: observations and actions of the robot.

    Attributes:
        on_kept: called on the writer's thread when an episode is complete on the disk.
    """

    def __init__(self, context: NodeContext, settings: StoreSettings, facts: ServiceFacts) -> None:
        self._context, self._settings, self._facts = context, settings, facts
        self._session = Session(settings)
        topics = context.spec.subscriptions
        self._pads = [item for item in topics if item.type_name == JOY] if settings.buttons else []
        control = {item.name for item in self._pads}
        self._streams = {item.topic: Stream(item) for item in facts.features if item.topic not in control}
        self._described = Description(settings, facts, self._streams.values())
        self._actions = {"record": self._toggle, "keep": self.keep, "discard": self.discard}
        self._cues = Cues(context, spoken=settings.spoken_cues)
        self._sampler: Sampler | None = None
        self._writer: DatasetWriter | None = None
        self._work: queue.Queue[Callable[[], None] | None] = queue.Queue()
        self._lock = threading.RLock()
        self._has_failed = False
        self._unkept: _Unkept | None = None
        self._phase_began_s = time.monotonic()
        self._counts = dict.fromkeys(COUNTERS, 0)
        self._frames_waiting = 0
        self._message = ""
        self._busy = (0.0, 0.0)
        self._load = 0.0
        self._auto = settings.auto_start
        self._last: Future[str] | None = None
        self.on_kept: Callable[[], None] = lambda: None
        chosen = {name: self._actions[action] for action, name in settings.buttons.items()}
        self._buttons = Buttons(context, chosen)
        self._due_s = 0.0
        self._raw = settings.format == "mcap"
        self._queued_s: deque[float] = deque()

    def configure(self) -> None:
        """Subscribe. Raises EpisodeError."""
        context = self._context
        if not self._streams:
            raise EpisodeError(f"{context.spec.full_name} has nothing to record: no node publishes a topic")
        if not self._settings.folder:
            raise EpisodeError("a recording needs a folder: set local_path")
        if self._facts.restarted:
            folder = Path(self._settings.folder)
            if is_unfinished(folder):
                journal = read_journal(folder) or {}
                done = repaired(folder)
                context.log.warning(done.text)
                self._session.take_up(int(journal.get("kept", 0)) + done.has_kept)
            self._settings = self._settings.model_copy(update={"resume": True})
        self._made().check()
        if self._settings.buttons and not self._pads:
            raise EpisodeError(
                "a button of a gamepad controls the recording, and no node publishes its state. "
                "Add a publisher of data_type: JOY to a PERCEPTION_GAMEPAD node"
            )
        if not any(key.startswith(ACTION) for key in self._described.features):
            context.warn(
                "no action is recorded, because no actuator of the file takes commands: "
                "a policy cannot be trained on this data set"
            )
        for topic in context.spec.subscriptions:
            if (stream := self._streams.get(topic.name)) is not None:
                stream.traffic = context.subscribe(topic, self._taker(stream))
            elif topic in self._pads:
                context.subscribe(topic, self._buttons.take)
            elif self._raw:
                context.subscribe(topic, self._takes_messages(topic.name))

    def activate(self) -> None:
        """Start the threads."""
        self._due_s = time.monotonic()
        self._context.spawn_thread(self._write, name="writer", hang_after_s=60.0)
        if self._pads:
            self._context.spawn_thread(self._buttons.run, name="buttons", hang_after_s=60.0)
        self._context.create_timer(1 / min(self._settings.fps, 100), self._tick, name="frames")
        self._context.create_timer(0.5, self._show, name="display")

    def deactivate(self) -> None:
        """Keep an open episode, and wait for the disk."""
        with self._lock:
            self._end_time()
            self._do(self._session.finish(), log=True)
            last = self._last
        if last is not None and wait([last], timeout=20.0).not_done:
            self._context.log.error("the writer has not answered within 20 s: the disk may hang")

    def cleanup(self) -> None:
        """Close the data set; the writer's thread has ended."""
        self._work.put(None)
        self._cues.close()
        if self._writer is not None:
            self._writer.leave()
            self._writer = None

    @verb(moves=False, runs="beside")
    def start(self) -> str:
        """Start an episode; one that waits for a decision is kept."""
        with self._lock:
            self._require_topics()
            require_space(Path(self._settings.folder))
            try:
                self._open()
            except EpisodeError as error:
                raise RefusedError(str(error)) from error
            steps = self._session.start(time.monotonic())
            self._phase_began_s = time.monotonic()
        if self._session.phase is Phase.DONE:
            return self._answer(self._do(steps))
        kept = self._answer(self._do(steps))
        started = f"episode {self._number} starts: {self._session.task_text or 'no task'}"
        return f"{kept}; {started}" if kept else started

    def _toggle(self) -> str:
        """Start or stop, for the button that does both."""
        recording = self._session.phase in (Phase.RECORDING, Phase.WARM_UP)
        return self.stop() if recording else self.start()

    @verb(moves=False, runs="beside")
    def stop(self) -> str:
        """End the episode; then keep or discard it."""
        with self._lock:
            steps = self._session.stop(time.monotonic())
            self._end_time()
        self._answer(self._do(steps))
        frames = self._writer.open_frames if self._writer is not None else 0
        return f"episode {self._number} is stopped with {frames} frames: keep or discard it"

    @verb(moves=False, runs="beside")
    def keep(self) -> str:
        """Keep the episode; one that is being recorded ends first."""
        with self._lock:
            steps = self._session.keep(time.monotonic())
            self._end_time()
        return self._answer(self._do(steps))

    @verb(moves=False, runs="beside")
    def discard(self) -> str:
        """Discard the episode that is being recorded or was stopped."""
        with self._lock:
            steps = self._session.discard(time.monotonic())
        self._answer(self._do(steps))
        return f"episode {self._number} is discarded"

    @verb(moves=False, runs="beside")
    def rerecord(self) -> str:
        """Discard the episode and record it again."""
        with self._lock:
            steps = self._session.rerecord(time.monotonic())
            self._phase_began_s = time.monotonic()
        self._answer(self._do(steps))
        return f"episode {self._number} is recorded again"

    @property
    def task_parameter(self) -> str:
        """Task of the next episode."""
        return self._session.task_text

    @verb(moves=False, runs="beside", sets="task")
    def task(self, request: Task) -> str:
        """Record another task from the next episode on; without a text, the next one of the file."""
        with self._lock:
            if request.text:
                self._session.set_task(request.text)
            else:
                self._session.next_task()
            return f"the task is {self._session.task_text!r}"

    @verb(moves=False, runs="beside")
    def status(self) -> RecorderStatus:
        """Report the state of the recorder."""
        session, sampler, now_s = self._session, self._sampler, time.monotonic()
        folder = Path(self._settings.folder)
        return RecorderStatus(
            phase=session.phase.value,
            task=session.task_text,
            episode=self._number,
            kept=session.kept,
            wanted=self._settings.num_episodes,
            frames=self._writer.open_frames if self._writer is not None else 0,
            elapsed_s=now_s - self._phase_began_s,
            remaining_s=max(0.0, session.until_s - now_s) if session.until_s else 0.0,
            delays_s={item.feature.key: item.delay_s for item in self._streams.values()},
            rates_hz={
                item.feature.key: round(1 / item.period_s, 1) if item.period_s and not item.is_stale else 0.0
                for item in self._streams.values()
            },
            worst_alignment_s=self._counts["worst_alignment_ns"] / NS_PER_S,
            dropped=self._counts["dropped"],
            held=self._counts["held"],
            missing=sampler.missing if sampler else (),
            queue_s=self._behind_s,
            encoder_load=self._load,
            free_bytes=free_bytes(folder),
            folder=str(folder),
            message=self._message,
        )

    @property
    def _number(self) -> int:
        return self._writer.episodes if self._writer is not None else 0

    @property
    def _behind_s(self) -> float:
        if self._queued_s:
            return time.monotonic() - self._queued_s[0]
        encoders = self._writer.waiting if self._writer is not None else 0
        return (self._frames_waiting + encoders) / self._settings.fps

    def _taker(self, stream: Stream) -> Callable[[Any, int], None]:
        feature, names = stream.feature, stream.feature.names

        def take(message: Any, received_ns: int) -> None:
            stamp_ns = stream.take(message, received_ns)
            sampler = self._sampler
            if sampler is None:
                return
            if self._raw:
                self._take_message(stream.feature.topic, message, received_ns, stamp_ns)
            if stream.is_latched:
                return
            if feature.is_picture:
                sampler.push(feature.key, stamp_ns, message)  # becomes an array on the writer's thread
                return
            try:
                sampler.push(feature.key, stamp_ns, np.asarray(array_of(message, names)))
            except MessageError as error:
                self._say(f"a message on {feature.topic} is not recorded: {error}")

        return take

    def _take_message(self, topic: str, message: Any, received_ns: int, stamp_ns: int) -> None:
        self._queued_s.append(time.monotonic())
        self._work.put(lambda: self._add_message(topic, message, received_ns, stamp_ns))

    def _takes_messages(self, topic: str) -> Callable[[Any, int], None]:
        """Take messages that do not become a feature, such as the states of a leader."""

        def take(message: Any, received_ns: int) -> None:
            if self._sampler is not None:
                self._take_message(topic, message, received_ns, acquired_ns(message, received_ns))

        return take

    def _tick(self) -> None:
        """Take complete frames, and end phases whose time is over (on the node's thread)."""
        now_ns = self._context.now_ns()
        with self._lock:
            starts = self._auto and time.monotonic() >= self._due_s
            if starts and self._session.phase is Phase.IDLE and not self._stale():
                self._auto = False
                try:
                    require_space(Path(self._settings.folder))
                    self._open()
                    self._do(self._session.start(time.monotonic()))
                    self._phase_began_s = time.monotonic()
                except (RefusedError, EpisodeError) as error:
                    self._say(str(error))
            elif self._auto and time.monotonic() - self._due_s > PATIENCE_S and (stale := self._stale()):
                self._say(f"waiting for the next episode: no message received on {', '.join(stale)}")
            self._flush(now_ns)
            try:
                before = self._session.phase
                if before is Phase.RESET and self._session.until_s <= time.monotonic() and self._stale():
                    return  # the next episode waits until every topic has messages again
                steps = self._session.tick(time.monotonic())
            except RefusedError as error:
                self._say(str(error))
                steps = []
            if self._session.phase is not before:
                self._phase_began_s = time.monotonic()
                if before is Phase.RECORDING:
                    self._end_time()
            self._do(steps, log=True)
            self._cues.follow(self._session.phase, self._number)
            if self._session.phase is Phase.RECORDING:
                behind_s = self._behind_s
                if behind_s > 2 * QUEUE_S:
                    self._end_early(f"the writer is {behind_s:.1f} s behind: lower fps or the picture size")
                elif why := shortage(Path(self._settings.folder)):
                    self._end_early(why)
        # In this order: the writer may find that the last episode does not count, and answers then.
        settled = self._last is None or self._last.done()
        if settled and self._session.phase is Phase.DONE and self._settings.num_episodes:
            self._context.end_run(f"{self._session.kept} episodes are in {self._settings.folder}")

    def _flush(self, now_ns: int) -> None:
        sampler = self._sampler
        if sampler is None or self._session.phase is not Phase.RECORDING:
            return
        for frame in sampler.poll(now_ns):
            self._enqueue(frame)
        if sampler.failed:
            self._sampler = None
            self._do(self._session.discard(time.monotonic()))
            self._say(f"episode {self._number} is discarded: {sampler.failed}")
        elif sampler.over:
            self._end_early(sampler.over)

    def _end_time(self) -> None:
        """Make the last frames of the episode that have all their values."""
        sampler, self._sampler = self._sampler, None
        if sampler is not None:
            for frame in sampler.rest(self._context.now_ns()):
                self._enqueue(frame)

    def _enqueue(self, frame: Frame) -> None:
        if self._raw:
            return  # frames are only counted
        self._frames_waiting += 1
        self._work.put(lambda: self._add(frame))

    def _end_early(self, why: str) -> None:
        steps = self._session.stop(time.monotonic())
        self._end_time()
        self._do(steps)
        waits = self._session.phase is Phase.REVIEW
        self._say(f"episode {self._number} ended early: {why}", error=True)
        if waits:
            self._context.log.info("keep its frames with `joshua record keep`, or discard them")

    def _do(self, steps: list[Step], *, log: bool = False) -> Future[str] | None:
        """Hand steps to the writer's thread, in order; return the answer to the last one.

        Args:
            log: the answer; a verb's answer is logged by its node.
        """
        answer: Future[str] | None = None
        for step in steps:
            answer = Future()
            if step is Step.BEGIN:
                self._sampler = Sampler(self._streams.values(), self._settings, self._context.now_ns())
                self._counts = self._sampler.counts
            task, counts, kept = self._session.task_text, self._counts, self._session.kept
            if log and step is Step.KEEP:
                answer.add_done_callback(self._log)
            self._work.put(self._carrying_out(step, task, counts, kept, answer))
            self._last = answer
        return answer

    def _carrying_out(
        self, step: Step, task: str, counts: dict[str, int], kept: int, answer: Future[str]
    ) -> Callable[[], None]:
        def carry_out() -> None:
            writer = self._writer
            assert writer is not None
            try:
                if step is Step.BEGIN:
                    if self._unkept is not None:
                        raise self._unkept.error
                    writer.task, self._has_failed = task, False
                    writer.kept = kept
                    self._busy = (time.monotonic(), 0.0)
                elif step is Step.KEEP:
                    if writer.open_frames:
                        self._message = self._keep(writer, task, counts)
                        self.on_kept()  # before the answer, which ends the run
                        answer.set_result(self._message)
                        return
                    self._say(f"episode {writer.episodes} has no frame and is not kept")
                    self._not_kept()
                elif step is Step.DISCARD:
                    self._unkept = None
                    writer.drop_episode()
                answer.set_result("")
            except EpisodeError as error:
                answer.set_exception(error)

        return carry_out

    def _keep(self, writer: DatasetWriter, task: str, counts: dict[str, int]) -> str:
        """Keep the open episode, perhaps once more (on the writer's thread). Raises EpisodeError."""
        if self._unkept is not None:
            task, counts = self._unkept.task, self._unkept.counts
        number, before, length_s = writer.episodes, writer.frames, writer.open_s
        try:
            writer.end_episode(task, counts)
        except EpisodeError as error:
            with self._lock:
                self._session.not_kept()
                self._sampler, self._has_failed = None, True
                is_over = self._session.is_over
            if isinstance(error, NotKept) and not is_over:
                error = EpisodeError(error.text("run `joshua record keep`"))
            self._unkept = _Unkept(error, task, counts)
            self._message = str(error)
            self._context.log.error("%s", error)
            raise error from None
        self._unkept = None
        if writer.aside is not None:
            self._context.log.warning(
                "the rest of episode %d is damaged; its files were moved to %s", number, writer.aside
            )
        frames = writer.frames - before
        if not self._raw:
            length_s = frames / self._settings.fps
        return _kept(number, frames, length_s, counts, "messages" if self._raw else "frames")

    def _not_kept(self) -> None:
        """Continue the session if this episode would have completed it (on the writer's thread)."""
        with self._lock:
            if self._session.miss() and self._settings.episode_duration_s:
                self._auto, self._due_s = True, time.monotonic() + self._settings.reset_duration_s

    def _add(self, frame: Frame) -> None:
        """Convert and write a frame (on the writer's thread)."""
        self._frames_waiting -= 1
        writer = self._writer
        if writer is None or self._has_failed:
            return
        try:
            writer.add_frame(self._described.converted(frame))
        except (MessageError, DatasetError, FeatureError) as error:
            self._counts["dropped"] += 1
            self._say(f"a frame is dropped: {error}")
        except EpisodeError as error:
            self._fail(error)

    def _add_message(self, topic: str, message: Any, received_ns: int, stamp_ns: int) -> None:
        """Write a message (on the writer's thread)."""
        self._queued_s.popleft()
        if self._has_failed or not isinstance(self._writer, McapWriter):
            return
        try:
            self._writer.add_message(topic, message, received_ns, stamp_ns)
        except EpisodeError as error:
            self._fail(error)

    def _fail(self, error: EpisodeError) -> None:
        """End an episode that cannot be written; what is on the disk of it stays, and the robot continues."""
        with self._lock:
            self._sampler, self._has_failed = None, True
            if self._session.phase is Phase.RECORDING:
                self._session.stop(time.monotonic())
        self._message = f"episode {self._number} ended early: {error}"
        self._context.log.error("%s", self._message)
        self._context.log.info(
            "its frames so far are on the disk: keep them with `joshua record keep`, or discard them"
        )

    def _write(self) -> None:
        """Run queued steps until the node has stopped (on its own thread)."""
        while True:
            stopping = self._context.stopping  # read on each pass: this is the thread's heartbeat
            try:
                work = self._work.get(timeout=0.2)
            except queue.Empty:
                if stopping and self._session.phase is Phase.DONE:
                    return
                continue
            if work is None:
                return
            work()
            if self._writer is not None and self._busy[0]:
                now_s, busy_s = time.monotonic(), self._writer.busy_s
                if now_s - self._busy[0] > 1:
                    self._load = max(0.0, busy_s - self._busy[1]) / (now_s - self._busy[0])
                    self._busy = (now_s, busy_s)

    def _open(self) -> None:
        """Open the data set when the content of every topic is known. Raises EpisodeError."""
        if self._writer is not None:
            return
        self._described.look()
        writer = self._made()
        writer.open()
        self._writer = writer

    def _made(self) -> DatasetWriter:
        layout = self._described.layout(resume=self._settings.resume)
        return writer_of(self._settings.format)(layout)

    def _stale(self) -> list[str]:
        return [
            topic
            for topic, stream in self._streams.items()
            if not stream.is_latched and (stream.newest is None or stream.is_stale)
        ]

    def _require_topics(self) -> None:
        stale = self._stale()
        if stale:
            raise RefusedError(
                f"no message received on {', '.join(stale)}: an episode needs every topic. "
                "Check the node that publishes it with joshua status"
            )

    def _answer(self, done: Future[str] | None) -> str:
        if done is None:
            return ""
        try:
            return done.result(timeout=20.0)
        except EpisodeError as error:
            raise RefusedError(str(error)) from error
        except TimeoutError as error:
            raise RefusedError("the writer has not answered within 20 s: the disk may hang") from error

    def _log(self, answer: Future[str]) -> None:
        if answer.exception() is None and answer.result():
            self._context.log.info(answer.result())

    def _say(self, text: str, *, error: bool = False) -> None:
        if text != self._message:
            self._message = text
            self._context.log.log(logging.WARNING if error else logging.INFO, "%s", text)

    def _show(self) -> None:
        session, writer = self._session, self._writer
        wanted = f"/{self._settings.num_episodes}" if self._settings.num_episodes else ""
        parts = [f"episode {self._number}{wanted} {session.phase.value}"]
        stale = self._stale()
        if writer is not None and session.is_open:
            parts.append(f"{writer.open_s:.1f} s")
            if self._counts["dropped"]:
                parts.append(f"{self._counts['dropped']} dropped")
            if self._behind_s > 0.5:
                parts.append(f"{self._behind_s:.1f} s behind")
        elif stale:
            parts.append(f"waiting for {', '.join(stale)}")
        self._context.show(", ".join(parts))
        for stream in self._streams.values():
            tolerance_s = self._settings.tolerance_s or 1 / self._settings.fps
            if warning := stream.clock_warning(tolerance_s, simulated=self._facts.use_sim_time):
                self._context.warn(warning)
        self._context.progress("episodes", session.kept, self._settings.num_episodes or None, unit="episodes")


def _kept(number: int, frames: int, length_s: float, counts: dict[str, int], what: str) -> str:
    text = f"episode {number} is kept: {frames} {what} ({length_s:.1f} s)"
    for name in ("dropped", "held"):
        if counts[name]:
            text += f", {counts[name]} {name}"
    return text
