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
from joshua.testing.conformance import Checklist, ViolationError, clause, name_of, refuses, require

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

    @clause("the message must say that the calls are in the wrong order, not that the model failed")
    def order(self) -> None:
        with lifecycle.made(self._factory, close) as model:
            cause = "act does not check that the model is loaded"
            refuses(lambda: model.act(self._observe()), ModelError, "act before load", cause)
            _load(model)
            model.close()
            refuses(lambda: model.act(self._observe()), ModelError, "act after close", cause)

    def load(self) -> None:
        with self._loaded():
            pass

    def actions(self) -> None:
        with self._loaded() as model:
            count = len(model.joints.names)
            actions: Any = model.act(self._observe())
            kind = type(actions).__name__
            kind += f" of {actions.dtype}" if isinstance(actions, np.ndarray) else ""
            require(
                isinstance(actions, np.ndarray) and actions.dtype == np.float64,
                f"act returned {kind}",
                "act returns a tensor, or an array of another type",
                "actions are radians in float64, without the types of the model's library",
            )
            require(
                actions.ndim == 2 and actions.shape[0] >= 1 and actions.shape[1] == count,
                f"act returned shape {actions.shape}; {count} joints need (T, {count}), T ≥ 1",
                "act returns one action without the dimension of time, or several with that of a batch",
                "the node plays one row for each period of the publisher",
            )
            require(
                bool(np.isfinite(actions).all()),
                "act returned a value that is not finite",
                "a normalisation divides by a deviation of zero, or the weights did not converge",
                "the node refuses such actions and fails",
            )

    @clause("actions are positions in radians that the joints can reach")
    def limits(self) -> None:
        with self._loaded() as model:
            joints = model.joints
            for _ in range(20):
                actions = model.act(self._observe())
                over = np.maximum(actions - joints.position_max_rad, joints.position_min_rad - actions).max()
                require(
                    over <= 1e-6,
                    f"an action is {over:.3f} rad beyond a joint's limits",
                    "actions stay in the model's normalised range, or are not clipped",
                )

    def own_data(self) -> None:
        with self._loaded() as model:
            observation = self._observe()
            shown = copy.deepcopy(dict(observation.values))
            first = model.act(observation)
            kept = first.copy()
            require(
                _same(dict(observation.values), shown),
                "act changed the observation",
                "the preprocessing works in place",
                "other parts of the node use the same data",
            )
            model.act(self._observe())
            require(
                bool((first == kept).all()),
                "the next act changed the actions that were returned before",
                "one buffer is used for all actions",
                "a chunk plays while the model works on the next one",
            )

    def reset(self) -> None:
        with self._loaded() as model:
            for _ in range(2):
                model.act(self._observe())
                model.reset()
            model.act(self._observe())

    @clause("a run may hold two models of the same kind in one process")
    def instances(self) -> None:
        first, second = self._factory(), self._factory()
        require(first is not second, "the factory made the same object twice", lifecycle.SHARED)
        with lifecycle.made(lambda: first, close), lifecycle.made(lambda: second, close):
            _load(first)
            what = "act of one while only the other is loaded"
            refuses(lambda: second.act(self._observe()), ModelError, what, lifecycle.SHARED)
            second.load()
            second.close()
            try:
                first.act(self._observe())
            except Exception as error:
                observed = f"closing one broke the other: {type(error).__name__}: {error}"
                raise ViolationError(observed, cause=lifecycle.SHARED) from error


def _same(first: dict[str, Any], second: dict[str, Any]) -> bool:
    return first.keys() == second.keys() and all(np.array_equal(first[key], second[key]) for key in second)
