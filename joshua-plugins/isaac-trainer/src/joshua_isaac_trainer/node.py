"""Node of the trainer: starts the process of Isaac Sim and writes the run's folder."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from joshua.api import NodeContext
from joshua_training.run_folder import RunError
from joshua_training.trainer import LearningNode

from joshua_isaac_trainer.channel import Channel
from joshua_isaac_trainer.settings import TASKS, IsaacSettings

#: Longest start of Isaac Sim: the first one compiles shaders and fetches extensions.
START_S = 1800.0

#: How often a wait looks whether the run stops.
POLL_S = 0.25

#: How long the process may take to end.
END_S = 5.0

#: Device of simulation and learning.
DEVICE = "cuda:0"

#: Output of the process of Isaac Sim, in the folder of the run, and lines of it in an error.
LOG, LAST_LINES = "isaac.log", 5

#: Settings that ``run.json`` does not repeat.
_HIDDEN = {
    *("environment", "environment_id", "output_folder", "resume_run", "tracking"),
    *IsaacSettings.WITHOUT_EFFECT,
}


class IsaacError(RunError):
    """Isaac Lab cannot go on; the exit code is that of its reason."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code


class IsaacTrainer(LearningNode):
    """Trains a policy by PPO in Isaac Lab, and ends the run when all steps are done."""

    SHOWN = (("episode/success_rate", "success {:.2f}"), ("episode/return", "return {:.1f}"))
    FREE = ("total_timesteps", "checkpoint_steps")

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._settings = IsaacSettings.model_validate(context.spec.settings)
        self._job: dict[str, Any] = {}
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: Channel | None = None
        self._steps = 0

    def configure(self) -> None:
        """Make or open the run. The settings have checked the machine."""
        chosen = self.facts.environment
        if chosen is None:
            raise RunError("the plan has no environment: set ai.training.environment_id")
        if chosen.environment_id not in TASKS:
            raise RunError(
                f"{chosen.environment_id} is not built for Isaac Lab: choose {' or '.join(TASKS)}, or "
                "BACKEND_MUJOCO"
            )
        settings = self._settings
        seed = 0 if chosen.seed is None else chosen.seed
        facts: dict[str, Any] = {
            "simulator_backend": settings.BACKEND,
            "environment": chosen.environment_id,
            "reward_function": chosen.reward_function,
            "seed": seed,
            "settings": settings.model_dump(mode="json", exclude=_HIDDEN),
        }
        self.checkpoint_steps = settings.checkpoint_steps
        checkpoint = self.reopen(settings.resume_run, facts)
        if checkpoint is None:
            name = chosen.environment_id.partition("/")[2]
            self.begin(settings.output_folder, re.sub(r"[^A-Za-z0-9]+", "-", name), facts)
        self._job = {
            "environment_id": chosen.environment_id,
            "reward_function": chosen.reward_function,
            "num_envs": settings.num_envs,
            "randomise": settings.randomise,
            "seed": seed,
            "device": DEVICE,
            "settings": settings.model_dump(mode="json"),
            "run": str(self.folder.path),
            "folder": str(self.folder.path / "robot"),
            "checkpoint": str(checkpoint) if checkpoint is not None else "",
        }

    def prepare(self) -> bool:
        """Start Isaac Sim, which takes a minute, or many at the first time."""
        mine, other = socket.socketpair()
        with other, (self.folder.path / LOG).open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "joshua_isaac_trainer.worker", str(other.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                pass_fds=(other.fileno(),),
            )
        self._channel = Channel(mine)
        self._channel.send(self._job)
        self.context.log.info("Isaac Sim starts; its output is in %s", self.folder.path / LOG)
        answer = next((a for a in self._answers(START_S) if a is not None or self.context.stopping), None)
        if answer is None:
            if self.context.stopping:
                return False
            raise RunError(f"Isaac Sim did not start within {START_S:g} s; its output is in {self._log()}")
        self._steps = int(answer["steps"])
        if self._job["checkpoint"]:
            self.continue_after(Path(self._job["checkpoint"]))
        return True

    @property
    def steps(self) -> int:
        """Environment steps of the complete iterations."""
        return self._steps

    @property
    def total(self) -> int:
        """Environment steps of the whole training."""
        return self._settings.total_timesteps

    def advance(self) -> Mapping[str, float] | None:
        """Collect and update once."""
        answer = self._asked({"do": "advance"}, self.HANG_S)
        self._steps = int(answer["steps"])
        self.context.progress(
            "training", float(min(self._steps, self.total)), float(self.total), unit="steps"
        )
        row: Mapping[str, float] | None = answer["row"]
        return row

    def save(self) -> Path:
        """Let the process write a checkpoint, and move it into place."""
        return self.folder.save_by(self._steps, self._written)

    def release(self) -> None:
        """End the process of Isaac Sim."""
        channel, self._channel = self._channel, None
        process, self._process = self._process, None
        if channel is not None:
            channel.close()
        if process is not None:
            try:
                process.wait(END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def _written(self, draft: Path) -> None:
        answer = self._asked({"do": "save", "folder": str(draft)}, self.HANG_S)
        if "refused" in answer:
            raise OSError(answer["number"], answer["refused"])

    def _asked(self, request: dict[str, Any], timeout_s: float) -> dict[str, Any]:
        """Send a request and wait for its answer; a stop of the run interrupts what the process does."""
        assert self._channel is not None
        self._channel.send(request)
        stopping = False
        for answer in self._answers(timeout_s):
            if answer is not None:
                return answer
            if self.context.stopping and not stopping:
                stopping = True
                self._channel.send({"do": "pause"})
        raise RunError(f"Isaac Sim did not answer within {timeout_s:g} s; its output is in {self._log()}")

    def _answers(self, timeout_s: float) -> Iterator[dict[str, Any] | None]:
        """Yield the next answer, and None while there is none. Raises RunError."""
        assert self._channel is not None
        end_s = time.monotonic() + timeout_s
        while time.monotonic() < end_s:
            try:
                answer = self._channel.receive(POLL_S)
            except TimeoutError:
                yield None
                continue
            if answer is None or "error" in answer:
                self._saved = self._steps  # the process is gone, and with it what could be saved
            if answer is None:
                raise RunError(self._ended_early())
            if "error" in answer:
                raise IsaacError(
                    f"{answer['error']}; Isaac Sim's output is in {self._log()}", answer["exit_code"]
                )
            yield answer

    def _log(self) -> Path:
        return self.folder.path / LOG

    def _ended_early(self) -> str:
        assert self._process is not None
        code = self._process.wait(END_S)
        lines = self._log().read_text(encoding="utf-8", errors="replace").strip().splitlines()[-LAST_LINES:]
        ending = f"signal {-code}" if code < 0 else f"exit code {code}"
        return f"Isaac Sim ended ({ending}); the end of {self._log()}: {' | '.join(lines) or 'nothing'}"
