"""The checks of every machine; all read below the root of a ``Host``. Plugins add theirs."""

from __future__ import annotations

from joshua.cli.doctor.checks import plugins, realtime, shared_memory
from joshua.cli.doctor.parts import Check

CHECKS: tuple[Check, ...] = (plugins.check, realtime.check, shared_memory.check)
