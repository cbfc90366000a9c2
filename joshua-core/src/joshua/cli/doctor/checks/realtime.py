"""May control loops run with real-time priority?"""

from __future__ import annotations

import re
from collections.abc import Iterator

from joshua.cli.doctor.finding import Finding, Level
from joshua.cli.doctor.host import Host

NAME = "real-time priority"


def check(host: Host) -> Iterator[Finding]:
    """Reads the limit that the system grants to this session."""
    found = re.search(r"^Max realtime priority\s+(\S+)", host.read("proc/self/limits"), re.MULTILINE)
    if found is None:
        return  # no Linux
    granted = found[1]
    if granted != "0":
        yield Finding(Level.OK, NAME, host.user, f"granted up to {granted}")
        return
    yield Finding(
        Level.NOTE,
        NAME,
        host.user,
        "is not granted: a busy machine delays control loops by some milliseconds now and then",
        f'echo "{host.user} - rtprio 1" | sudo tee /etc/security/limits.d/joshua.conf, then log in again',
    )
