"""MODE_TEST: something to test, and followers that fit their leaders."""

from __future__ import annotations

from collections.abc import Iterator

from joshua.config.checks import Context
from joshua.modes.parts import actions, lacks
from joshua.modes.teleoperate import joint_counts, leaders
from joshua.plan import Diagnostic


def check(context: Context) -> Iterator[Diagnostic]:
    """Asks for at least one device or model."""
    if not context.entries:
        yield lacks(
            context,
            "mode-lacks-device",
            "at least one device to test",
            "robot",
            remedy="Add robot { actions { ... } } or robot { perceptions { ... } }",
        )
    sources = leaders(context)
    for entry in actions(context):
        yield from joint_counts(context, entry, sources)
