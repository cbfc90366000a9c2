"""Settings of policies, and what a policy requires of the robot, from its block and files, without torch."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from joshua.api import BlockContext, FieldError
from joshua.api.models import ModelNeeds, ModelSettings
from joshua.features import ACTION, IMAGES, STATE, Feature
from joshua.tools import install
from pydantic import model_validator

from joshua_lerobot.checkpoint import Checkpoint, CheckpointError, extent, read_checkpoint
from joshua_lerobot.hub import cached, is_hub_id
from joshua_lerobot.normalisation import NORMALISED_BY

WEIGHTS = "pretrained_model_name_or_path"

UNITS = {"UNIT_AUTO": "", "UNIT_LEROBOT": "lerobot", "UNIT_DEGREES": "deg", "UNIT_RADIANS": "rad"}

#: Names of the units in a file.
UNIT_NAMES = {unit: name for name, unit in UNITS.items()}

#: Policies that scale their pictures themselves, and so accept any size.
RESIZES = frozenset({"smolvla", "pi0", "pi05", "pi0_fast", "groot", "xvla", "wall_x"})

#: Policies that work without a missing camera.
SPARES_CAMERAS = frozenset({"smolvla", "pi0", "pi05", "pi0_fast"})

#: Policies that take a task in plain words.
READS_TASK = frozenset({"smolvla", "pi0", "pi05", "pi0_fast", "groot", "xvla", "wall_x"})

#: Policies whose chunks can continue others: flow policies with LeRobot's own real-time chunking.
CONTINUES = frozenset({"smolvla", "pi0", "pi05"})

#: Policies that predict a chunk from one observation.
PREDICTS_CHUNKS = frozenset({"act", "smolvla", "pi0", "pi05", "pi0_fast", "groot", "xvla", "wall_x"})

#: Where each policy keeps the number of its denoising steps.
DENOISING = {
    "smolvla": "num_steps",
    "pi0": "num_inference_steps",
    "pi05": "num_inference_steps",
    "diffusion": "num_inference_steps",
    "groot": "num_inference_timesteps",
    "xvla": "num_denoising_steps",
}

#: Libraries that policies import beside PyTorch and LeRobot.
LIBRARIES: dict[str, tuple[str, ...]] = {
    "smolvla": ("transformers", "num2words"),
    "pi0": ("transformers",),
    "pi05": ("transformers",),
    "pi0_fast": ("transformers", "scipy"),
    "groot": ("transformers", "peft", "diffusers", "tree", "timm"),
    "xvla": ("transformers",),
    "wall_x": ("transformers", "peft", "diffusers"),
    "diffusion": ("diffusers",),
}

#: Extras of LeRobot for policies that need more than the tested environment has.
EXTRAS = {"pi0": "pi", "pi05": "pi", "pi0_fast": "pi", "groot": "groot", "xvla": "xvla", "wall_x": "wallx"}

#: Side of the square that becomes one token of SmolVLM: four by four patches of 16 pixels.
_PICTURE_STEP = 64

#: Largest position of a joint in radians: one turn.
_TURN_RAD = 6.2832


def environment() -> str:
    """Return the remedy for a missing library: how to make and use the environment for policies."""
    command = install("joshua-lerobot", "policies")
    root, in_clone, _ = command.partition("run --with")
    command = f"{root}tools/policies.sh policies" if in_clone else command
    version = "" if in_clone else " of Python 3.12"  # the first on which the extra resolves
    return (
        f"Make an environment{version} that has it: {command} (PyTorch and LeRobot, 1 to 9 GB). Name its "
        'interpreter in the node of the model: python: "policies/bin/python"'
    )


def more_for(kind: str) -> str:
    """Return the command that installs what a type of policy requires beside PyTorch and LeRobot."""
    return f"python -m pip install 'lerobot[{EXTRAS[kind]}]'" if kind in EXTRAS else ""


class PolicySettings(ModelSettings):
    """Settings of a policy of LeRobot.

    Attributes:
        revision: of a checkpoint on the hub, "" for the newest.
        unit: of the joints in the checkpoint, "" for what its files say.
        absent_cameras: cameras of the checkpoint that the robot does not have.
        allow_unnormalized: features that may lack the statistics of their normalisation.
        actions_per_chunk: kept of each chunk; 0 for as many as the checkpoint says.
        denoising_steps, picture_size: replace the checkpoint's; 0 keeps them.
        compile: whether to use torch.compile.
    """

    #: The one type of policy that they are for, "" for any; and the prefix of their fields in the file.
    kind: ClassVar[str] = ""
    prefix: ClassVar[str] = ""

    revision: str = ""
    unit: str = ""
    absent_cameras: tuple[str, ...] = ()
    allow_unnormalized: tuple[str, ...] = ()
    actions_per_chunk: int = 0
    denoising_steps: int = 0
    picture_size: int = 0
    compile: bool = False

    @classmethod
    def si_values(cls, values: Mapping[str, Any], node: Any, context: BlockContext) -> dict[str, Any]:
        """See ``BlockSettings``."""
        own = super().si_values({}, node, context)
        own["unit"] = UNITS.get(str(values.get("units")), "")
        own["absent_cameras"] = tuple(_key(name) for name in values.get("absent_cameras") or ())
        own["allow_unnormalized"] = tuple(map(str, values.get("allow_unnormalized") or ()))
        for name in ("revision", "actions_per_chunk", "denoising_steps", "picture_size", "compile"):
            if values.get(name):
                own[name] = values[name]
        return own

    @model_validator(mode="after")
    def _has_weights(self) -> PolicySettings:
        if not self.weights:
            raise FieldError(
                "",
                "The model has no weights",
                remedy=f'Add {WEIGHTS}: "FOLDER" with the folder of a checkpoint, or its id on the hub',
            )
        if self.revision and not is_hub_id(self.weights):
            raise self._error(
                "revision", "revision has an effect only on a checkpoint of the hub", "Remove it"
            )
        return self

    def needs(self) -> ModelNeeds:
        """See ``ModelSettings``; a checkpoint of the hub that is not downloaded yet leaves it open."""
        folder = Path(self.weights)
        on_hub = not folder.exists()
        if on_hub:  # or missing here, which the check of paths reports
            found = cached(self.weights, self.revision) if is_hub_id(self.weights) else None
            if found is None:
                return self.unknown_needs()
            folder = found
        try:
            return self.needs_of(self.read(folder))
        except CheckpointError as error:
            if on_hub:  # the files may be half of a download; the node fetches the rest and checks again
                return self.unknown_needs()
            raise FieldError("", error.message, remedy=error.remedy) from error

    def read(self, folder: Path) -> Checkpoint:
        """Read the files of the checkpoint. Raises CheckpointError."""
        return read_checkpoint(folder)

    def imports(self, kind: str) -> dict[str, Any]:
        """Return the libraries of a type of policy, and how to get them, as fields of ``ModelNeeds``."""
        more = f". Add what policies of this type need: {more_for(kind)}" if kind in EXTRAS else ""
        libraries = ("torch", "lerobot", *LIBRARIES.get(kind, ()))
        return {"libraries": libraries, "install": f"{environment()}{more}"}

    def unknown_needs(self) -> ModelNeeds:
        """Return what is known without the files of the checkpoint."""
        return ModelNeeds(
            reads_state=True,
            reads_task=self.kind in READS_TASK,
            supports_rtc=self.kind in CONTINUES or not self.kind,
            **self.imports(self.kind),
        )

    def needs_of(self, checkpoint: Checkpoint) -> ModelNeeds:
        """Return what a checkpoint needs. Raises FieldError for settings that do not fit it."""
        kind, source = checkpoint.type, str(checkpoint.folder / "config.json")
        if self.kind and kind != self.kind:
            raise FieldError(
                "",
                f"{checkpoint.folder} holds a policy of type {kind!r}, and this model_type runs "
                f"{self.kind!r}",
                remedy="Name another checkpoint, or set model_type: MODEL_PLUGIN with plugin_config "
                "{ [joshua/joshua.LeRobotPolicy] {} }, which runs any policy of LeRobot",
            )
        self._check_choices(checkpoint)
        _check_statistics(checkpoint)
        self._check_normalised(checkpoint)
        unit = self.unit_of(checkpoint)
        features = []
        for item in checkpoint.inputs:
            if item.kind == "VISUAL" and item.key not in self.absent_cameras:
                sizes = (0, 0) if kind in RESIZES else item.shape[1:]
                features.append(Feature.picture(item.key, *sizes))
            elif item.kind == "STATE":
                features.append(_joints(checkpoint, item.key, item.shape[0], unit))
            elif item.kind == "ENV":
                features.append(Feature(item.key, "float32", item.shape))
        size = checkpoint.size(ACTION)
        config = checkpoint.config
        return ModelNeeds(
            features=tuple(features),
            action=_joints(checkpoint, ACTION, size, unit) if size else None,
            reads_state=bool(checkpoint.size(STATE)),
            reads_task=kind in READS_TASK,
            supports_rtc=kind in CONTINUES,
            history=1 if kind in PREDICTS_CHUNKS else int(config.get("n_obs_steps") or 1),
            chunk_steps=int(config.get("chunk_size") or config.get("n_action_steps") or 0),
            rate_hz=checkpoint.fps,
            ranges={key: found for key in (STATE, ACTION) if (found := _range(checkpoint, key)) is not None},
            source=source,
            **self.imports(kind),
        )

    def unit_of(self, checkpoint: Checkpoint) -> str:
        """Return the unit of the joints in a checkpoint. Raises FieldError if the file says another one.

        This is the unit of its data set. Without one, it is radians for networks trained here and if the
        statistics stay within a turn, else LeRobot's.
        """
        said = checkpoint.described(STATE)[1] or checkpoint.described(ACTION)[1]
        reach = extent(checkpoint)
        if self.unit and said and said != self.unit:
            raise self._error(
                "units",
                f"{checkpoint.folder} was trained on joints in {UNIT_NAMES.get(said, said)}, and the file "
                "says "
                f"{UNIT_NAMES[self.unit]}",
                "Remove units, or name the checkpoint that was trained in them",
            )
        if self.unit == "rad" and reach > _TURN_RAD:
            raise self._error(
                "units",
                f"The joints in the statistics of {checkpoint.folder} reach {reach:.4g}, more than a turn "
                f"({_TURN_RAD:.4g} rad), and the file says UNIT_RADIANS",
                "Write units: UNIT_LEROBOT, or the unit of its data set",
            )
        in_radians = checkpoint.type == "mlp" or 0 < reach <= _TURN_RAD
        return self.unit or said or ("rad" if in_radians else "lerobot")

    def _check_choices(self, checkpoint: Checkpoint) -> None:
        kind, config = checkpoint.type, checkpoint.config
        cameras = tuple(item.key for item in checkpoint.cameras)
        for key in self.absent_cameras:
            if key not in cameras:
                known = ", ".join(cameras) or "none"
                raise self._error(
                    "absent_cameras",
                    f"{key} is not a camera of {checkpoint.folder}, which has {known}",
                    "Correct it",
                )
        if self.absent_cameras and kind not in SPARES_CAMERAS:
            raise self._error(
                "absent_cameras",
                f"A policy of type {kind!r} requires every camera that it was trained with",
                "Add the camera to the robot",
            )
        if self.absent_cameras and set(cameras) == set(self.absent_cameras):
            raise self._error("absent_cameras", "The policy would have no camera", "Keep one camera at least")
        if self.denoising_steps and kind not in DENOISING:
            raise self._error("denoising_steps", f"A policy of type {kind!r} does not denoise", "Remove it")
        if self.picture_size and "resize_imgs_with_padding" not in config:
            raise self._error(
                "picture_size", f"A policy of type {kind!r} takes pictures of one size only", "Remove it"
            )
        if self.picture_size % _PICTURE_STEP:
            nearest = max(_PICTURE_STEP, round(self.picture_size / _PICTURE_STEP) * _PICTURE_STEP)
            raise self._error(
                "picture_size",
                f"The policy divides pictures into squares of {_PICTURE_STEP} pixels, but "
                f"{self.picture_size} is not a multiple",
                f"Write picture_size: {nearest}",
            )
        longest = int(config.get("chunk_size") or config.get("n_action_steps") or 0)
        if longest and self.actions_per_chunk > longest:
            raise self._error(
                "actions_per_chunk",
                f"A chunk of {checkpoint.folder} has {longest} actions",
                f"Write at most {longest}",
            )

    def _check_normalised(self, checkpoint: Checkpoint) -> None:
        """Raise FieldError for features whose values would not be normalised, unless the file allows it."""
        known = [item.key for item in (*checkpoint.inputs, *checkpoint.outputs)]
        for key in self.allow_unnormalized:
            if key not in known:
                raise self._error(
                    "allow_unnormalized",
                    f"{key} is not a feature of {checkpoint.folder}, which has {', '.join(known)}",
                    "Correct it",
                )
        excused = {*self.allow_unnormalized, *self.absent_cameras}
        lacking = [key for key in checkpoint.unnormalised if key not in excused]
        if not lacking:
            return
        stored = sorted(key for key in checkpoint.statistics if key not in known)
        others = f" (it has statistics of {', '.join(stored)})" if stored else ""
        effect = (
            "the arm would receive the numbers of the network instead of positions"
            if ACTION in lacking
            else "the network would receive numbers on another scale than in its training"
        )
        accepted = ", ".join(f'"{key}"' for key in lacking)
        raise self._error(
            "",
            f"{checkpoint.folder} normalises {', '.join(lacking)} and has no statistics for it{others}, so "
            f"{effect}",
            "Train it on data of your robot, which adds them (pretrained in imitation_config), or name a "
            f"checkpoint that has them. To run it all the same, add allow_unnormalized: [{accepted}]",
        )

    def _error(self, field: str, message: str, remedy: str) -> FieldError:
        return FieldError(f"{self.prefix}{field}" if field else "", message, remedy=remedy)


def _key(name: str) -> str:
    return name if "." in name else f"{IMAGES}{name}"


def _joints(checkpoint: Checkpoint, key: str, size: int, unit: str) -> Feature:
    names, _ = checkpoint.described(key)
    return Feature(key, "float32", (size,), names if len(names) == size else (), unit)


def _range(checkpoint: Checkpoint, key: str) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    """Return the smallest and largest positions in training, if the statistics contain them."""
    values = checkpoint.statistics.get(key, {})
    low, high = values.get("min") or values.get("q01"), values.get("max") or values.get("q99")
    return (low, high) if low and high and len(low) == len(high) == checkpoint.size(key) else None


def _check_statistics(checkpoint: Checkpoint) -> None:
    """Raise FieldError for statistics that do not fit the features."""
    for item in (*checkpoint.inputs, *checkpoint.outputs):
        values = checkpoint.statistics.get(item.key, {})
        for name in NORMALISED_BY.get(checkpoint.norms.get(item.key, ""), ()):
            found = values.get(name)
            if found is not None and item.kind in ("STATE", "ACTION") and len(found) != item.shape[0]:
                raise FieldError(
                    "",
                    f"{checkpoint.folder}: {item.key} has {item.shape[0]} numbers, and its statistics "
                    f"{name!r} "
                    f"{len(found)}: they are those of another robot",
                    remedy="Save the checkpoint with the statistics of the data set that it was trained on",
                )


class LeRobotSettings(PolicySettings):
    """Settings of a policy of any type, from the block joshua.LeRobotPolicy."""
