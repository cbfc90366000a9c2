"""Rounds of episodes on the robot, between updates: METHOD_EVAL's episodes with the weights of the moment."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from joshua.api import NodeContext
from joshua_evaluation.metrics import BUILT_IN, measured
from joshua_evaluation.robot import Robot, UnansweredError
from joshua_evaluation.settings import ON_ROBOT
from joshua_training.run_folder import RunError, RunFolder

from joshua_imitation.settings import ImitationSettings

#: Prefix of the metrics.
PREFIX = "robot/"


class RobotRounds:
    """Evaluates checkpoints on the robot. The model of the file runs them in a process of its own.

    So an evaluation draws no random number of the training: it learns the same with other episodes.

    Args:
        context: of the node; settings: of the training; folder: of the run; warn: takes warnings.
    """

    def __init__(
        self,
        context: NodeContext,
        settings: ImitationSettings,
        folder: RunFolder,
        warn: Callable[[str], None],
    ) -> None:
        self._context, self._settings, self._folder, self._warn = context, settings, folder, warn
        self._robot = Robot(context)

    def is_due(self, steps: int) -> bool:
        """Whether the weights after so many updates are to be evaluated, and are not yet."""
        return steps > 0 and steps % self._settings.robot_evaluation_steps == 0 and not self._is_known(steps)

    def try_out(self, checkpoint: Path) -> bool:
        """Let the model load a checkpoint before hours of learning. Raises RunError: it does not fit."""
        self._context.log.info("the model of the robot tries the first checkpoint")
        try:
            self._robot.use(_policy(checkpoint))
            self._robot.rest()
        except RunError as error:
            if self._context.stopping:
                return False
            raise RunError(
                f"the robot of this file cannot run the policy: {error}. Correct the file, and continue with "
                "resume_run"
            ) from error
        return not self._context.stopping

    def play(self, steps: int, checkpoint: Path, last: int) -> dict[str, float]:
        """Play the episodes of a round.

        Args:
            steps: updates so far; last: of the training.

        Returns:
            Metrics; none if the run stops or the round did not take place, which is logged.
        """
        context, robot, wanted = self._context, self._robot, self._settings.robot_episodes
        context.log.info(
            "update %d: learning pauses for %d episodes on the robot; begin each with `joshua episode`, "
            "key b, and mark it with s or f",
            *(steps, wanted),
        )
        robot.marks.restart()
        failure = ""
        try:
            robot.use(_policy(checkpoint))
            robot.wait(wanted, self._tell, self._settings.robot_wait_s)
        except (RunError, UnansweredError) as error:
            failure = str(error)
        if context.stopping:
            return {}
        try:
            robot.rest()
        except RunError as error:
            failure = failure or str(error)
        episodes = list(robot.marks.episodes)
        context.show("")
        if len(episodes) < wanted:
            later = steps + self._settings.robot_evaluation_steps
            then = (
                f"Learning goes on; the next evaluation is after update {later}"
                if later <= last
                else "Evaluate the last checkpoint with METHOD_EVAL"
            )
            self._warn(f"update {steps} has no evaluation on the robot: {failure}. {then}")
            return {}
        found = {
            f"{PREFIX}{name}": sum(measured(BUILT_IN[name], one) for one in episodes) / wanted
            for name in ON_ROBOT
        }
        context.log.info(
            "update %d: %d of %d episodes succeeded",
            steps,
            sum(bool(one.success) for one in episodes),
            wanted,
        )
        return found

    def _tell(self, state: str) -> None:
        robot, done = self._robot, self._robot.marks.episodes
        succeeded = sum(bool(one.success) for one in done)
        self._context.show(f"{state}; {succeeded} of {len(done)} succeeded{robot.stopped}")

    def _is_known(self, steps: int) -> bool:
        path = self._folder.path / "metrics.jsonl"
        lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
        rows = map(json.loads, lines)
        return any(row["steps"] == steps and f"{PREFIX}success_rate" in row for row in rows)


def _policy(checkpoint: Path) -> str:
    return str(checkpoint / "pretrained_model")
