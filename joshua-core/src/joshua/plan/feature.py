"""An observation or action of a robot, in the terms of data sets, models and environments."""

from __future__ import annotations

from dataclasses import dataclass

STATE = "observation.state"
ACTION = "action"
IMAGES = "observation.images."
INTERVENTION = "intervention"


@dataclass(frozen=True)
class Feature:
    """A part of a frame.

    Attributes:
        key: LeRobot's name, such as ``observation.state``, ``observation.images.top`` or ``action``.
        dtype: numpy's name of the type of its values: ``float32`` for numbers, ``uint8`` for pictures.
        shape: of one value; pictures are (H, W, 3), RGB. 0 is a length that only the device knows.
        names: of the numbers, such as joints; () if they have none.
        unit: of the numbers, such as ``rad``; "" for none.
        topic: that publishes it; "" for none.
    """

    key: str
    dtype: str
    shape: tuple[int, ...]
    names: tuple[str, ...] = ()
    unit: str = ""
    topic: str = ""

    @property
    def is_picture(self) -> bool:
        """Whether a value is a picture, (H, W, 3)."""
        return self.dtype == "uint8" and len(self.shape) == 3

    @classmethod
    def joints(cls, key: str, names: tuple[str, ...], *, unit: str = "rad", topic: str = "") -> Feature:
        """Return a feature of joint positions, one number per joint."""
        return cls(key, "float32", (len(names),), names, unit, topic)

    @classmethod
    def picture(cls, key: str, height: int, width: int, *, topic: str = "") -> Feature:
        """Return a feature of pictures, with sizes in pixels."""
        return cls(key, "uint8", (height, width, 3), ("height", "width", "channels"), topic=topic)
