"""What is the same for all servos of one family: where their registers are, and what these mean."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from joshua_servo.feedback import Feedback
from joshua_servo.register import Register
from joshua_servo.status_bits import StatusBits


@dataclass(frozen=True)
class ServoFamily:
    """One family of servos.

    Attributes:
        moves: neighbouring registers that a move needs, the goal position among them.
        kept: those of them that stay as they are while torque is on, so that a power cut shows.
        speed: that of them which limits the speed; speed_of: its value for a speed in ticks/s.
        feedback: address and length of the block that one read of the state brings.
        parse_feedback: reads that block.
        status: bits of the status that ``Feedback`` carries.
        reads_gaps: addresses without a register can be read along with those around them.
    """

    torque_enable: Register
    goal_position: Register
    present_position: Register
    moves: tuple[Register, ...]
    kept: tuple[Register, ...]
    speed: Register
    speed_of: Callable[[int], int]
    feedback: tuple[int, int]
    parse_feedback: Callable[[bytes], Feedback]
    status: StatusBits
    reads_gaps: bool = True

    @property
    def moves_width(self) -> int:
        """Bytes of all registers of a move."""
        return sum(register.width for register in self.moves)
