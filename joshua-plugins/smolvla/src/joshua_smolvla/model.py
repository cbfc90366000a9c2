"""SmolVLA as a model: LeRobot's policy of that name."""

from __future__ import annotations

from joshua_lerobot.policy import LeRobotModel

from joshua_smolvla.settings import SmolVlaSettings


class SmolVla(LeRobotModel):
    """Runs a checkpoint of SmolVLA."""

    settings: SmolVlaSettings
