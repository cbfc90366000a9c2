"""Time limits for cameras without pictures."""

from __future__ import annotations

#: Time without a picture after which a camera counts as lost; slow cameras get more.
STALL_S = 2.0
_STALL_PERIODS = 5.0

#: Time from the opening to the first picture. A camera that ran before is warm, and the thread that opens it
#: again must send heartbeats.
FIRST_PICTURE_S = 8.0
NEXT_FIRST_PICTURE_S = 3.5


def stall_limit_s(fps: float) -> float:
    """Time without a picture after which a camera of this rate counts as lost."""
    return max(STALL_S, _STALL_PERIODS / fps)
