"""The episodes of a recording session: what is recorded when, and which of them are kept."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from joshua.api import RefusedError

from joshua_dataset.settings import StoreSettings


class Phase(Enum):
    """Phase of a session."""

    IDLE = "ready"
    WARM_UP = "warm-up"
    RECORDING = "recording"
    REVIEW = "stopped"
    """The episode has ended and is neither kept nor discarded."""
    RESET = "reset"
    """As REVIEW; the next episode starts by itself."""
    DONE = "done"


class Step(Enum):
    """Step that a recorder takes next."""

    BEGIN = "begin"
    END = "end"
    KEEP = "keep"
    DISCARD = "discard"


@dataclass
class Session:
    """Phases of a session; times are of any monotonic clock, in seconds.

    Every call returns the steps that follow, in order. An episode that was stopped stays open until it is
    kept or discarded; starting the next one keeps it.
    """

    settings: StoreSettings
    phase: Phase = Phase.IDLE
    task: int = 0
    kept: int = 0
    until_s: float = 0.0
    """End of the phase; 0 if it has none."""
    is_over: bool = False
    """Whether the run ends."""

    @property
    def task_text(self) -> str:
        """What the episodes show."""
        return self.settings.tasks[self.task]

    @property
    def is_open(self) -> bool:
        """Whether an episode is being recorded or waits for a decision."""
        return self.phase in (Phase.RECORDING, Phase.REVIEW, Phase.RESET)

    def start(self, now_s: float) -> list[Step]:
        """Start an episode; a waiting one is kept, and may be the last. Raises RefusedError."""
        if self.phase in (Phase.WARM_UP, Phase.RECORDING):
            raise RefusedError(f"an episode is in the phase {self.phase.value}: stop it first")
        steps = self._keep()
        if self.phase is Phase.DONE and steps:
            return steps
        if self.phase is Phase.DONE:
            raise RefusedError(f"all {self.settings.num_episodes} episodes are recorded")
        return steps + self._begin(now_s)

    def stop(self, now_s: float) -> list[Step]:
        """End the episode; it can then be kept or discarded. Raises RefusedError."""
        if self.phase is Phase.WARM_UP:
            self.phase = Phase.IDLE
            return []
        if self.phase is not Phase.RECORDING:
            raise RefusedError("no episode is being recorded: start one first")
        self._review(now_s)
        return [Step.END]

    def keep(self, now_s: float) -> list[Step]:
        """Keep the episode, ending it first where it is being recorded. Raises RefusedError."""
        if not self.is_open:
            raise RefusedError("there is no episode to keep: start one first")
        steps = self.stop(now_s) if self.phase is Phase.RECORDING else []
        return steps + self._keep()

    def discard(self, now_s: float) -> list[Step]:
        """Discard the episode, ending it first where it is being recorded. Raises RefusedError."""
        if self.phase is Phase.WARM_UP:
            return self.stop(now_s)
        if not self.is_open:
            raise RefusedError("there is no episode to discard: start one first")
        ending = [Step.END] if self.phase is Phase.RECORDING else []
        self.phase = Phase.IDLE
        return [*ending, Step.DISCARD]

    def rerecord(self, now_s: float) -> list[Step]:
        """Discard the episode and start it again. Raises RefusedError."""
        return self.discard(now_s) + self._begin(now_s)

    def next_task(self) -> None:
        """Go on to the next task of the file. Raises RefusedError."""
        if self.task + 1 >= len(self.settings.tasks):
            raise RefusedError(f"{self.task_text!r} is the last task: name another one")
        self._change_task(self.task + 1)

    def set_task(self, text: str) -> None:
        """Record another task from the next episode on. Raises RefusedError."""
        if text not in self.settings.tasks:
            self.settings = self.settings.model_copy(update={"tasks": (*self.settings.tasks, text)})
        self._change_task(self.settings.tasks.index(text))

    def tick(self, now_s: float) -> list[Step]:
        """End the phases whose time is over."""
        if not self.until_s or now_s < self.until_s:
            return []
        if self.phase is Phase.WARM_UP:
            self._record(now_s)
            return [Step.BEGIN]
        if self.phase is Phase.RECORDING:
            self._review(now_s)
            last = self.settings.num_episodes and self.kept + 1 >= self.settings.num_episodes
            return [Step.END, *(self._keep() if last else [])]
        if self.phase is Phase.RESET:
            return self.start(now_s)
        return []

    def finish(self) -> list[Step]:
        """End the session and keep an open episode."""
        ending = [Step.END] if self.phase is Phase.RECORDING else []
        steps = ending + self._keep()
        self.phase, self.is_over = Phase.DONE, True
        return steps

    def take_up(self, kept: int) -> None:
        """Continue after a restart with the episodes that were kept before it."""
        self.kept = kept
        if self.settings.num_episodes and kept >= self.settings.num_episodes:
            self.phase = Phase.DONE

    def not_kept(self) -> None:
        """Note that an episode that was to be kept is not part of the data set yet: keep it again, or not."""
        self.kept -= 1
        self.phase, self.until_s = Phase.DONE if self.is_over else Phase.REVIEW, 0.0

    def miss(self) -> bool:
        """Discount a kept episode that is empty; return whether another one must replace it."""
        self.kept -= 1
        if self.phase is not Phase.DONE or self.is_over:
            return False
        self.phase = Phase.IDLE
        return True

    def _begin(self, now_s: float) -> list[Step]:
        if self.settings.warmup_s:
            self.phase, self.until_s = Phase.WARM_UP, now_s + self.settings.warmup_s
            return []
        self._record(now_s)
        return [Step.BEGIN]

    def _record(self, now_s: float) -> None:
        length_s = self.settings.episode_duration_s
        self.phase, self.until_s = Phase.RECORDING, now_s + length_s if length_s else 0.0

    def _review(self, now_s: float) -> None:
        goes_on = bool(self.settings.episode_duration_s)
        self.phase = Phase.RESET if goes_on else Phase.REVIEW
        self.until_s = now_s + self.settings.reset_duration_s if goes_on else 0.0

    def _keep(self) -> list[Step]:
        if not self.is_open:
            return []
        self.kept += 1
        done = self.settings.num_episodes and self.kept >= self.settings.num_episodes
        self.phase, self.until_s = (Phase.DONE if done else Phase.IDLE), 0.0
        return [Step.KEEP]

    def _change_task(self, number: int) -> None:
        if self.phase is Phase.RECORDING:
            raise RefusedError("an episode is being recorded: stop it first")
        self.task = number
