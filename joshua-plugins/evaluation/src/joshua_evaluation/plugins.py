"""Model plugin that runs a checkpoint, and the settings that it makes from its block."""

from __future__ import annotations

from typing import Any

from google.protobuf import descriptor_pool, message_factory
from joshua.api import BlockContext, FieldError, FieldErrors, ModelSpec
from joshua.api.models import Compute, ModelContext, ModelSettings
from joshua.tools import TargetError, load_registry, load_target
from pydantic import BaseModel, ConfigDict, ValidationError

from joshua_evaluation.checkpoints import CheckpointError


class ModelOffer(BaseModel):
    """A model plugin with the settings for a checkpoint.

    Attributes:
        block: its message; implementation, settings_type: import strings; settings: as JSON.
        reads_task: whether it requires a task.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    block: str
    implementation: str
    settings_type: str = ""
    settings: dict[str, Any] = {}
    reads_task: bool = False

    def made_settings(self) -> Any:
        """Return the settings object for the model."""
        if not self.settings_type:
            return self.settings
        return load_target(self.settings_type).model_validate(self.settings)


def model_offer(block: str, content: bytes, path: str, task: str, compute: Compute) -> ModelOffer:
    """Find the plugin of a block and let it check the checkpoint, as the planner does for an inference.

    Args:
        block: full name of its message; content: of the block in the file, serialised; path: of the weights.

    Raises:
        CheckpointError: it is not installed, or broken. FieldError: it refuses the checkpoint or its block.
    """
    registry = load_registry()
    spec = registry.find(ModelSpec, block, "MODEL_PLUGIN")
    if spec is None:
        name = {"joshua.LeRobotPolicy": "joshua-lerobot", "joshua.OnnxPolicy": "joshua-onnx"}.get(block, "")
        needs = f"requires the plugin {name}" if name else f"requires the plugin that runs {block}"
        remedy = f"Install it: ./run --with {name.removeprefix('joshua-')}" if name else "Install it"
        raise CheckpointError(f"The checkpoint {path} {needs}, which is not installed", remedy)
    settings: Any = None
    try:
        if spec.settings:
            if spec.message_module:
                load_target(f"{spec.message_module}:DESCRIPTOR")
            descriptor = descriptor_pool.Default().FindMessageTypeByName(block)
            message = message_factory.GetMessageClass(descriptor)()
            message.ParseFromString(content)
            context = BlockContext(model=ModelContext(weights=path, task=task, compute=compute))
            settings = load_target(spec.settings).from_block(message, None, context)
    except (TargetError, KeyError) as error:
        raise CheckpointError(f"The plugin that runs {block} is broken: {error}", "Reinstall it") from error
    except ValidationError as error:
        raise _first(error) from error
    reads_task = isinstance(settings, ModelSettings) and settings.needs().reads_task
    return ModelOffer(
        block=block,
        implementation=spec.implementation,
        settings_type=spec.settings,
        settings={} if settings is None else settings.model_dump(mode="json"),
        reads_task=reads_task,
    )


def _first(error: ValidationError) -> FieldError:
    """Return the first error in the settings of a model."""
    detail = error.errors(include_url=False)[0]
    found = detail.get("ctx", {}).get("error")
    if isinstance(found, FieldErrors):
        return found.errors[0]
    if isinstance(found, FieldError):
        return found
    return FieldError("", str(detail["msg"]), remedy="Change the block plugin_config")
