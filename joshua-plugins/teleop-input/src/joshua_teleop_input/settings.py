"""Settings of gamepads and the keyboard."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from google.protobuf.message import Message
from joshua.api import BlockContext, BlockSettings, FieldError, FieldErrors
from joshua.api.schema import TYPE_NAMES
from joshua.tools import nearest_first
from pydantic import BaseModel, ConfigDict, model_validator
from typing_extensions import Self

from joshua_teleop_input.codes import AXES, BUTTONS
from joshua_teleop_input.keys import HELP_KEY, NAMED_KEYS, canonical_key
from joshua_teleop_input.layout import STANDARD_NAMES, STICKS

JOINT_STATE = "sensor_msgs/msg/JointState"


class ControlSettings(BaseModel):
    """Mapping of an axis, button or key, or a pair of them, to a joint.

    Attributes:
        positive, negative: names; "" for no negative one.
        joint: name of the joint; speed_rad_s: at full deflection, negative for the other direction.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    positive: str
    negative: str = ""
    joint: str
    speed_rad_s: float


class MappingSettings(BaseModel):
    """Mapping of an axis or button: JOSHUA's name and the kernel's name."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    source: str
    inverted: bool = False


class InputSettings(BlockSettings):
    """Settings common to gamepads and the keyboard.

    Attributes:
        joints: joints that receive the node's commands; () if not known yet.
        drives: the node publishes commands; hears_state: it subscribes to a joint state.
    """

    controls: tuple[ControlSettings, ...] = ()
    joints: tuple[str, ...] = ()
    drives: bool = False
    hears_state: bool = False

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Add the node's publishers and subscriptions, and the joints that it commands."""
        return super().si_values(values, node, context) | {
            "joints": tuple(joint.name for joint in context.joints),
            "drives": JOINT_STATE in _types(getattr(node, "publishers", ())),
            "hears_state": JOINT_STATE in _types(getattr(node, "subscriptions", ())),
        }

    @model_validator(mode="after")
    def _check(self) -> Self:
        found = list(self.problems())
        if found:
            raise FieldErrors(found)
        return self

    def problems(self) -> Iterator[FieldError]:
        """Check for joints that the actuator does not have, and commands without a joint state."""
        if self.drives and self.controls and not self.hears_state:
            yield FieldError(
                "controls",
                "the node moves joints from their present position, but it does not subscribe to their state",
                remedy="add subscriptions { data_type: JOINT_STATE topic_name: … } with the topic that the "
                "actuator publishes its state on",
            )
        for index, control in enumerate(self.controls):
            if self.joints and control.joint not in self.joints:
                yield FieldError(
                    f"controls[{index}].joint",
                    f"the actuator has no joint named {control.joint!r}",
                    allowed=nearest_first(control.joint, self.joints),
                    remedy="write the joint's name as the actuator publishes it",
                )


class GamepadSettings(InputSettings):
    """Settings of a gamepad.

    Attributes:
        device: path, or part of a name; "" takes the first gamepad.
        dead_zone: share of an axis around its centre that counts as centred; expo: 0 for a linear response.
        dead_man_button: must be held; enable_button: toggles driving; "" for none.
        release_button: returns control after an override; "" for none.
        mapping: axes and buttons that differ from the layout of the kernel's drivers.
    """

    device: str
    dead_zone: float
    expo: float
    dead_man_button: str
    enable_button: str
    release_button: str
    mapping: tuple[MappingSettings, ...] = ()

    def problems(self) -> Iterator[FieldError]:
        """Check for unknown or duplicate names, and everything common to input devices."""
        for index, entry in enumerate(self.mapping):
            yield from self._mapping_problems(index, entry)
        names = (*STANDARD_NAMES, *(entry.name for entry in self.mapping))
        for index, control in enumerate(self.controls):
            for field, name in (("positive", control.positive), ("negative", control.negative)):
                yield from _unknown(f"controls[{index}].{field}", name, names, "axis or button")
        buttons = [name for name in names if name not in STICKS]
        yield from _unknown("dead_man_button", self.dead_man_button, buttons, "button")
        yield from _unknown("enable_button", self.enable_button, buttons, "button")
        yield from _unknown("release_button", self.release_button, buttons, "button")
        used: dict[str, str] = {}
        for field in ("dead_man_button", "enable_button", "release_button"):
            if (name := getattr(self, field)) and used.setdefault(name, field) != field:
                yield FieldError(
                    field,
                    f"the button {name} is also {used[name]}",
                    remedy="name another button, or remove one of the two fields",
                )
        yield from super().problems()

    def _mapping_problems(self, index: int, entry: MappingSettings) -> Iterator[FieldError]:
        if entry.source not in AXES and entry.source not in BUTTONS:
            yield FieldError(
                f"mapping[{index}].source",
                f"the kernel has no axis or button of a gamepad named {entry.source!r}",
                allowed=nearest_first(entry.source, (*AXES, *BUTTONS))[:12],
                remedy="joshua find-gamepads --watch shows the name of what you press",
            )
        if [other.name for other in self.mapping].index(entry.name) != index:
            yield FieldError(
                f"mapping[{index}].name",
                f"the name {entry.name} is mapped twice",
                remedy="remove one of the entries",
            )


class KeyboardSettings(InputSettings):
    """Settings of the keyboard.

    Attributes:
        key_hold_s: time without auto-repeat after which a key counts as released, in terminals that do not
            report releases.
        enable_key: toggles driving; "" for none.
        release_key: returns control after an override; "" for none.
    """

    key_hold_s: float
    enable_key: str
    release_key: str

    def problems(self) -> Iterator[FieldError]:
        """Check for invalid or duplicate keys, and everything common to input devices."""
        used: dict[str, str] = {}
        for field, name in self._keys():
            key = canonical_key(name)
            if key is None:
                yield FieldError(
                    field,
                    f"{name!r} is not a key",
                    allowed=("a single character", *nearest_first(name, NAMED_KEYS)),
                    remedy="write one character, or the name of a key",
                )
            elif key == HELP_KEY:
                remedy = "use another key"
                yield FieldError(field, f"{HELP_KEY} shows the help and cannot drive", remedy=remedy)
            elif key in used:
                remedy = "use another key for one of them"
                yield FieldError(field, f"the key {name} is already used in {used[key]}", remedy=remedy)
            else:
                used[key] = field
        yield from super().problems()

    def _keys(self) -> list[tuple[str, str]]:
        keys = [
            (f"controls[{index}].{field}", name)
            for index, control in enumerate(self.controls)
            for field, name in (("positive", control.positive), ("negative", control.negative))
            if name
        ]
        others = (("enable_key", self.enable_key), ("release_key", self.release_key))
        return [*keys, *((field, name) for field, name in others if name)]


def _unknown(field: str, name: str, allowed: Sequence[str], what: str) -> Iterator[FieldError]:
    if name and name not in allowed:
        yield FieldError(
            field,
            f"a gamepad has no {what} named {name!r}",
            allowed=nearest_first(name, allowed),
            remedy="joshua find-gamepads --watch shows the name of what you press; mapping adds names",
        )


def _types(endpoints: Any) -> set[str]:
    return {TYPE_NAMES.get(endpoint.data_type, "") for endpoint in endpoints}
