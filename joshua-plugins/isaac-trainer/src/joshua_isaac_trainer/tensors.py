"""The functions of NumPy that terms of tasks call, computed by PyTorch on one device."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch


class TensorArrays:
    """Array module of a ``State`` made of tensors.

    Args:
        device: of all tensors, such as ``cuda:0``; dtype: of numbers.
    """

    def __init__(self, device: str = "cpu", dtype: torch.dtype = torch.float32) -> None:
        self.device, self.dtype = torch.device(device), dtype

    def asarray(self, values: Any) -> torch.Tensor:
        """Return a tensor of numbers on the device, from NumPy or a tensor."""
        return torch.as_tensor(values, dtype=self.dtype, device=self.device)

    def _like(self, values: Any) -> torch.Tensor:
        return values if isinstance(values, torch.Tensor) else self.asarray(values)

    def zeros(self, shape: Any, kind: Any = None) -> torch.Tensor:
        """See NumPy; ``kind`` bool gives a mask."""
        size = (shape,) if isinstance(shape, int) else tuple(shape)
        return torch.zeros(size, dtype=torch.bool if kind is bool else self.dtype, device=self.device)

    def ones(self, shape: Any) -> torch.Tensor:
        """See NumPy."""
        return torch.ones(shape, dtype=self.dtype, device=self.device)

    def clip(self, values: Any, low: Any, high: Any) -> torch.Tensor:
        """See NumPy; ends may be numbers or arrays of NumPy."""
        return torch.clamp(self._like(values), min=self._like(low), max=self._like(high))

    def where(self, condition: torch.Tensor, first: Any, second: Any) -> torch.Tensor:
        """See NumPy."""
        return torch.where(condition, self._like(first), self._like(second))

    def stack(self, parts: Sequence[torch.Tensor], axis: int = 0) -> torch.Tensor:
        """See NumPy."""
        return torch.stack(list(parts), dim=axis)

    def concatenate(self, parts: Sequence[torch.Tensor], axis: int = 0) -> torch.Tensor:
        """See NumPy."""
        return torch.cat([self._like(part) for part in parts], dim=axis)

    def broadcast_to(self, values: Any, shape: Sequence[int]) -> torch.Tensor:
        """See NumPy."""
        return torch.broadcast_to(self._like(values), tuple(shape))

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """Functions of one or two tensors that PyTorch names and defines as NumPy does."""
        if name not in ("sqrt", "tanh", "abs", "cos", "sin", "hypot", "zeros_like"):
            raise AttributeError(f"TensorArrays has no {name}: add it for the term that calls it")
        function: Callable[..., Any] = getattr(torch, name)
        return function


class TensorDraws:
    """Random numbers of n simulations from one generator of PyTorch, as starts of episodes draw them."""

    def __init__(self, arrays: TensorArrays, count: int, generator: torch.Generator) -> None:
        self._arrays, self._count, self._generator = arrays, count, generator

    def uniform(self, low: float, high: float, shape: tuple[int, ...] = ()) -> torch.Tensor:
        """Draw uniform numbers, shape (n, *shape)."""
        return low + (high - low) * self._drawn(torch.rand, shape)

    def normal(self, shape: tuple[int, ...] = ()) -> torch.Tensor:
        """Draw standard normal numbers, shape (n, *shape)."""
        return self._drawn(torch.randn, shape)

    def until(self, propose: Callable[[Any], Any], accept: Callable[[Any], Any], tries: int) -> torch.Tensor:
        """Draw until every row is accepted, at most ``tries`` times; the last proposal stays."""
        values: torch.Tensor = propose(self)
        for _ in range(tries - 1):
            good = accept(values)
            if bool(good.all()):
                break
            values = torch.where(good[:, None], values, propose(self))
        return values

    def _drawn(self, function: Callable[..., torch.Tensor], shape: tuple[int, ...]) -> torch.Tensor:
        arrays = self._arrays
        return function(
            (self._count, *shape), generator=self._generator, dtype=arrays.dtype, device=arrays.device
        )


def rotated(attitude: torch.Tensor, vector: torch.Tensor) -> torch.Tensor:
    """Rotate a vector, shape (3,), by unit quaternions (w, x, y, z), shape (N, 4); returns (N, 3)."""
    axis = attitude[:, 1:]
    vectors = vector.expand_as(axis)
    cross = 2.0 * torch.linalg.cross(axis, vectors)
    return vectors + attitude[:, :1] * cross + torch.linalg.cross(axis, cross)
