"""One thing that a robot shows or does, described as data sets, models and environments describe it."""

from __future__ import annotations

from dataclasses import dataclass

STATE = "observation.state"
ACTION = "action"
IMAGES = "observation.images."
INTERVENTION = "intervention"


@dataclass(frozen=True)
class Feature:
    """One part of a frame.

    Attributes:
        key: LeRobot's name, such as ``observation.state``, ``observation.images.top`` or ``action``.
        dtype: numpy's name of the type of its values: ``float32`` for numbers, ``uint8`` for pictures.
        shape: of one value; pictures are (H, W, 3), RGB. 0 stands for a length that only the device knows.
        names: of the numbers, such as joints; () where they have none.
        unit: of the numbers, such as ``rad``; "" for none.
        topic: that carries it; "" where no topic does.
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
        """Positions of joints, one number for each."""
        return cls(key, "float32", (len(names),), names, unit, topic)

    @classmethod
    def picture(cls, key: str, height: int, width: int, *, topic: str = "") -> Feature:
        """A picture; sizes in pixels."""
        return cls(key, "uint8", (height, width, 3), ("height", "width", "channels"), topic=topic)
