"""What a driver tells its guardian, once, before it energises a joint."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import Any

#: Distance of two signs of life.
BEAT_S = 0.05

#: Silence that counts as a hang.
HANG_LIMIT_S = 0.2

#: An action that has not returned this long after the order's time is given up.
OVERTIME_S = 1.5

# Words of the driver, one byte each.
ARMED = b"A"  # from now on the joints may be energised
BEAT = b"B"
STOPPING = b"S"  # the driver applies the safe state itself and needs a moment without beats
RELEASE_ONLY = b"R"  # whatever the safe state is: from now on it is no torque
EXECUTE = b"X"  # the driver has closed the device: apply the safe state now
DONE = b"D"  # the safe state stands: nothing is left to guard

#: What the guardian says when it is ready to take over.
READY = b"ready\n"


@dataclass(frozen=True)
class GuardianOrder:
    """One actuator to guard.

    Attributes:
        node: fully qualified name.
        implementation: import string of the ``SafeStopRequest`` of the device.
        request: its plain values.
        timeout_s: by when the safe state is to stand.
        process_id, thread_id: of the driver and of its control loop.
        hang_limit_s: silence that counts as a hang.
        log: file of the run that a report is appended to; "" for none.
        control_socket: of the run, whose supervisor hears of a report first; "" for none.
        release_request: the one where no torque is called for, whatever the safe state is: after a
            trip of a protection, and while an e-stop is latched; empty takes ``request``.
        robot, domain_id: whose e-stop counts.
        latch_folder: where e-stops are latched; "" for nowhere.
        estop_files: folder of the run for reports about an e-stop.
    """

    node: str
    implementation: str
    request: dict[str, Any]
    timeout_s: float
    process_id: int
    thread_id: int
    hang_limit_s: float = HANG_LIMIT_S
    log: str = ""
    control_socket: str = ""
    release_request: dict[str, Any] = field(default_factory=dict)
    robot: str = ""
    domain_id: int = 0
    latch_folder: str = ""
    estop_files: str = ""

    def to_line(self) -> bytes:
        """The order as one line."""
        return json.dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def from_line(cls, line: bytes) -> GuardianOrder:
        """Reads what ``to_line`` wrote. Raises ValueError, TypeError."""
        return cls(**json.loads(line))
