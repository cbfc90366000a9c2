"""What ``joshua estop`` says of each actuator."""

from __future__ import annotations

from collections.abc import Sequence

from joshua.guardian.latch import EstopReport

_BY = {"driver": "its driver", "guardian": "its guardian", "command": "this command"}


def lines(reports: Sequence[EstopReport]) -> list[str]:
    """One line for each actuator: whether its torque is off, who has seen to it, and how that is known."""
    from joshua.supervisor.tables import clean, columns

    rows = [("  ACTUATOR", "TORQUE", "")]
    rows += [(f"  {report.node}", _torque(report), _how(report)) for report in reports]
    return [clean(line) for line in columns(rows)]


def _torque(report: EstopReport) -> str:
    if not report.complete:
        return "UNKNOWN"
    return "off" if report.verified else "off (not read back)"


def _how(report: EstopReport) -> str:
    by = _BY.get(report.by, report.by)
    if not report.complete:
        confirmed = [joint for joint, state in report.joints.items() if state in ("released", "was off")]
        partly = f"released are only {', '.join(confirmed)}; " if confirmed else ""
        reason = (report.detail or "the device did not confirm").rstrip(".")
        return f"could not be reached: {partly}{reason}; cut its supply by hand"
    if report.verified:
        return f"read back from {len(report.joints)} joints by {by}"
    return f"told by {by}; the device cannot say whether it is"
