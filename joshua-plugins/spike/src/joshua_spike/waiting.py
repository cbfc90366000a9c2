"""Waits with a limit that leaves out time in which this process stood still."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from typing import TypeVar

from joshua.api.patience import AwakeClock

T = TypeVar("T")

LOOK_S = 0.1  # interval at which the clock is read


async def wait_awake(awaitable: Awaitable[T], timeout_s: float) -> T:
    """Wait for a result, as ``asyncio.wait_for`` does, for a time that counts only while this process runs.

    Args:
        awaitable: cancelled at the limit, and when the caller is cancelled.
        timeout_s: of awake time.

    Raises:
        asyncio.TimeoutError: there is no result yet.
    """
    task = asyncio.ensure_future(awaitable)
    clock = AwakeClock()
    try:
        while not task.done():
            left_s = timeout_s - clock.now_s()
            if left_s <= 0:
                raise asyncio.TimeoutError
            await asyncio.wait({task}, timeout=min(left_s, LOOK_S))
        return task.result()
    finally:
        if not task.done():
            task.cancel()
            await asyncio.wait({task})
