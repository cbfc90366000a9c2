"""Time limits for cameras that deliver no pictures."""

from __future__ import annotations

#: Time without a picture after which a camera counts as disconnected; longer for slow cameras.
STALL_S = 2.0
_STALL_PERIODS = 5.0

#: Time from opening to the first picture. A reopened camera is warm, and the thread that reopens it must send
#: heartbeats.
FIRST_PICTURE_S = 8.0
NEXT_FIRST_PICTURE_S = 3.5


def stall_limit_s(fps: float) -> float:
    """Return the time without a picture after which a camera of this rate counts as disconnected."""
    return max(STALL_S, _STALL_PERIODS / fps)
