"""Settings of every test: none of them is judged by how busy the machine is."""

from __future__ import annotations

import contextlib
import os
import signal

# A shell that starts the tests in the background lets them ignore Ctrl-C, and with them what they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# A short ``--duration`` also limits the start, and a busy machine starts slowly.
os.environ.setdefault("JOSHUA_START_TIMEOUT", "200")

with contextlib.suppress(ImportError):  # the session of mjx installs less
    from hypothesis import HealthCheck, settings

    # A deadline for an example, and one for its data, fail on a machine that holds a test up for a moment.
    # The examples are the same in every run; ``--hypothesis-profile=explore`` looks for new ones.
    _PATIENT = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
    settings.register_profile("explore", parent=_PATIENT)
    settings.register_profile("steady", parent=_PATIENT, derandomize=True)
    settings.load_profile("steady")
