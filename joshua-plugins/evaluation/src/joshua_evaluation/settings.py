"""Settings of an evaluation, checked at validation: metrics, checkpoints, the model plugin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from joshua.api import BlockContext, FieldError, FieldErrors
from joshua.api.models import Compute
from joshua.tools import nearest_first
from joshua_training.settings import RunSettings
from pydantic import BaseModel, ConfigDict, model_validator
from typing_extensions import Self

from joshua_evaluation.checkpoints import CheckpointError, recognise
from joshua_evaluation.metrics import BUILT_IN, offered
from joshua_evaluation.plugins import ModelOffer, model_offer

_OWN = "eval_config."

#: Fields that the policy of a trainer has no use for, which computes one action from one observation.
_OF_MODELS = ("task", "strategy", "steps_per_chunk", "inference_delay", "compute")

#: Fields for simulated episodes only.
_SIMULATED = ("randomise", *_OF_MODELS, "plugin_config")

#: Metrics of episodes on a robot, which gives no reward.
ON_ROBOT = ("success_rate", "episode_length", "smoothness", "inference_latency")

#: Seed of the first episode if neither the block nor the simulation has one.
DEFAULT_SEED = 1000


class Candidate(BaseModel):
    """A checkpoint and its model plugin.

    Attributes:
        field: that names it; given: its value; path: of the weights.
        model: the plugin that runs it, None for the policy of a trainer.
        environment: that it was trained in, "" if unknown.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    field: str
    given: str
    path: str
    environment: str = ""
    model: ModelOffer | None = None


class EvaluationSettings(RunSettings):
    """Settings of an evaluation.

    Attributes:
        candidates: the checkpoint, and the one that it is compared with.
        seed: of the first episode; None for that of the simulation.
        chosen: fields for simulated episodes that the file sets to a value other than the default.
    """

    BLOCK = "eval_config"
    REQUIRED = ("num_episodes",)
    TRACKED = False
    SPREADS = True

    candidates: tuple[Candidate, ...] = ()
    num_episodes: int = 1
    metrics: tuple[str, ...] = ()
    seed: int | None = None
    confidence: float = 0.95
    bootstrap_samples: int = 10_000
    videos: int = 1
    camera: str = ""
    randomise: bool = False
    task: str = ""
    strategy: str = "SYNCHRONOUS"
    steps_per_chunk: int | None = None
    inference_delay: int = 0
    compute: Compute = Compute()
    chosen: tuple[str, ...] = ()

    @property
    def is_on_robot(self) -> bool:
        """Whether a person marks episodes on the robot."""
        return self.environment == "ENV_REAL"

    @classmethod
    def si_values(cls, values: Mapping[str, Any], node: Any, context: BlockContext) -> dict[str, Any]:
        """Take the fields of ``eval_config``, and recognise the checkpoints."""
        known = super().si_values(values, node, context)
        block: Mapping[str, Any] = values["eval_config"] or {}
        compute = Compute(**{k: v for k, v in (block.get("compute") or {}).items() if v is not None})
        folder = Path(context.folder)
        told = {"plugin": block.get("plugin_config"), "compute": compute}
        known["candidates"] = [
            {"told": {"field": name, "given": block[name], "folder": folder, "task": block["task"], **told}}
            for name in ("model_checkpoint", "compare_with")
            if block.get(name)
        ]
        usual = {name: field.default for name, field in cls.model_fields.items()}
        given = {**block, "compute": compute}
        known["chosen"] = [name for name in _SIMULATED if given.get(name) and given[name] != usual.get(name)]
        return known | {"compute": compute}

    @model_validator(mode="before")
    @classmethod
    def _recognised(cls, values: Any) -> Any:
        """Replace names by recognised checkpoints; the settings of a running node have them already."""
        raw = values.get("candidates", ())
        if values.get("environment") == "ENV_REAL":  # a model of the file has loaded it
            plain = [item.get("told", item) for item in map(dict, raw)]
            kept = [{key: item[key] for key in ("field", "given")} for item in plain]
            return {
                **values,
                "candidates": [{**item, "path": _place(own)} for item, own in zip(kept, plain, strict=True)],
            }
        found = [_candidate(item["told"]) if "told" in item else item for item in map(dict, raw)]
        known = {**values, "candidates": [item for item in found if item is not None]}
        return known | ({"chosen": ()} if None in found else {})  # a missing one may be what uses them

    @model_validator(mode="after")
    def _fits(self) -> Self:
        known = (*BUILT_IN, *offered())
        for index, name in enumerate(self.metrics):
            if name not in known:
                near = tuple(nearest_first(name, known))
                raise FieldError(
                    f"{_OWN}metrics[{index}]",
                    f"There is no metric {name!r}",
                    allowed=near,
                    remedy=f'Write "{near[0]}", or install the plugin that adds it',
                )
            if name in self.metrics[:index]:
                raise FieldError(
                    f"{_OWN}metrics[{index}]", f"The metric {name!r} is listed twice", remedy="Remove one"
                )
        if self.is_on_robot:
            return self._fits_robot()
        if not self.environment_id:
            trained = next((item.environment for item in self.candidates if item.environment), "")
            where = f"; the checkpoint was trained in {trained}" if trained else ""
            raise FieldError(
                "environment_id",
                f"The evaluation does not name its environment{where}",
                allowed=(trained,) if trained else (),
                remedy=f'Add environment_id: "{trained or "joshua/SoArm100Reach-v0"}"',
            )
        for item in self.candidates:
            if item.environment and item.environment != self.environment_id:
                raise FieldError(
                    item.field,
                    f"{item.given} was trained in {item.environment}, not in {self.environment_id}",
                    remedy=f'Name another checkpoint, or write environment_id: "{item.environment}"',
                )
        trained_ones = [item for item in self.candidates if item.model is None]
        # beside a model, a delay of only that model would make the comparison unfair
        alone = len(trained_ones) == len(self.candidates)
        unused = _OF_MODELS if alone else ("inference_delay",)
        if trained_ones:
            why = f"{trained_ones[0].given}, the policy of a trainer, which computes one action in each step"
            remedy = "Remove it, or evaluate only weights that a model plugin runs"
            _refuse([name for name in self.chosen if name in unused], why, remedy)
        return self

    def _fits_robot(self) -> Self:
        why = "a robot, where a model of ai.models runs the weights"
        _refuse(
            self.chosen, why, "Remove it; the block of the model in ai.models has execution, compute and task"
        )
        if "avg_return" in self.metrics:
            raise FieldError(
                f"{_OWN}metrics[{self.metrics.index('avg_return')}]",
                "A robot gives no reward, so there is no return",
                allowed=ON_ROBOT,
                remedy="Remove avg_return; success_rate is the fraction of episodes marked as successful",
            )
        return self


def _refuse(names: Sequence[str], why: str, remedy: str) -> None:
    """Raise FieldErrors for fields that have no effect, if there are any."""
    found = [FieldError(f"{_OWN}{name}", f"{name} has no effect on {why}", remedy=remedy) for name in names]
    if found:
        raise FieldErrors(found)


def _place(told: Mapping[str, Any]) -> str:
    """Return the absolute path of weights, or their name on the hub."""
    if "path" in told:
        return str(told["path"])
    place = Path(told["folder"]) / Path(told["given"]).expanduser()
    return str(place) if place.exists() else str(told["given"])


def _candidate(told: Mapping[str, Any]) -> dict[str, Any] | None:
    """Recognise a checkpoint; None for a missing one, which the path checks report."""
    field, given, plugin = f"{_OWN}{told['field']}", str(told["given"]), told["plugin"]
    place = Path(told["folder"]) / Path(given).expanduser()
    try:
        found = recognise(place, given, block=str(plugin["type_url"]).rpartition("/")[2] if plugin else "")
        if found is None:
            return None
        model = None
        if found.block:
            content = bytes(plugin["value"]) if plugin else b""
            model = model_offer(found.block, content, found.path, told["task"], told["compute"])
    except CheckpointError as error:
        raise FieldError(field, error.message, remedy=error.remedy) from error
    except FieldError as error:
        if plugin and error.field:
            field = f"{_OWN}plugin_config.{error.field}"
        raise FieldError(field, str(error), allowed=error.allowed, remedy=error.remedy) from error
    return {
        "field": field,
        "given": given,
        "path": found.path,
        "environment": found.environment,
        "model": model,
    }
