"""Decoder of AMT21 replies: 14 position bits below two check bits. Does no I/O."""

from __future__ import annotations

ANSWER_LENGTH = 2

_POSITION = 0x3FFF
_ODD, _EVEN = 0xAAAA, 0x5555


def position(answer: bytes, resolution: int) -> int | None:
    """Return the position in a two-byte reply, low byte first; None if the check bits are wrong.

    Each check bit gives odd parity: the upper one over the odd bits, the lower one over the even bits. 12-bit
    encoders send two zeros below their position.
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
