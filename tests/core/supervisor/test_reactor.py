"""The event loop."""

from __future__ import annotations

import os
import signal
import threading
from functools import partial

import pytest
from joshua.supervisor.reactor import ECHO_S, Reactor, StopSignals


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


def test_an_order_that_is_delivered_twice_is_one_order_and_a_later_one_another():
    clock, heard = Clock(), []
    reactor = Reactor(clock)
    signals = StopSignals(reactor, heard.append)
    signals.install()
    try:
        for number in (signal.SIGTERM, signal.SIGTERM, signal.SIGHUP):  # as `timeout` and a terminal do it
            os.kill(os.getpid(), number)
        reactor.turn()
        assert heard == [signal.SIGTERM]
        clock.now_s += 2 * ECHO_S
        os.kill(os.getpid(), signal.SIGINT)
        reactor.turn()
        assert heard == [signal.SIGTERM, signal.SIGINT]
    finally:
        signals.close()
        reactor.close()


def test_another_thread_wakes_the_loop():
    reactor, ran = Reactor(), []
    thread = threading.Thread(target=lambda: reactor.post(lambda: ran.append(threading.get_ident())))
    thread.start()
    while not ran:
        reactor.turn()
    thread.join()
    assert ran == [threading.get_ident()]
    reactor.close()
    reactor.close()
