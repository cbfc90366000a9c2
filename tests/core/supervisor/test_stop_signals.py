"""Signals as events of the loop."""

from __future__ import annotations

import os
import signal

from joshua.supervisor.reactor import Reactor
from joshua.supervisor.stop_signals import ECHO_S, StopSignals


class Clock:
    now_s = 10.0

    def __call__(self):
        return self.now_s


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
