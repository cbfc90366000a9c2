"""The checks of the machine, one group of files each; all read below the root of a ``Host``."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from joshua.cli.doctor.checks import (
    brltty,
    latency_timer,
    modem_manager,
    permissions,
    plugins,
    realtime,
    shared_memory,
    usb,
)
from joshua.cli.doctor.finding import Finding
from joshua.cli.doctor.host import Host

Check = Callable[[Host], Iterator[Finding]]

CHECKS: tuple[Check, ...] = (
    plugins.check,
    permissions.check,
    latency_timer.check,
    brltty.check,
    modem_manager.check,
    usb.check,
    realtime.check,
    shared_memory.check,
)
