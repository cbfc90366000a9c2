"""Data of a servo family: addresses and meaning of its registers."""

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
        kept: those of them that do not change while torque is on, which reveals a power cut.
        speed: the one that limits the speed; speed_of: its value for a speed in ticks/s.
        feedback: address and length of the block read for the state.
        parse_feedback: reads that block.
        status: bits of the status in ``Feedback``.
        reads_gaps: addresses without a register can be read together with their neighbours.
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
