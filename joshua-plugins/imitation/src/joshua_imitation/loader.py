"""Batches in an order determined by the seed, prepared ahead by any number of threads."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from joshua.features import ACTION, STATE

from joshua_imitation.augmentation import Augmentation
from joshua_imitation.data import Array, Recording, Windows
from joshua_imitation.pictures import Album

Batch = dict[str, Any]

#: Number of batches that each thread prepares ahead.
_AHEAD = 2


@dataclass(frozen=True)
class Share:
    """A batch of an update.

    Attributes:
        number: of the batch in its update; frames: of the batch; weight: its share of the frames.
    """

    number: int
    frames: Array
    weight: float


class Order:
    """Frames of each update: a new permutation in each epoch.

    Args:
        frames: to learn from; batch_size: of one batch; accumulated: batches of one update, of each process.
        seed: of the order; rank, size: which of how many processes this is.
    """

    def __init__(
        self, frames: Array, batch_size: int, accumulated: int, seed: int, rank: int = 0, size: int = 1
    ) -> None:
        self._frames, self._seed, self._rank, self._size = frames, seed, rank, size
        self._batch, self._update = batch_size, batch_size * accumulated * size
        self.updates_per_epoch = -(-len(frames) // self._update)
        self._epoch, self._mixed = -1, frames

    def batches(self, update: int) -> list[Share]:
        """Return the batches of an update, counted from 0, that this process learns from.

        At the end of an epoch, a process without a batch takes the first one with the weight 0.
        """
        epoch, at = divmod(update, self.updates_per_epoch)
        if epoch != self._epoch:
            self._mixed = np.random.default_rng([self._seed, 2, epoch]).permutation(self._frames)
            self._epoch = epoch
        chosen = self._mixed[at * self._update : (at + 1) * self._update]
        parts = [chosen[i : i + self._batch] for i in range(0, len(chosen), self._batch)]
        found = [Share(number, part, len(part) / len(chosen)) for number, part in enumerate(parts)]
        return found[self._rank :: self._size] or [Share(0, parts[0], 0.0)]


class Maker:
    """Makes batches as LeRobot's data sets do: joints, chunks of actions, pictures from 0 to 1, tasks.

    Args:
        recording, album: training data; windows: of the policy; augmentation: None for none.
    """

    def __init__(
        self, recording: Recording, album: Album, windows: Windows, augmentation: Augmentation | None = None
    ) -> None:
        self._recording, self._album, self._windows = recording, album, windows
        self._augmentation = augmentation
        self._spread = recording.numbers[STATE].std(axis=0) if STATE in recording.numbers else None

    def make(self, frames: Array, update: int = 0, number: int = 0) -> Batch:
        """Make the batch of some frames; ``update`` and the batch's ``number`` seed the augmentation."""
        recording, windows = self._recording, self._windows
        batch: Batch = {}
        chances = self._augmentation.chances(frames, update, number) if self._augmentation else None
        for key, values in recording.numbers.items():
            distances = windows.done if key == ACTION else windows.seen
            if distances:
                held, padded = recording.window(frames, distances)
                batch[key] = torch.from_numpy(values[held])
                batch[f"{key}_is_pad"] = torch.from_numpy(padded)
            else:
                batch[key] = torch.from_numpy(values[frames])
        if self._augmentation is not None and self._spread is not None:
            batch[STATE] = self._augmentation.disturb(batch[STATE], self._spread, update, number)
        for key in recording.pictures:
            if windows.seen:
                held, padded = recording.window(frames, windows.seen)
                batch[f"{key}_is_pad"] = torch.from_numpy(padded)
            else:
                held = frames
            pictures = torch.from_numpy(self._album.get(key, held))
            values = torch.movedim(pictures, -1, -3).contiguous().float().div_(255)
            if self._augmentation is not None and chances is not None:
                values = self._augmentation.apply(values, chances)
            batch[key] = values
        batch["task"] = [recording.tasks[index] for index in frames]
        return batch


class Loader:
    """Iterator over the batches of each update, with their number and weight in it.

    Args:
        maker, order: of the batches; first: update to begin with; last: one after the end.
        threads: that prepare ahead; 0 prepares on demand.

    Attributes:
        waited_s: total time spent in ``next``.
    """

    def __init__(self, maker: Maker, order: Order, first: int, last: int, threads: int) -> None:
        self._maker, self._order, self._last = maker, order, last
        self._next = first
        self._ready: deque[Future[list[tuple[Share, Batch]]]] = deque()
        self._pool = ThreadPoolExecutor(threads, "batches") if threads else None
        self._ahead = _AHEAD * threads
        self.waited_s = 0.0

    def __iter__(self) -> Iterator[list[tuple[Share, Batch]]]:
        return self

    def __next__(self) -> list[tuple[Share, Batch]]:
        """Return the batches of the next update."""
        began = time.perf_counter()
        try:
            if self._pool is None:
                if self._next >= self._last:
                    raise StopIteration
                self._next += 1
                return self._made(self._order.batches(self._next - 1), self._next - 1)
            while len(self._ready) <= self._ahead and self._next < self._last:
                chosen = self._order.batches(self._next)
                self._ready.append(self._pool.submit(self._made, chosen, self._next))
                self._next += 1
            if not self._ready:
                raise StopIteration
            return self._ready.popleft().result()
        finally:
            self.waited_s += time.perf_counter() - began

    def close(self) -> None:
        """Ends the threads."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def _made(self, chosen: list[Share], update: int) -> list[tuple[Share, Batch]]:
        return [(share, self._maker.make(share.frames, update, share.number)) for share in chosen]
