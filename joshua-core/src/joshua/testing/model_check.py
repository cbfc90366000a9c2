"""The conformance check of models."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from joshua.models.model import Model, ModelError, Observation
from joshua.testing import lifecycle
from joshua.testing.conformance import Checklist, must, must_refuse, name_of, said, violation
from joshua.testing.values import kind_of

ModelFactory = Callable[[], Model]


def check_model(
    factory: ModelFactory,
    *,
    observe: Callable[[], Observation] | None = None,
    only: Collection[str] = (),
) -> None:
    """Check a model against the contract of ``joshua.models.model.Model``.

    Args:
        factory: makes a model that is not loaded; each call a new one.
        observe: makes an observation that the model can act on; without it, one without values.
        only: names of the clauses to check, such as ``("limits",)`` while you fix one; empty for all.

    Raises:
        ConformanceError: lists every violated clause: what was observed, why it is wrong, the likely cause.
        ValueError: ``only`` names a clause that does not exist.
    """
    clauses = _Clauses(factory, observe or (lambda: Observation(time.time_ns())))
    checklist = Checklist(name_of(factory, close), only)
    checklist.run("constructor", lambda: lifecycle.check_constructor(factory, Model, close))
    checklist.run("order", clauses.order)
    if checklist.run("load", clauses.load):
        if checklist.run("actions", clauses.actions):
            checklist.run_methods(clauses, "limits", "own data", "reset")
        checklist.run("close", lambda: lifecycle.check_idempotent_close(factory, clauses.states, close))
        checklist.run("nothing left", lambda: lifecycle.check_nothing_left(factory, clauses.use, close))
        checklist.run("instances", clauses.instances)
    checklist.finish()


def close(model: Model) -> None:
    """Close a model."""
    model.close()


def _load(model: Model) -> None:
    model.load()
    model.reset()


class _Clauses:
    """One method for each clause; each makes its own model."""

    def __init__(self, factory: ModelFactory, observe: Callable[[], Observation]) -> None:
        self._factory = factory
        self._observe = observe
        self.states: dict[str, Callable[[Model], None]] = {
            "never loaded": lambda model: None,
            "loaded": _load,
            "used": self.use,
        }

    def use(self, model: Model) -> None:
        """Use a model as a node does."""
        _load(model)
        model.act(self._observe())

    @contextmanager
    def _loaded(self) -> Iterator[Model]:
        with lifecycle.made(self._factory, close) as model:
            _load(model)
            yield model

    def order(self) -> None:
        with lifecycle.made(self._factory, close) as model:
            must_refuse("order.unloaded", lambda: model.act(self._observe()), ModelError, "before load")
            _load(model)
            model.close()
            must_refuse("order.unloaded", lambda: model.act(self._observe()), ModelError, "after close")

    def load(self) -> None:
        with self._loaded():
            pass

    def actions(self) -> None:
        with self._loaded() as model:
            count = len(model.joints.names)
            actions: Any = model.act(self._observe())
            is_array = isinstance(actions, np.ndarray) and actions.dtype == np.float64
            must("actions.type", is_array, kind_of(actions))
            fits = actions.ndim == 2 and actions.shape[0] >= 1 and actions.shape[1] == count
            must("actions.shape", fits, actions.shape, count)
            must("actions.finite", bool(np.isfinite(actions).all()))

    def limits(self) -> None:
        with self._loaded() as model:
            joints = model.joints
            for _ in range(20):
                actions = model.act(self._observe())
                over = np.maximum(actions - joints.position_max_rad, joints.position_min_rad - actions).max()
                must("actions.beyond", over <= 1e-6, over)

    def own_data(self) -> None:
        with self._loaded() as model:
            observation = self._observe()
            shown = copy.deepcopy(dict(observation.values))
            first = model.act(observation)
            kept = first.copy()
            must("observation", _same(dict(observation.values), shown))
            model.act(self._observe())
            must("actions.shared", bool((first == kept).all()))

    def reset(self) -> None:
        with self._loaded() as model:
            for _ in range(2):
                model.act(self._observe())
                model.reset()
            model.act(self._observe())

    def instances(self) -> None:
        first, second = self._factory(), self._factory()
        must("factory.same", first is not second)
        with lifecycle.made(lambda: first, close), lifecycle.made(lambda: second, close):
            _load(first)
            must_refuse("instances.loaded", lambda: second.act(self._observe()), ModelError)
            second.load()
            second.close()
            try:
                first.act(self._observe())
            except Exception as error:
                raise violation("instances.broke", said(error)) from error


def _same(first: dict[str, Any], second: dict[str, Any]) -> bool:
    return first.keys() == second.keys() and all(np.array_equal(first[key], second[key]) for key in second)
