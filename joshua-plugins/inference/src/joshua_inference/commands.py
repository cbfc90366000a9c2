"""The commands of a model: one message for its arm, or for each of several arms on a topic of its own."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

from joshua.api import FloatArray
from joshua.api.nodes import MessagePublisher, ModelArm, Outputs
from joshua.messages.make import joint_state


class _Output(NamedTuple):
    """A topic, the joints that its messages name, and their columns in an action."""

    outputs: Outputs
    names: tuple[str, ...]
    columns: list[int]


class Commands:
    """Publishes actions.

    Args:
        publishers: of the node; rate_hz: of the actions; arms: of the plan, () for one.
    """

    def __init__(
        self, publishers: Sequence[MessagePublisher] = (), rate_hz: float = 0.0, arms: Sequence[ModelArm] = ()
    ) -> None:
        self._publishers = [(item.topic.name, Outputs((item,), rate_hz)) for item in publishers]
        self._arms = arms
        self._outputs: list[_Output] = []

    def use(self, joints: Sequence[str]) -> None:
        """Take the names of the model's joints, in its order."""
        self._outputs = []
        for topic, outputs in self._publishers:
            arms = [arm for arm in self._arms if arm.commands == topic]
            named = [pair for arm in arms for pair in zip(arm.joints, arm.names, strict=True)]
            named = named or [(name, name) for name in joints]
            names, columns = tuple(own for own, _ in named), [joints.index(name) for _, name in named]
            self._outputs.append(_Output(outputs, names, columns))

    def publish(self, action: FloatArray, now_ns: int, frame_id: str) -> None:
        """Publish an action of shape (N,) in radians."""
        for outputs, names, columns in self._outputs:
            message = joint_state(names, action[columns], frame_id=frame_id, at_ns=now_ns)
            outputs.publish(now_ns, partial(_of_type, message))

    def checks(self) -> list[tuple[str, bool, str]]:
        """Return the rows of MODE_TEST about their rates."""
        return [row for _, outputs in self._publishers for row in outputs.checks()]


def _of_type(message: Any, type_name: str) -> Any:
    del type_name  # every publisher of a model has the type of joint states
    return message
