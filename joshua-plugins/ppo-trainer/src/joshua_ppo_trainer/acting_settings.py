"""Settings of a trained policy on a robot, and what it needs: from its files, without NumPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from joshua.api import FieldError
from joshua.api.models import ModelNeeds, ModelSettings
from joshua.features import ACTION, STATE, Feature
from joshua.tools import describe_pointer, install, parse_json
from pydantic import model_validator

from joshua_ppo_trainer.shipped import REACH

ABOUT = "policy.json"
WEIGHTS, NETWORK = "policy.safetensors", "policy.onnx"

#: Observations from a robot and a goal; objects of a simulation are not among them.
SHOWN = frozenset({STATE, "observation.velocity", "observation.lead", "observation.grip"}) | {
    "observation.last_action",
    "observation.to_goal",
}

#: Numbers of a position.
_AXES = 3


class PpoPolicySettings(ModelSettings):
    """Settings of a policy that was trained here.

    Attributes:
        goal_m: target position of the grip, in the frame of the simulated model.
    """

    goal_m: tuple[float, ...] = ()

    @model_validator(mode="after")
    def _names_a_place(self) -> PpoPolicySettings:
        if len(self.goal_m) != _AXES:
            raise FieldError(
                "goal_m",
                f"goal_m has {len(self.goal_m)} numbers, but a position has {_AXES}",
                remedy="Write goal_m: [0.0, -0.25, 0.12] with x, y and z in metres",
            )
        return self

    @property
    def folder(self) -> Path:
        """Folder of the policy's files: the newest checkpoint of a run. Raises FieldError."""
        if not self.weights:
            return REACH
        folder = Path(self.weights)
        steps = sorted((folder / "checkpoints").glob("step_*")) if (folder / "run.json").is_file() else []
        found = steps[-1] if steps else folder
        if not (found / ABOUT).is_file():
            raise FieldError(
                "",
                f"{folder} contains no policy of joshua-ppo-trainer: it has no {ABOUT} and no checkpoint",
                remedy="Name the folder of a run, which the trainer logs at its start",
            )
        return found

    def about(self) -> dict[str, Any]:
        """Description of the policy, from its files. Raises FieldError."""
        path = self.folder / ABOUT
        try:
            about = parse_json(path.read_text(encoding="utf-8"))
            features = about["features"]
            if not isinstance(about["environment"], str) or ACTION not in features:
                raise ValueError("it names no environment or no action")
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise FieldError(
                "", f"{path} does not describe a policy: {error}", remedy="Copy the checkpoint again"
            ) from error
        for name in (WEIGHTS, NETWORK):
            if (pointer := describe_pointer(self.folder / name)) is not None:
                raise FieldError("", pointer[0], remedy=pointer[1])
        if not any((self.folder / name).is_file() for name in (WEIGHTS, NETWORK)):
            message = f"{self.folder} has neither {WEIGHTS} nor {NETWORK}"
            raise FieldError("", message, remedy="Copy the checkpoint again")
        return dict(about)

    def needs(self) -> ModelNeeds:
        """See ``ModelSettings``."""
        about = self.about()
        unseen = sorted({*about["features"]} - SHOWN - {ACTION})
        if unseen or STATE not in about["features"]:
            raise FieldError(
                "",
                f"The policy of {about['environment']} observes {', '.join(unseen) or 'no joints'}, which a "
                "robot does not measure",
                remedy="Name a policy of joshua/SoArm100Reach-v0, or evaluate this one in simulation",
            )
        names = tuple(about["features"][STATE]["names"])
        onnx = not (self.folder / WEIGHTS).is_file()
        return ModelNeeds(
            features=(Feature.joints(STATE, names),),
            action=Feature.joints(ACTION, names),
            reads_state=True,
            chunk_steps=1,
            rate_hz=float(about.get("rate_hz") or 0.0),
            source=str(self.folder / ABOUT),
            libraries=("gymnasium", "mujoco", *(("onnxruntime",) if onnx else ())),
            install=f"Install it: {install('joshua-ppo-trainer', 'policy')}",
        )
