"""Settings of the toy policy."""

from __future__ import annotations

from joshua.api import FieldError
from joshua.api.models import ModelNeeds, ModelSettings
from joshua.features import Feature


class ToySettings(ModelSettings):
    """Settings of the toy policy.

    Attributes:
        work: ``sleep``, or ``compute`` on every core; latency_s: of a chunk; chunk_steps: its length.
        fault: of the third chunk: ``nan``, ``die``, ``hang`` or ``shape``; ``refused`` and ``loading``
            come before the start; ``restart`` begins the wave anew in each chunk.
        camera: that it needs, "" for none; reads_task: it does nothing without a task.
        joints: names in its state and action, separated by spaces; "" for those of the robot.
    """

    work: str
    latency_s: float
    chunk_steps: int
    fault: str
    camera: str
    reads_task: bool
    joints: str

    def needs(self) -> ModelNeeds:
        """The state, and a camera."""
        if self.fault == "refused":
            raise FieldError("fault", "The checkpoint is a pickle", remedy="Convert it")
        names = tuple(self.joints.split())
        state = Feature("observation.state", "float32", (len(names),), names)
        cameras = (Feature.picture(f"observation.images.{self.camera}", 0, 0),) if self.camera else ()
        return ModelNeeds(
            features=(state, *cameras),
            action=Feature.joints("action", names) if names else None,
            reads_state=True,
            reads_task=self.reads_task,
            source="toy",
        )
