"""A child process as the supervisor sees it."""

from __future__ import annotations

import contextlib
import signal

from joshua.supervisor.child import Child, ChildEvent
from joshua.supervisor.fork_server import ForkServer
from joshua.supervisor.launcher import Launcher
from joshua.supervisor.reactor import Reactor


def test_a_signal_reaches_a_child_whose_id_is_not_known_yet(fork_server_shared: ForkServer) -> None:
    events: list[ChildEvent] = []
    lost: list[str] = []
    with contextlib.ExitStack() as stack:
        reactor = Reactor()
        stack.callback(reactor.close)
        launcher = Launcher(reactor, fork_server_shared, lost.append)
        stack.callback(launcher.close)
        child = Child(reactor, launcher, "early", (), "", events.append)
        assert not child.process_id
        child.signal(signal.SIGKILL)
        while not child.ended:
            reactor.turn()
    assert [getattr(event, "event", "") for event in events][-1] == "exited"
    assert lost == []
