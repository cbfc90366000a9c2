"""What the documentation says about one diagnostic code."""

from __future__ import annotations

from typing import NamedTuple


class CodeDoc(NamedTuple):
    """One row of the diagnostics table: the cause of a code and the next step, one sentence each."""

    cause: str
    next_step: str
