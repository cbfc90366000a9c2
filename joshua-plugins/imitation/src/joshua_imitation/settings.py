"""Settings of the trainer: the fields of ``imitation_config``, and those that a policy fixes.

Why one file: a validation reports the problems of all fields at once, and most concern several of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from joshua.api import BlockContext, FieldError, FieldErrors
from joshua.features import FeatureSet
from joshua.tools import parse_json
from joshua_lerobot.checkpoint import CheckpointError
from joshua_lerobot.hub import cached
from joshua_training.settings import RunSettings
from pydantic import model_validator
from typing_extensions import Self

from joshua_imitation.arms import joined_features
from joshua_imitation.proportions import distortion
from joshua_imitation.start import read_start

#: Losses that each policy supports, its own first.
LOSSES: Mapping[str, tuple[str, ...]] = {"act": ("l1",), "diffusion": ("mse", "l1"), "smolvla": ("mse",)}

#: Why a policy has its loss.
_FIXED = {
    "act": "ACT learns by the absolute error of its chunks (l1) and the divergence of its latent variable",
    "smolvla": "SmolVLA learns by flow matching, whose loss is the squared error (mse)",
}

#: Fields that only some policies have.
_ONLY = {
    "hidden_size": ("act", "diffusion"),
    "feedforward_size": ("act",),
    "encoder_layers": ("act",),
    "backbone_learning_rate": ("act",),
    "pretrained_backbone": ("act", "diffusion"),
    "use_vae": ("act",),
    "lora_rank": ("smolvla",),
}

_PICTURES = "observation.images."


class ImitationSettings(RunSettings):
    """Settings of a training; None leaves a choice to the policy.

    Attributes:
        dataset: folder of the data set, or its id on the hub.
    """

    BLOCK = "imitation_config"
    SPREADS = True
    REQUIRED = ("dataset_name", "num_epochs", "learning_rate", "batch_size")

    dataset: str = ""
    dataset_name: str = "-"
    num_epochs: int = 1
    learning_rate: float = 1e-5
    batch_size: int = 8
    loss_function: str = ""
    policy_type: str = "act"
    pretrained: str = ""
    max_steps: int | None = None
    chunk_size: int | None = None
    actions_per_chunk: int | None = None
    cameras: tuple[str, ...] = ()
    image_width: int | None = None
    image_height: int | None = None
    validation_share: float = 0.1
    validation_steps: int = 500
    validation_batches: int = 50
    colour_jitter: float = 0.0
    shift_px: int = 0
    state_noise: float = 0.0
    accumulation_steps: int = 1
    device: str = "auto"
    precision: str = "float32"
    threads: int = 0
    workers: int = 2
    seed: int = 0
    checkpoint_steps: int = 1000
    report_steps: int = 50
    picture_cache_mb: int = 4096
    hidden_size: int | None = None
    feedforward_size: int | None = None
    encoder_layers: int | None = None
    pretrained_backbone: bool = False
    backbone_learning_rate: float | None = None
    weight_decay: float | None = None
    max_grad_norm: float | None = None
    lora_rank: int | None = None
    learning_rate_schedule: str = ""
    use_vae: bool | None = None
    processes: int = 1
    machines: int = 1
    machine_rank: int = 0
    main_address: str = ""
    robot_evaluation_steps: int = 1000
    robot_episodes: int = 5
    robot_wait_s: float = 600.0

    @classmethod
    def si_values(cls, values: Mapping[str, Any], node: Any, context: BlockContext) -> dict[str, Any]:
        """Take the fields of the block; a data set and a checkpoint are folders, or names on the hub."""
        known = super().si_values(values, node, context)
        folder = Path(context.folder)
        if known.get("pretrained") and (place := folder / Path(known["pretrained"]).expanduser()).exists():
            known["pretrained"] = str(place)
        name = str(known.get("dataset_name") or "")
        if "://" in name and not context.data_store.path:
            return known | {"dataset": name}
        place = folder / Path(name).expanduser()
        known["dataset"] = context.data_store.path or (str(place) if name and place.is_dir() else name)
        return known

    @property
    def ready_timeout_s(self) -> float:
        """Time to import PyTorch and LeRobot, and to fetch data set and checkpoint."""
        return 3600.0

    @property
    def is_on_robot(self) -> bool:
        """Whether a person marks episodes on the robot from time to time."""
        return self.environment == "ENV_REAL"

    @property
    def size(self) -> int:
        """Processes that learn together, on all machines."""
        return self.cluster_workers or 1 if self.cluster else self.processes * self.machines

    @property
    def loss(self) -> str:
        """Loss that the policy learns by."""
        return self.loss_function or LOSSES[self.policy_type][0]

    def halves(self, device: str) -> str:
        """Say what halves the memory of an update."""
        if self.batch_size > 1:
            half = self.batch_size // 2
            more = self.accumulation_steps * -(-self.batch_size // half)
            return (
                f"set batch_size: {half} and accumulation_steps: {more}, which needs half the memory and "
                "learns nearly the same"
            )
        if self.precision == "float32" and device != "cpu":
            return 'set precision: "bfloat16", which needs about half the memory'
        return "halve image_width and image_height, which needs a quarter for pictures, or hidden_size"

    @model_validator(mode="after")
    def _fits(self) -> Self:
        found = [
            *self._robot_problems(),
            *self._policy_problems(),
            *self._group_problems(),
            *self._dataset_problems(),
        ]
        if len(found) == 1:
            raise found[0]
        if found:
            raise FieldErrors(found)
        return self

    def _robot_problems(self) -> Iterator[FieldError]:
        """Yield what evaluations on the robot exclude, and what belongs to them alone."""
        for name in ("robot_evaluation_steps", "robot_episodes", "robot_wait_s"):
            if not self.is_on_robot and getattr(self, name) != type(self).model_fields[name].default:
                yield _error(
                    name,
                    f"{name} has no effect: it belongs to evaluations on the robot (ENV_REAL)",
                    remedy="remove it, or write environment: ENV_REAL in training",
                )
        if self.is_on_robot and self.processes * self.machines > 1:
            name = "processes" if self.processes > 1 else "machines"
            yield _error(
                name,
                "With ENV_REAL one process learns, because learning pauses while the robot is evaluated",
                remedy=f"remove {name}, or write environment: ENV_SIMULATION in training",
            )

    def _policy_problems(self) -> Iterator[FieldError]:
        policy = self.policy_type
        if self.loss_function and self.loss_function not in LOSSES[policy]:
            own = LOSSES[policy][0]
            yield _error(
                "loss_function",
                f"The policy {policy} cannot learn by {self.loss_function}: {_FIXED[policy]}",
                allowed=(f'"{own}"',),
                remedy=f'write loss_function: "{own}", or remove it',
            )
        for name, policies in _ONLY.items():
            value = getattr(self, name)
            if policy not in policies and value != type(self).model_fields[name].default:
                yield _error(
                    name,
                    f"{name} has no effect with the policy {policy}: it belongs to {' and '.join(policies)}",
                    remedy="remove it, or choose another policy_type",
                )
        if policy == "smolvla" and not self.pretrained:
            yield _error(
                "policy_type",
                "SmolVLA is fine-tuned: it requires a checkpoint to start from",
                remedy='add pretrained: "lerobot/smolvla_base", or the folder of a checkpoint',
            )
        if self.pretrained and self.pretrained_backbone:
            yield _error(
                "pretrained_backbone",
                "pretrained_backbone has no effect with pretrained: the checkpoint has the weights of its "
                "image network",
                remedy="remove pretrained_backbone, or remove pretrained",
            )
        if policy == "diffusion" and self.chunk_size is not None and self.chunk_size % 8:
            near = max(8, 8 * round(self.chunk_size / 8))
            yield _error(
                "chunk_size",
                f"The network of diffusion halves its chunk three times, so {self.chunk_size} does not fit",
                allowed=(str(near),),
                remedy=f"write chunk_size: {near}",
            )
        if self.hidden_size is not None and self.hidden_size % 8:
            near = max(16, 8 * round(self.hidden_size / 8))
            yield _error(
                "hidden_size",
                f"The layers of {policy} have 8 parts, so a width of {self.hidden_size} does not fit",
                allowed=(str(near),),
                remedy=f"write hidden_size: {near}",
            )
        if policy == "diffusion":
            if not self.pretrained:
                yield from self.executed_problems({})
        elif self.actions_per_chunk and self.chunk_size and self.actions_per_chunk > self.chunk_size:
            yield _error(
                "actions_per_chunk",
                f"A chunk has {self.chunk_size} actions, so {self.actions_per_chunk} cannot be executed",
                remedy="make it smaller, or raise chunk_size",
            )
        if (self.image_width is None) != (self.image_height is None):
            missing = "image_height" if self.image_height is None else "image_width"
            other = "image_width" if missing == "image_height" else "image_height"
            yield _error(
                other,
                f"{other} is set without {missing}, so the size of a picture is not known",
                remedy=f"add {missing}, or remove {other}",
            )
        if self.precision == "float16" and self.device in ("cpu", "mps"):
            yield _error(
                "precision",
                f"float16 requires cuda, but the device is {self.device}",
                allowed=('"bfloat16"', '"float32"'),
                remedy='write precision: "bfloat16" or "float32"',
            )

    def diffusion_window(self, config: Mapping[str, Any]) -> tuple[int, int]:
        """Return the actions of a chunk of Diffusion, and the observations that it begins with.

        Args:
            config: of the checkpoint to start from; what is not there is LeRobot's default.
        """
        return self.chunk_size or int(config.get("horizon", 16)), int(config.get("n_obs_steps", 2))

    def executed_problems(self, config: Mapping[str, Any]) -> Iterator[FieldError]:
        """Yield that Diffusion cannot execute so many actions of a chunk. For ``config``, see above."""
        chunk, past = self.diffusion_window(config)
        most = chunk - past + 1
        if self.policy_type == "diffusion" and (self.actions_per_chunk or 0) > most:
            yield _error(
                "actions_per_chunk",
                f"A chunk of diffusion begins at the first of its {past} observations, so at most {most} of "
                f"{chunk} actions are still to be executed, and {self.actions_per_chunk} are not",
                allowed=(f"1 to {most}",),
                remedy=f"write actions_per_chunk: {most}, or raise chunk_size",
            )

    def _group_problems(self) -> Iterator[FieldError]:
        """Yield what several processes and machines lack."""
        if self.cluster:
            yield from self._cluster_problems()
            return
        if self.processes > 1 and self.device == "mps":
            yield _error(
                "processes",
                f"mps is one device, so {self.processes} processes cannot have one each",
                remedy="remove processes",
            )
        host, _, port = self.main_address.rpartition(":")
        if self.main_address and not (host and port.isdecimal() and 0 < int(port) < 65536):
            yield _error(
                "main_address",
                f'"{self.main_address}" is not a host and a port',
                remedy='write both, as in main_address: "192.168.1.10:29500"',
            )
        if self.machines > 1 and not self.main_address:
            yield _error(
                "machines",
                f"{self.machines} machines have no address where they meet",
                remedy='add the address of machine 0: main_address: "192.168.1.10:29500"',
            )
        if self.machine_rank >= self.machines:
            yield _error(
                "machine_rank",
                f"Machines are counted from 0, so {self.machines} of them have no number {self.machine_rank}",
                allowed=tuple(map(str, range(min(self.machines, 8)))),
                remedy="correct it, or raise machines",
            )

    def _cluster_problems(self) -> Iterator[FieldError]:
        """Yield what does not go together with a cluster, whose workers are the processes."""
        if self.cluster_workers is None:
            yield FieldError(
                "cluster",
                "Each worker adds its batch to every update, so the result depends on the number of workers",
                remedy="add workers to cluster, for example workers: 2",
            )
        for name in ("processes", "machines", "machine_rank", "main_address"):
            if getattr(self, name) != type(self).model_fields[name].default:
                yield _error(
                    name,
                    f"{name} has no effect with a cluster: its workers are the processes, which Ray connects",
                    remedy=f"remove {name}, and write the number of processes as workers in cluster",
                )
        if self.device == "mps":
            yield _error(
                "device",
                "The workers of a cluster learn on cpu or cuda, because PyTorch connects no others",
                allowed=('"cpu"', '"cuda"', '"auto"'),
                remedy='write device: "cpu"',
            )

    def _dataset_problems(self) -> Iterator[FieldError]:
        """Yield what is wrong with an address, or lacks in the description of a local data set."""
        if "://" in self.dataset:
            from joshua_dataset.cloud.address import Address, AddressError

            try:
                Address.parse(self.dataset)
            except AddressError as error:
                yield _error("dataset_name", str(error), allowed=error.allowed, remedy=error.remedy)
            return
        if not (Path(self.dataset) / "meta").is_dir():
            return  # the checks of the file report it, or it is fetched
        path = Path(self.dataset) / "meta" / "info.json"
        try:
            info = parse_json(path.read_text(encoding="utf-8"))
            features = dict(info["features"])
            version = str(info["codebase_version"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            yield _error(
                "dataset_name",
                f"{path} does not describe a data set: {type(error).__name__}: {error}",
                remedy=f"run `joshua dataset check {self.dataset}`",
            )
            return
        if version != "v3.0" or info.get("joshua", {}).get("format", "lerobot") != "lerobot":
            yield _error(
                "dataset_name",
                f"{self.dataset} has the layout {_layout(info, version)}, but training reads v3.0 of LeRobot",
                remedy=f"run `joshua dataset convert {self.dataset} TARGET`, and name TARGET",
            )
            return
        features, _ = joined_features(features)
        lacks = [key for key in ("action", "observation.state") if key not in features]
        known = tuple(key.removeprefix(_PICTURES) for key in features if key.startswith(_PICTURES))
        if not known and self.policy_type in ("act", "diffusion", "smolvla"):
            lacks.append(f"{_PICTURES}NAME (a camera)")
        if lacks:
            yield _error(
                "dataset_name",
                f"{self.dataset} has no {' and no '.join(lacks)}, which {self.policy_type} requires; it has "
                f"{', '.join(features)}",
                remedy="record an arm and a camera, or name another data set",
            )
        for camera in self.cameras:
            if camera not in known:
                yield _error(
                    "cameras",
                    f"{self.dataset} has no pictures of a camera {camera!r}",
                    allowed=tuple(f'"{name}"' for name in known),
                    remedy="name cameras of the data set",
                )
        yield from self._picture_problems(features, known)
        yield from self._start_problems(features)

    def _picture_problems(self, features: Mapping[str, Any], known: Sequence[str]) -> Iterator[FieldError]:
        """Yield that pictures would be distorted."""
        if self.image_width is None or self.image_height is None:
            return
        recorded = {}
        for name in (name for name in known if not self.cameras or name in self.cameras):
            try:
                shape = FeatureSet.from_lerobot({name: features[_PICTURES + name]})[name].shape
            except (KeyError, TypeError, ValueError, AttributeError):
                continue  # reading the data set reports it
            recorded[name] = shape[0], shape[1]
        if (problem := distortion(recorded, (self.image_height, self.image_width))) is not None:
            yield problem

    def _start_problems(self, features: Mapping[str, Any]) -> Iterator[FieldError]:
        """Yield what is wrong with the checkpoint to start from, if it is on this machine."""
        if not self.pretrained:
            return
        folder = Path(self.pretrained)
        found = folder if folder.is_dir() else cached(self.pretrained)
        try:
            if found is not None:
                start = read_start(found, self.policy_type, self.dataset, features)
                yield from self.executed_problems(start.config)
        except CheckpointError as error:
            yield _error("pretrained", error.message, remedy=error.remedy)


def _layout(info: Mapping[str, Any], version: str) -> str:
    kind = info.get("joshua", {}).get("format", "lerobot")
    return f"{version} of LeRobot" if kind == "lerobot" else str(kind)


def _error(field: str, message: str, *, allowed: tuple[str, ...] = (), remedy: str = "") -> FieldError:
    return FieldError(f"imitation_config.{field}", message, allowed=allowed, remedy=remedy)
