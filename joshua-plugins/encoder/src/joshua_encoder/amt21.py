"""The AMT21's answers: 14 bits of position, and two check bits above them; no input or output."""

from __future__ import annotations

ANSWER_LENGTH = 2

_POSITION = 0x3FFF
_ODD, _EVEN = 0xAAAA, 0x5555


def position(answer: bytes, resolution: int) -> int | None:
    """The position in an answer of two bytes, the lower one first; None if the check bits are wrong.

    Each check bit makes the number of ones odd: the upper one among the odd bits, the lower one among the
    even bits. Encoders of 12 bits send two zeros below their position.
    """
    if len(answer) != ANSWER_LENGTH:
        return None
    word = answer[0] | answer[1] << 8
    if (word & _ODD).bit_count() % 2 == 0 or (word & _EVEN).bit_count() % 2 == 0:
        return None
    count = word & _POSITION
    if resolution == _POSITION + 1:
        return count
    return None if count & 3 else count >> 2
