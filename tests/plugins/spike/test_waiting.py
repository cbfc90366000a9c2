"""Waits for the hub on a machine that stands still."""

from __future__ import annotations

import asyncio
import time

import pytest
from joshua_spike.waiting import wait_awake

STALL_S = 1.0


def test_a_stall_of_this_process_does_not_use_up_a_wait() -> None:
    async def answered_after_a_stall() -> str:
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[str] = loop.create_future()
        loop.call_soon(time.sleep, STALL_S)  # nothing on this loop runs meanwhile
        loop.call_later(STALL_S + 0.05, answer.set_result, "S")
        return await wait_awake(answer, STALL_S / 2)

    assert asyncio.run(answered_after_a_stall()) == "S"


def test_a_wait_ends_at_its_limit_and_cancels_what_it_waited_for() -> None:
    async def silent() -> asyncio.Future[str]:
        answer: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        with pytest.raises(asyncio.TimeoutError):
            await wait_awake(answer, 0.05)
        return answer

    assert asyncio.run(silent()).cancelled()


def test_what_a_wait_is_for_raises_through_it() -> None:
    async def broken() -> str:
        raise OSError("the adapter is gone")

    with pytest.raises(OSError, match="the adapter is gone"):
        asyncio.run(wait_awake(broken(), 5.0))
