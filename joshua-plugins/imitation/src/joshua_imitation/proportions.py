"""Whether pictures keep their proportions at the size of the policy's input.

A robot's camera and a simulation make pictures of that size without distortion, so a policy must not learn
from distorted ones.
"""

from __future__ import annotations

from collections.abc import Mapping

from joshua.api import FieldError

#: Largest difference of the ratio of width to height, which rounding to whole pixels causes.
TOLERANCE = 0.02

#: Sizes that ``imitation_config`` allows, in pixels.
_LEAST, _MOST = 16, 2048


def distortion(recorded: Mapping[str, tuple[int, int]], size: tuple[int, int]) -> FieldError | None:
    """Return what is wrong with a size that distorts pictures; None if it distorts none.

    Args:
        recorded: (height, width) of each camera by name; size: (height, width) to learn from.
    """
    height, width = size
    distorted = {name: is_ for name, is_ in recorded.items() if _differs(width, height, is_[1] / is_[0])}
    if not distorted:
        return None
    name, (own_height, own_width) = next(iter(distorted.items()))
    ratio = own_width / own_height
    fitting = sorted({*_near_heights(height, ratio), *_near_widths(width, ratio)})
    if not fitting or any(_differs(*fitting[0], other[1] / other[0]) for other in recorded.values()):
        remedy = "remove image_width and image_height, or name cameras of the same proportions in cameras"
        fitting = []
    else:
        remedy = " or ".join(f"image_width: {wide} image_height: {high}" for wide, high in fitting)
        remedy = f"write {remedy}, or remove both"
    return FieldError(
        "imitation_config.image_width",
        f"Pictures of {name} are {own_width} × {own_height}, and {width} × {height} would distort them: the "
        "robot's camera and a simulation make no such pictures",
        allowed=tuple(f"{wide} × {high}" for wide, high in fitting),
        remedy=remedy,
    )


def _differs(width: int, height: int, ratio: float) -> bool:
    return abs(width / height / ratio - 1) > TOLERANCE


def _near_widths(wanted: int, ratio: float) -> list[tuple[int, int]]:
    """Return the size, width first, whose width is nearest to a wanted one; empty if none is allowed."""
    near = sorted(range(_LEAST, _MOST + 1), key=lambda width: abs(width - wanted))
    sizes = ((width, round(width / ratio)) for width in near)
    return [size for size in sizes if _LEAST <= size[1] <= _MOST and not _differs(*size, ratio)][:1]


def _near_heights(wanted: int, ratio: float) -> list[tuple[int, int]]:
    """Return the size, width first, whose height is nearest to a wanted one; empty if none is allowed."""
    return [(width, height) for height, width in _near_widths(wanted, 1 / ratio)]
