"""Plays action chunks one step a period, and asks for the next chunk before one ends."""

from __future__ import annotations

import threading

from joshua.models.model import FloatArray


class ChunkPlayer:
    """Hands the steps of action chunks to the node's timer; chunks come from the model's thread.

    The model works beside the timer: a new chunk is wanted as soon as the one that plays is down to half,
    and takes over where that one ends. The first step of a chunk is thus the one after the last of the
    chunk before it.
    """

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._playing: FloatArray | None = None
        self._at = 0
        self._next: FloatArray | None = None

    def put(self, chunk: FloatArray) -> None:
        """Takes the next chunk, shape (T, N)."""
        with self._condition:
            self._next = chunk

    def step(self) -> FloatArray | None:
        """The next action, shape (N,); None when the model has not delivered one in time."""
        with self._condition:
            if self._playing is None or self._at >= len(self._playing):
                self._playing, self._next, self._at = self._next, None, 0
            action = None
            if self._playing is not None:
                action = self._playing[self._at]
                self._at += 1
            if self._wants_chunk():
                self._condition.notify_all()
            return action

    def wait_until_wanted(self, timeout_s: float) -> bool:
        """Waits until a chunk is wanted; False when that takes longer."""
        with self._condition:
            return self._condition.wait_for(self._wants_chunk, timeout_s)

    def clear(self) -> None:
        """Drops everything that was to be played."""
        with self._condition:
            self._playing = self._next = None
            self._at = 0

    def _wants_chunk(self) -> bool:
        if self._next is not None:
            return False
        return self._playing is None or 2 * (len(self._playing) - self._at) <= len(self._playing)
