"""The event loop."""

from __future__ import annotations

import os
from functools import partial

import pytest
from joshua.supervisor.reactor import Reactor


class Clock:
    now_s = 10.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def pipe():
    reading, writing = os.pipe()
    yield reading, writing
    os.close(reading)
    os.close(writing)


def test_timers_run_in_order_and_a_cancelled_one_does_not():
    clock, ran = Clock(), []
    reactor = Reactor(clock)
    reactor.call_later(0.0, lambda: ran.append("first"))
    cancelled = reactor.call_later(0.0, lambda: ran.append("never"))
    reactor.call_later(-5.0, lambda: ran.append("second"))
    cancelled.cancel()
    reactor.turn()
    assert ran == ["second", "first"] or ran == ["first", "second"]
    reactor.close()


def test_a_timer_set_by_a_timer_waits_for_the_next_turn():
    ran = []
    reactor = Reactor()

    def again():
        ran.append(1)
        reactor.call_later(0.0, again)

    again()
    reactor.turn()
    assert len(ran) == 2
    reactor.close()


def test_a_timer_that_raises_takes_no_other_along():
    ran = []
    reactor = Reactor()
    reactor.call_later(0.0, lambda: ran.append("before"))
    reactor.call_later(0.0, lambda: 1 / 0)  # type: ignore[arg-type]
    for name in ("ladder", "last"):
        reactor.call_later(0.0, partial(ran.append, name))
    with pytest.raises(ZeroDivisionError):
        reactor.turn()
    reactor.turn()
    assert ran == ["before", "ladder", "last"]
    reactor.close()


def test_descriptors_are_heard_before_timers_judge(pipe):
    order: list[bytes | str] = []
    reactor = Reactor()
    reactor.watch(pipe[0], lambda: order.append(os.read(pipe[0], 1)))
    reactor.call_later(0.0, lambda: order.append("timer"))
    os.write(pipe[1], b"x")
    reactor.turn()
    assert order == [b"x", "timer"]
    reactor.close()


def test_a_descriptor_forgotten_in_the_same_turn_is_not_called(pipe):
    other = os.pipe()
    called = []
    reactor = Reactor()

    def call(mine: int, theirs: int) -> None:
        called.append(mine)
        reactor.forget(theirs)

    for mine, theirs in ((pipe[0], other[0]), (other[0], pipe[0])):
        reactor.watch(mine, partial(call, mine, theirs))
    os.write(pipe[1], b"x")
    os.write(other[1], b"x")
    reactor.turn()
    assert len(called) == 1
    reactor.forget(12345)
    reactor.close()
    for descriptor in other:
        os.close(descriptor)


def test_writable_descriptors_are_told(pipe):
    told = []
    reactor = Reactor()
    reactor.watch(pipe[1], lambda: told.append("readable"), lambda: told.append("writable"))
    reactor.turn()
    assert told == ["writable"]
    reactor.close()
