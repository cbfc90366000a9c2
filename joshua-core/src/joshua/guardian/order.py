"""The order of a driver to its guardian, sent once before torque is enabled, and the codes sent after it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import Any

#: Interval of the heartbeats.
BEAT_S = 0.05

#: Default time without a heartbeat that counts as a hang. Measured under four busy loops on two cores: up to
#: 0.21 s in all, up to 0.10 s without the time in which the loop waited for a processor.
HANG_LIMIT_S = 0.3

#: Exit status of a guardian that could not verify the safe state and has reported that.
INCOMPLETE = 3

#: Name of a guardian process, by which its use of a port is recognised.
PROCESS_TITLE = "joshua-guardian"

#: An action that has not returned this long after the order's timeout is killed.
OVERTIME_S = 1.5

# Codes of the driver, one byte each.
ARMED = b"A"  # joints may have torque from here on
BEAT = b"B"
STOPPING = b"S"  # the driver applies the safe state itself, without heartbeats for a moment
RELEASE_ONLY = b"R"  # the safe state is torque off, whatever was ordered
EXECUTE = b"X"  # the driver has closed the device: apply the safe state
DONE = b"D"  # the safe state is reached: nothing is left to guard

#: Sent by the guardian when it can take over.
READY = b"ready\n"


@dataclass(frozen=True)
class GuardianOrder:
    """One actuator to guard.

    Attributes:
        node: fully qualified name.
        implementation: import string of the device's ``SafeStopRequest``.
        request: its plain values; release_request: for torque off, used after a protection trip and during an
            e-stop (empty: ``request``).
        timeout_s: for reaching the safe state.
        process_id, thread_id: of the driver and of its control loop.
        hang_limit_s: time without a heartbeat that counts as a hang.
        log: file of the run for reports, "" for none.
        control_socket: of the run, whose supervisor gets the report first; "" for none.
        robot, domain_id: whose e-stop counts.
        latch_folder: of the e-stops, "" for none.
        estop_files: folder of the run for reports about an e-stop.
        energised_record: file that says that the joints have torque, "" for none.
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
    energised_record: str = ""

    def to_values(self) -> dict[str, Any]:
        """Values for JSON."""
        return asdict(self)

    def to_line(self) -> bytes:
        """The order as one line."""
        return json.dumps(self.to_values()).encode() + b"\n"

    @classmethod
    def from_line(cls, line: bytes) -> GuardianOrder:
        """Reads the result of ``to_line``. Raises ValueError, TypeError."""
        return cls(**json.loads(line))
