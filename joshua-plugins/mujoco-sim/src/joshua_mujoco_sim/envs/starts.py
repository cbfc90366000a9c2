"""How episodes start: pure functions of random draws, for arrays of NumPy and of JAX."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import mujoco
import numpy as np


class Draws(Protocol):
    """Random numbers for n simulations, from a generator each, so that an episode depends on its own seed."""

    def uniform(self, low: float, high: float, shape: tuple[int, ...] = ()) -> Any:
        """Draw uniform numbers, shape (n, *shape)."""

    def normal(self, shape: tuple[int, ...] = ()) -> Any:
        """Draw standard normal numbers, shape (n, *shape)."""

    def until(self, propose: Callable[[Any], Any], accept: Callable[[Any], Any], tries: int) -> Any:
        """Draw until every row is accepted, at most ``tries`` times; the last proposal stays.

        Args:
            propose: pure function of draws that gives shape (n, …); accept: which rows are good, shape (n,).
        """


@dataclass(frozen=True)
class Start:
    """The simulations that restart, as they stand after the keyframe; terms return a changed one.

    Attributes:
        xp: the module that computes with the arrays; model: compiled, for constants.
        qpos, qvel, mocap_pos: shapes (n, nq), (n, nv), (n, nmocap, 3).
        nominal: value of a field of the model before randomisation, without a leading axis.
        parameters: fields of the model with a value for each simulation, (n, …).
    """

    xp: Any
    model: mujoco.MjModel
    qpos: Any
    qvel: Any
    mocap_pos: Any
    nominal: Callable[[str], Any]
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def parameter(self, name: str) -> Any:
        """Return a field of the model with a value for each simulation, (n, …)."""
        found = self.parameters.get(name)
        if found is None:
            value = self.nominal(name)
            found = self.xp.broadcast_to(value, (self.qpos.shape[0], *value.shape))
        return found

    def with_parameter(self, name: str, values: Any) -> Start:
        """Return the start with a field of the model changed."""
        return replace(self, parameters={**self.parameters, name: values})


def with_values(array: Any, key: Any, values: Any) -> Any:
    """Return a copy of an array, of NumPy, JAX or PyTorch, in which ``array[key]`` has other values."""
    if hasattr(array, "at"):
        return array.at[key].set(values)
    changed = array.clone() if hasattr(array, "clone") else array.copy()
    changed[key] = values
    return changed


class GeneratorDraws:
    """Draws of NumPy's generators, one for each simulation."""

    def __init__(self, generators: Sequence[np.random.Generator]) -> None:
        self._generators = generators

    def uniform(self, low: float, high: float, shape: tuple[int, ...] = ()) -> Any:
        """See ``Draws``."""
        return np.array([generator.uniform(low, high, shape) for generator in self._generators])

    def normal(self, shape: tuple[int, ...] = ()) -> Any:
        """See ``Draws``."""
        return np.array([generator.standard_normal(shape) for generator in self._generators])

    def until(self, propose: Callable[[Any], Any], accept: Callable[[Any], Any], tries: int) -> Any:
        """See ``Draws``."""
        values = propose(self)
        for _ in range(tries - 1):
            again = np.flatnonzero(~accept(values))
            if not again.size:
                break
            values[again] = propose(GeneratorDraws([self._generators[index] for index in again.tolist()]))
        return values
